"""What each section says: charts, lines, what binds, the front, the uncertainty, the difference."""

import re
from dataclasses import replace

import numpy as np
import pytest

from cnctwin.reports.optimisation.binding import bound_by
from cnctwin.reports.optimisation.course import blocks, edges_of, steps
from cnctwin.reports.optimisation.kept import ranges
from cnctwin.reports.optimisation.lines import ROWS_MAX, chosen, limits_of
from cnctwin.reports.optimisation.page import report_html
from cnctwin.reports.optimisation.quantity import limit_figure
from cnctwin.reports.optimisation.totals import bounds
from tests.cnctwin.reports.gap.page_reader import PageReader
from tests.cnctwin.reports.optimisation.answers import SENSITIVITY, bare, long, mixed, paper, pareto
from twin.optimisation.answer import Binds, Objective, Optimised


def read(answer: Optimised) -> PageReader:
    return PageReader(report_html(answer))


@pytest.mark.parametrize(
    ("text", "figure"),
    [
        ("60 N", 60.0),
        ("60.5 N with a probability of 95 %", 60.5),
        ("at most 1,200 N", 1200.0),
        ("60 N·m", None),
        ("60", None),
        ("none", None),
    ],
)
def test_the_line_of_the_limit_is_where_its_words_say(text: str, figure: float | None) -> None:
    assert limit_figure({"cutting force": text}, "force") == figure


def test_limits_of_force_are_drawn_even_where_they_are_far_and_others_not() -> None:
    far = replace(paper(), limits={"cutting force": "900 N", "feed range": "100 to 90000 mm/min"})
    page = read(far)
    assert len(page.of("path", class_="limit")) >= 1
    assert "limit 900 N" in page.text and "limit 90000 mm/min, far above" in page.text


def test_a_line_is_as_wide_as_the_time_that_it_took() -> None:
    lines = paper().lines
    edges, timed = edges_of(lines)
    assert timed and np.allclose(np.diff(edges), [line.before.seconds for line in lines])
    at, values = steps(edges, np.arange(10.0))
    assert len(at) == len(values) == 20 and at[0] == 0.0 and at[-1] == edges[-1]


def test_without_time_each_line_is_as_wide_as_the_others() -> None:
    lines = tuple(replace(line, before=replace(line.before, seconds=float("nan"))) for line in paper().lines)
    assert edges_of(lines)[0].tolist() == list(range(11))


def test_the_strip_of_numbers_has_every_line_once() -> None:
    for lines in (paper().lines, long(999).lines):
        found = blocks(lines, edges_of(lines)[0])
        assert [n for first, last in found for n in range(first, last + 1)] == list(range(len(lines)))
    assert len(found) == 10


def test_before_and_after_are_told_apart_without_colour() -> None:
    page = read(paper())
    assert {given["data-series"] for given in page.of("path") if "data-series" in given} == {"before", "after"}
    assert "before (dashed)" in page.text and "limit (dots)" in page.text


def test_what_binds_adds_up_to_all_of_the_time_on_the_lines() -> None:
    lines = mixed().lines
    rows = bound_by(lines)
    assert sum(row.seconds for row in rows) == pytest.approx(sum(line.after.seconds for line in lines))
    assert sum(row.lines for row in rows) == len(lines)
    assert rows[-1].reason == "left alone"
    assert [row.seconds for row in rows[:-1]] == sorted((row.seconds for row in rows[:-1]), reverse=True)


def test_every_reason_that_may_bind_is_explained() -> None:
    answer = mixed()
    lines = tuple(replace(line, binds=binds) for line, binds in zip(answer.lines, Binds, strict=False))
    page = read(replace(answer, lines=lines))
    assert len(page.of("span", class_="meaning")) == len(Binds)


def test_people_count_lines_from_one() -> None:
    assert re.search(r"What limits it 4 G1 X5\.8", read(paper()).text)


def test_a_short_program_is_shown_whole_with_source_and_what_binds() -> None:
    answer = paper()
    page = read(answer)
    for line in answer.lines:
        assert line.text_before in page.text and line.text_after in page.text
    assert page.text.count("cutting force") >= 10 and not page.of("details")


def test_of_a_long_program_what_matters_is_shown_in_order_and_the_rest_is_counted() -> None:
    answer = long()
    worst = replace(answer.lines[4321], after=replace(answer.lines[4321].after, force_n=75.0))
    lines = (*answer.lines[:4321], worst, *answer.lines[4322:])
    picked = chosen(lines, limits_of(answer))
    assert len(picked) == ROWS_MAX and worst in picked
    assert [line.line for line in picked] == sorted(line.line for line in picked)
    text = read(replace(answer, lines=lines)).text
    assert f"{5000 - ROWS_MAX:,} of 5,000 lines are left out here" in text and "JSON, under lines" in text
    assert re.search(r"[\d,]+ of [\d,]+ lines of the difference are left out here", text)


def test_a_line_above_the_limit_has_a_sign_and_words() -> None:
    assert read(mixed()).text.count("▲ cutting force above its limit") == mixed().after.over
    assert not read(paper()).of("span", class_="above")
    weak = read(replace(paper(), limits={"spindle power": "0.3 kW"}))
    assert weak.text.count("▲ spindle power above its limit") == 10 and "cutting force above" not in weak.text


def test_a_better_choice_for_a_line_alone_is_told_only_where_it_differs() -> None:
    assert "best: 500 mm/min at 4584 rev/min" in read(mixed()).text
    assert "best:" not in read(paper()).text


def test_a_line_in_air_has_no_best_speed() -> None:
    answer = paper()
    lines = tuple(replace(line, bound=(500.0, 0.0)) for line in answer.lines)
    assert "best:" not in read(replace(answer, lines=lines)).text
    lines = tuple(replace(line, bound=(900.0, 0.0)) for line in answer.lines)
    text = read(replace(answer, lines=lines)).text
    assert "best: 900 mm/min" in text and "rev/min at" not in text and "at 0" not in text


def test_a_line_at_no_limit_is_not_called_left_alone() -> None:
    answer = paper()
    text = read(replace(answer, lines=tuple(replace(line, binds="") for line in answer.lines))).text
    assert "Most of the time no limit binds" in text and "left alone" not in text.lower()


def test_what_binds_together_is_explained_together() -> None:
    answer = paper()
    lines = tuple(replace(line, binds=f"{Binds.FEED} and {Binds.DYNAMICS}") for line in answer.lines)
    assert "the feed is at the end of its range; the line is too short" in read(replace(answer, lines=lines)).text


def test_a_front_of_several_programs_is_drawn_with_the_chosen_one() -> None:
    answer = pareto()
    page = read(answer)
    assert len(page.of("path", class_="chosen")) == 2  # in the chart, and in its key
    assert len(page.of("path", class_="point")) == len(answer.front) - 1 + 1
    assert "40 programs, none of which is better than another in both" in page.text
    assert "The program as it was lies far outside of this chart: 29.48 s, 120.1 KRW." in page.text


def test_the_program_as_it_was_is_in_the_chart_where_it_is_near() -> None:
    answer = pareto()
    near = replace(answer, before=replace(answer.before, seconds=18.0, cost=64.0))
    page = read(near)
    assert len(page.of("path", class_="was")) == 2 and "far outside" not in page.text


def test_a_front_of_one_program_is_a_sentence() -> None:
    answer = pareto()
    page = read(replace(answer, front=answer.front[17:18]))
    assert "Time and cost share one optimum" in page.text
    assert not page.of("path", class_="point")


def test_of_which_total_a_bound_is_is_told_by_the_figures_of_a_front() -> None:
    assert [bounds(given) for given in (paper(), bare(), pareto())] == ["cost", "seconds", "seconds"]
    assert bounds(replace(paper(), objective=Objective.PARETO)) == "cost"
    lost = replace(pareto(), bound=replace(pareto().bound, value=3.0))
    assert bounds(lost) == "" and "above the bound" not in read(lost).text.split("Before, after")[1].split("Along")[0]


@pytest.mark.parametrize(
    ("asked", "kept", "words"),
    [
        (0.95, 0.953, "95 %, and kept"),
        (0.95, 0.945, "95 %, and kept as far as so many draws tell"),
        (0.95, 0.60, "95 %, and not kept ▲"),
        (None, 0.51, "the constants as stated: the limit is kept with no probability that was asked for"),
    ],
)
def test_whether_the_limit_is_kept_as_asked_is_said_in_words(asked: float | None, kept: float, words: str) -> None:
    text = read(replace(paper(), sensitivity=replace(SENSITIVITY, asked=asked, kept=kept))).text
    assert f"Planned for {words}" in text


def test_the_uncertainty_has_its_interval_its_price_and_its_parts() -> None:
    text = read(paper()).text
    assert "54.1 N to 59.9 N, 90 % interval" in text
    assert "+1.84 %: so much worse the cost is if the limit is kept with 95 %" in text
    assert text.index("tool.tangential_coefficient") < text.index("tool.radial_ratio") < text.index("effects.edge_force")
    assert "∓ 0.4 %" in text and "Identification of 2026-05" in text


def test_a_probability_that_no_program_keeps_has_no_price() -> None:
    text = read(replace(paper(), sensitivity=replace(SENSITIVITY, price_pct=float("inf")))).text
    assert "Price of 95 % no program is known that keeps it with 95 %" in text


def test_chips_are_told_in_micrometres_beside_their_limit() -> None:
    assert "Greatest chip thickness 25.00 54.54 µm +118 % ≤ 80 µm 32 % below" in read(paper()).text


def test_the_second_run_stands_beside_the_first_with_its_axes() -> None:
    text = read(paper()).text
    assert "Greatest following error of X 0.0412 0.0507 mm +23.1 %" in text
    assert "The force after is at the limit." in text


def test_the_difference_is_told_by_its_signs_and_nothing_of_it_is_lost() -> None:
    answer = paper()
    page = read(answer)
    assert len(page.of("span", class_="comes")) == len(page.of("span", class_="goes")) == 10
    assert "10 lines changed; what is not shown here stays as it was" in page.text
    inside = re.search(r"<pre class=\"diff\".*?>(.*?)</pre>", report_html(answer), re.S)
    assert inside and re.sub(r"<.*?>", "", inside[1]) == answer.diff


def test_lines_left_alone_are_told_with_their_reasons() -> None:
    answer = bare()
    count = sum(bool(line.left_alone) for line in answer.lines)
    threads = [line.line + 1 for line in answer.lines if line.left_alone.startswith("threading")]
    text = read(answer).text
    assert f"{count} lines of 37 that cut or feed keep the feed as programmed, and the speed where it matters." in text
    assert f"threading: its feed is its pitch {ranges(threads)} {len(threads)}" in text


def test_limits_stand_as_they_were_kept() -> None:
    text = read(paper()).text
    for name, words in paper().limits.items():
        assert f"{name} {words}" in text
