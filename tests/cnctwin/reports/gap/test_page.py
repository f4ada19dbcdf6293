"""The page as a whole: in order, by itself, readable by every parser, and deaf to what its data would like it to do."""

import base64
import hashlib
import json
import math
import re
import zipfile
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hatchling.builders.wheel import WheelBuilder

from cnctwin.reports.gap.page import report_html
from tests.cnctwin.reports.gap.diagnosed import DIAGNOSED, explained, healthy, partly, unknown
from tests.cnctwin.reports.gap.page_reader import PageReader
from tests.cnctwin.reports.hostile import HOSTILE, hostile
from twin.gap.diagnosis import (
    Candidate,
    Diagnosed,
    Interval,
    Learned,
    LooksLike,
    MovedConstant,
    Pattern,
    Subsystem,
    Trace,
    Verdict,
)

ROOT = Path(__file__).parents[4]
ORDER = ["where", "traces", "far", "causes", "candidates", "patterns", "untold", "next", "notes", "judged"]


@pytest.mark.parametrize("name", DIAGNOSED)
def test_every_verdict_makes_a_page_that_a_strict_reader_reads(name: str) -> None:
    given = DIAGNOSED[name]()
    page = PageReader(report_html(given, "press shop, machine 3"))
    assert given.diagnosis.sentence in page.text
    assert "press shop, machine 3" in page.text
    headings = [given["id"] for given in page.of("h2")]
    assert headings == [wanted for wanted in ORDER if wanted != "notes" or given.diagnosis.notes]
    assert not re.search(r"\b(nan|inf|None(?! was))\b", page.text)


@pytest.mark.parametrize("name", DIAGNOSED)
def test_a_page_needs_nothing_from_elsewhere_and_stays_small(name: str) -> None:
    text = report_html(DIAGNOSED[name](), "machine")
    page = PageReader(text)
    assert not [given for _, given in page.elements if {"src", "href", "style"} & set(given)]
    assert not [key for _, given in page.elements for key in given if key.startswith("on")]
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert len(text.encode()) < 1_500_000


def test_parts_constants_and_learned_terms_have_sections_of_their_own_where_there_are_any() -> None:
    given = unknown()
    knots = (0.0, 100.0, 200.0)
    force = Learned(
        "axis_force", "x", "N", ("position", "direction"), True, 0.81, 0.74, 0.86,
        {
            "position_mm": knots * 2, "direction": (-1.0,) * 3 + (1.0,) * 3,
            "value": (0.0, 43.0, 1.0) * 2, "low": (-1.0,) * 6, "high": (44.0,) * 6,
        },
        (LooksLike("direction_friction", "x", "it closes 31 %"),), "a force on X of +43 N about 100 mm, in both directions",
    )  # fmt: skip
    pushes = replace(
        force, depends_on=("time",), repeats=False, sentence="two pushes of 30 N",
        table={"t_s": (0.0, 1.0, 0.0, 1.0), "run": ("a", "a", "b", "b"), "value": (0.0, 30.0, 0.0, 30.0)},
    )  # fmt: skip
    diagnosis = replace(
        given.diagnosis,
        subsystems=(
            Subsystem("cut", ("spindle_rpm",), "force_x_n", 1.0, 1.0, Verdict.HEALTHY),
            Subsystem("x mechanics", ("x_torque_a",), "x_torque_a", 8.1, 1.1, Verdict.EXPLAINED, ("gravity",)),
            Subsystem("x controller", ("x_ref_mm", "x_pos_mm"), "x_torque_a", 90.0, 90.0, Verdict.UNKNOWN),
        ),
        constants=(MovedConstant("axes.x.mass_kg", 320.0, 339.0, 2.4, 0.4),),
        learned=(force, pushes),
    )
    page = PageReader(report_html(replace(given, diagnosis=diagnosis), "machine"))
    headings = [heading["id"] for heading in page.of("h2")]
    assert headings[0] == "subsystems" and {"learned", "constants"} < set(headings)
    assert page.text.index("X controller") < page.text.index("X mechanics") < page.text.index("Cut")
    for said in ("cause unknown", "Two pushes of 30 N.", "direction friction on X, but it closes 31 %", "moving in −", "2.4 σ"):
        assert said in page.text


def test_the_policy_names_the_style_and_the_script_that_are_there() -> None:
    text = report_html(explained(), "machine")
    policy = PageReader(text).of("meta", http_equiv="Content-Security-Policy")[0]["content"] or ""
    style, script = re.search("<style>(.*?)</style>", text, re.S), re.search("<script>(.*?)</script>", text, re.S)
    assert style and script
    for directive, inside in (("style-src", style[1]), ("script-src", script[1])):
        digest = base64.b64encode(hashlib.sha256(inside.encode()).digest()).decode()
        assert f"{directive} 'sha256-{digest}'" in policy
    assert "unsafe" not in policy and "default-src 'none'" in policy


def test_no_text_of_the_data_is_ever_markup_or_script() -> None:
    given = explained()
    machine = given.twin.model_copy(update={"machine": given.twin.machine.model_copy(update={"name": HOSTILE})})
    text = report_html(replace(hostile(replace(given, twin=machine)), twin=machine), HOSTILE)
    text.encode()
    page = PageReader(text)
    assert not page.of("img")
    assert len(page.of("script")) == 2
    assert not any("alert" in script for script in page.scripts if not script.lstrip().startswith("["))
    assert "<script>alert(1)</script>" in page.text
    assert "\x00" not in text


def without_numbers(value: Any) -> Any:
    """The same with NaN for every number."""
    if isinstance(value, Trace):
        return value
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: without_numbers(getattr(value, f.name)) for f in fields(value)})
    if type(value) is float:
        return math.nan
    if isinstance(value, tuple):
        return tuple(without_numbers(part) for part in value)
    return {key: without_numbers(part) for key, part in value.items()} if isinstance(value, dict) else value


@pytest.mark.parametrize("name", DIAGNOSED)
def test_a_figure_that_there_is_none_of_is_a_dash(name: str) -> None:
    given = DIAGNOSED[name]()
    page = PageReader(report_html(replace(given, diagnosis=without_numbers(given.diagnosis)), "machine"))
    assert not re.search(r"\bnan\b", page.text)
    assert "–" in page.text


def test_none_in_place_of_a_number_is_a_dash_too() -> None:
    given = partly()
    gap = replace(given.diagnosis.gap, closure=None, closure_low=None, closure_high=None, as_stated=None)  # type: ignore[arg-type]
    causes = tuple(
        replace(cause, probability=None, closure=None, parameters={"asymmetry": Interval(0.1, None, None)})  # type: ignore[arg-type]
        for cause in given.diagnosis.causes
    )
    candidates = (Candidate("gravity", "z", None, None),)  # type: ignore[arg-type]
    diagnosis = replace(given.diagnosis, gap=gap, causes=causes, candidates=candidates)
    assert "None" not in PageReader(report_html(replace(given, diagnosis=diagnosis), "machine")).text


def test_long_lists_are_there_whole_but_folded() -> None:
    given = explained()
    tried = tuple(Candidate("gravity", f"sensor {n}", 0.01, 0.5) for n in range(200))
    seen = tuple(Pattern("z_pos_mm", f"pattern {n}", 0.1, 2.0, 0.5, n < 20, f"It goes with {n}.") for n in range(60))
    page = PageReader(report_html(replace(given, diagnosis=replace(given.diagnosis, candidates=tried, patterns=seen)), "m"))
    assert all(f"Gravity on sensor {n} " in page.text for n in range(200))
    assert all(f"It goes with {n}." in page.text for n in range(60))
    assert len(page.of("details")) == 2
    assert "54 more patterns, 40 of them within chance" in page.text


def test_the_order_of_the_page_does_not_hang_on_the_order_of_dictionaries() -> None:
    given = explained()
    turned = replace(given.diagnosis.gap, by_signal=dict(reversed(given.diagnosis.gap.by_signal.items())))
    assert report_html(given, "m") == report_html(replace(given, diagnosis=replace(given.diagnosis, gap=turned)), "m")


def test_causes_say_what_they_are_in_words_with_parameters_and_what_they_may_be_instead() -> None:
    page = PageReader(report_html(explained(), "machine"))
    for words in ("Gravity on Z", "an uncompensated head", "F_external = −force_n", "388 N", "380 … 396", "98 %"):
        assert words in page.text
    assert "Not told apart from direction friction on Z" in page.text
    assert PROGRAM_LINE in page.text


PROGRAM_LINE = "G1 Z-60. F1000 G4 P10000"


def test_an_effect_that_the_catalogue_has_not_got_is_shown_by_its_name() -> None:
    given = partly()
    cause = replace(given.diagnosis.causes[0], effect="phlogiston")
    page = PageReader(report_html(replace(given, diagnosis=replace(given.diagnosis, causes=(cause,))), "machine"))
    assert "Phlogiston on Z" in page.text


def test_a_diagnosis_without_recordings_is_a_page_too() -> None:
    given = replace(unknown(), traces=())
    page = PageReader(report_html(given, "machine"))
    assert "No recording came with this diagnosis" in page.text
    assert len(page.of("script")) == 1


def test_effects_that_are_not_seen_for_the_same_reason_are_one_point() -> None:
    text = PageReader(report_html(explained(), "machine")).text
    assert text.count("no force_x_n in any run") == 1
    assert "Runout, helix" in text


def test_healthy_asks_for_nothing() -> None:
    page = PageReader(report_html(healthy(), "machine"))
    for words in ("Healthy", "nothing to close", "No cause is named", "There is no need of one"):
        assert words in page.text


def test_runs_that_were_not_fitted_are_named() -> None:
    page = PageReader(report_html(explained(), "machine"))
    assert "Not fitted runs/check.parquet" in page.text


def test_style_and_script_are_in_the_package_that_is_installed(tmp_path: Path) -> None:
    wheel = next(iter(WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])))
    with zipfile.ZipFile(wheel) as built:
        assert {"cnctwin/reports/gap/report.css", "cnctwin/reports/gap/report.js"} <= set(built.namelist())


def test_the_same_diagnosis_is_the_same_page() -> None:
    def page(given: Diagnosed) -> str:
        return report_html(given, "machine")

    assert page(explained()) == page(explained())
    samples = json.loads(next(s for s in PageReader(page(explained())).scripts if s.startswith("[")))
    assert samples[0]["n"] == 6000


def test_what_is_left_open_without_a_program_is_not_called_settled() -> None:
    given = explained()
    page = PageReader(report_html(replace(given, diagnosis=replace(given.diagnosis, next_experiment=None)), "machine"))
    assert "No program is known that would tell more." in page.text
