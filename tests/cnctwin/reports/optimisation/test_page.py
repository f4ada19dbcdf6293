"""The page as a whole: in order, by itself, small, read by a strict parser, and deaf to what a program would like it to do."""

import base64
import hashlib
import math
import re
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cnctwin.reports.optimisation.page import report_html
from tests.cnctwin.reports.gap.page_reader import PageReader
from tests.cnctwin.reports.hostile import hostile
from tests.cnctwin.reports.optimisation.answers import ANSWERS, bare, long, mixed, nothing, paper, pareto
from twin.optimisation.answer import Objective, Optimised

ORDER = ["totals", "course", "binding", "lines", "front", "sensitivity", "search", "again", "diff", "alone", "notes", "limits"]
BYTES_MAX = 300_000


@cache
def text_of(name: str) -> str:
    return report_html(ANSWERS[name]())


@pytest.mark.parametrize("name", ANSWERS)
def test_every_answer_makes_a_page_that_a_strict_reader_reads(name: str) -> None:
    answer, page = ANSWERS[name](), PageReader(text_of(name))
    assert answer.sentence in page.text and answer.name in page.text
    headings = [given["id"] or "" for given in page.of("h2")]
    assert headings == sorted(headings, key=ORDER.index)
    assert {"totals", "course", "sensitivity", "search", "again", "diff", "limits"} <= set(headings)
    assert not re.search(r"\b(nan|inf|None)\b", page.text)


@pytest.mark.parametrize("name", ANSWERS)
def test_a_page_needs_nothing_from_elsewhere_has_no_script_and_stays_small(name: str) -> None:
    text = text_of(name)
    page = PageReader(text)
    assert not page.of("script")
    assert not [given for _, given in page.elements if {"src", "href", "style"} & set(given)]
    assert not [key for _, given in page.elements for key in given if key.startswith("on")]
    assert not re.search(r"https?://|url\(|@import", text)
    assert len(text.encode()) < BYTES_MAX


def test_the_policy_names_the_style_that_is_there_and_lets_no_script_run() -> None:
    text = report_html(paper())
    policy = PageReader(text).of("meta", http_equiv="Content-Security-Policy")[0]["content"] or ""
    style = re.search("<style>(.*?)</style>", text, re.S)
    assert style
    assert f"style-src 'sha256-{base64.b64encode(hashlib.sha256(style[1].encode()).digest()).decode()}'" in policy
    assert "default-src 'none'" in policy and "script-src" not in policy and "unsafe" not in policy


@pytest.mark.parametrize("make", [paper, mixed, pareto])
def test_no_text_of_the_program_is_ever_markup_or_script(make: Any) -> None:
    text = report_html(hostile(make()))
    text.encode()
    page = PageReader(text)
    assert not page.of("img") and not page.of("script") and len(page.of("style")) == 1
    assert "<script>alert(1)</script>" in page.text
    assert "\x00" not in text


def test_texts_that_grow_when_they_are_escaped_leave_the_page_small() -> None:
    answer = long(1000)
    lines = tuple(
        replace(line, text_before="\"'&<>" * 400, text_after="Ω𝛀" * 900, left_alone="<" * 2000) for line in answer.lines
    )
    diff = "\n".join('+"' + '"' * 5000 for _ in range(4000))
    much = replace(answer, lines=lines, diff=diff, notes=("<&" * 5000,) * 500, limits={f"<{n}": "&" * 5000 for n in range(500)})
    assert len(report_html(much).encode()) < BYTES_MAX


def without_numbers(value: Any, number: float) -> Any:
    """The same with this for every number."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: without_numbers(getattr(value, f.name), number) for f in fields(value)})
    if type(value) is float:
        return number
    if isinstance(value, tuple):
        return tuple(without_numbers(part, number) for part in value)
    return {key: without_numbers(part, number) for key, part in value.items()} if isinstance(value, dict) else value


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300])
@pytest.mark.parametrize("name", [name for name in ANSWERS if name != "long"])
def test_a_figure_that_there_is_none_of_breaks_nothing(name: str, number: float) -> None:
    page = PageReader(report_html(without_numbers(ANSWERS[name](), number)))
    assert not re.search(r"\b(nan|inf)\b", page.text)
    drawn = [
        value or "" for _, given in page.elements for key, value in given.items() if key in ("d", "x", "y", "width", "x1", "x2")
    ]
    assert not re.search(r"nan|inf", " ".join(drawn))


texts = st.text(max_size=30)


@given(name=texts, line=texts, diff=texts, reason=texts, key=texts, limit=texts, currency=texts)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_any_text_makes_a_page(name: str, line: str, diff: str, reason: str, key: str, limit: str, currency: str) -> None:
    answer = paper()
    first = replace(answer.lines[0], text_before=line, text_after=diff, left_alone=reason, binds="")
    lines = (first, *answer.lines[1:])
    made = replace(answer, name=name, lines=lines, diff=diff, limits={key: limit, f"force {key}": limit}, currency=currency)
    PageReader(report_html(made))


def test_the_same_answer_is_the_same_page() -> None:
    assert report_html(mixed()) == report_html(mixed())


def test_the_figures_of_the_paper_are_told_with_their_units_and_where_they_come_from() -> None:
    text = PageReader(report_html(paper())).text
    for words in ("29.48 → to 24.51", "−16.9 %", "120.1 → to 76.39", "−36.4 %", "Cost, KRW", "limit 60 N", "at the limit"):
        assert words in text
    assert "0.04 % above the bound" in text and "a program within the limits reaches it" in text
    assert "Every figure is modelled by the twin of vmc; none of them was measured." in text


def test_a_bound_that_no_program_need_reach_is_called_so() -> None:
    text = PageReader(report_html(bare())).text
    assert "No program can beat it, and perhaps none reaches it" in text and "reaches it, so" not in text
    assert "Above the bound" in text and "which no program can beat" in text and "need reach" not in text


def test_without_cost_limits_or_a_second_run_nothing_is_made_up() -> None:
    text = PageReader(report_html(bare())).text
    assert "Cost" not in text and "KRW" not in text
    assert "no limit of force was set" in text
    assert "Not told: with no limit of force" in text
    assert "It was not: the figures above are those of the search." in text


def test_a_program_without_a_line_that_feeds_is_a_page_too() -> None:
    page = PageReader(report_html(nothing()))
    assert "No line of this program cuts or feeds." in page.text
    assert "Nothing: the program stays as it is, letter for letter." in page.text


def test_lines_above_a_limit_are_bad_news_at_once() -> None:
    answer = mixed()
    text = PageReader(report_html(answer)).text
    assert answer.after.over > 0
    assert f"{answer.after.over} lines above a limit , as modelled" in text
    assert "All limits kept" not in text and "▲ see the lines" in text


@pytest.mark.parametrize(("objective", "words"), [(Objective.TIME, "best time, s"), (Objective.COST, "best cost, KRW")])
def test_the_course_of_the_search_says_what_it_is_of(objective: Objective, words: str) -> None:
    answer: Optimised = replace(paper(), objective=objective)
    page = report_html(answer)
    assert f"{words}, after each evolution" in PageReader(page).text
    assert '<span class="unit">evolution</span>' in page


@pytest.mark.parametrize(
    ("known", "says"),
    [
        (
            {"kept": 0.503, "asked": None, "price_pct": 26.0, "identified": False},
            "The force limit is kept with 50 % probability, and none of its constants was identified; --probability 0.95 costs "
            "26 % more",
        ),
        ({"kept": 0.7, "asked": None, "price_pct": 0.0}, "with 70 % probability; --probability 0.95 costs no more"),
        ({"kept": 0.7, "asked": None, "price_pct": math.inf}, "70 % probability; no program is known that keeps it with 95 %"),
        ({"kept": 0.7, "asked": 0.95}, "The force limit is kept with 70 % probability; 95 % was asked for"),
    ],
)
def test_a_limit_of_force_that_is_a_coin_toss_has_no_tick(known: dict[str, Any], says: str) -> None:
    answer = paper()
    assert answer.sensitivity is not None
    page = PageReader(report_html(replace(answer, sensitivity=replace(answer.sensitivity, **known))))
    assert says in page.text and "mean twin" not in page.text
    assert page.of("header", class_="unsure") and not page.of("header", class_="healthy")


@pytest.mark.parametrize("known", [{"kept": 0.99, "asked": None}, {"kept": 0.945, "asked": 0.95}])
def test_a_limit_of_force_that_is_kept_surely_has_one(known: dict[str, Any]) -> None:
    answer = paper()
    assert answer.sensitivity is not None
    page = PageReader(report_html(replace(answer, sensitivity=replace(answer.sensitivity, **known))))
    assert "All limits kept, that of force with 9" in page.text
    assert page.of("header", class_="healthy")


def test_a_time_has_one_form_wherever_it_stands() -> None:
    text = PageReader(report_html(replace(paper(), after=replace(paper().after, seconds=5.469)))).text
    assert "5.47" in text and "5.469" not in text


def test_the_style_is_in_the_package() -> None:
    import cnctwin.reports.optimisation

    assert (Path(cnctwin.reports.optimisation.__file__).parent / "optimise.css").is_file()
