"""The tables and the picture of a blind check from its folder, and the study that leaves each effect out."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from benchmarks.gap.leave_one_out import OUTCOMES, drafts_of, outcome, rates, rows, sites_of
from benchmarks.gap.publish import beside, main, markdown, tables
from benchmarks.gap.size_curve import LINES, picture
from cnctwin.blind_check.answer import Answer, Answered, answers_json
from cnctwin.blind_check.check import CheckResult, result_of
from cnctwin.blind_check.given import Given, GivenCause, GivenTerm
from cnctwin.blind_check.kept import Kept, begun
from cnctwin.blind_check.question import Draft, Sort
from cnctwin.blind_check.rate import Rate
from cnctwin.blind_check.scoring import Judged, scored
from cnctwin.files.sealed import seal
from cnctwin.standins.reference_machine.named_effects import NAMED
from twin.gap.diagnosis import Verdict

GAVE = {"seconds": 3.0, "failed": "", "closure_unseen": 0.9, "program": "abcd1234"}
HEALTHY = GAVE | {"diagnosis": {"verdict": "healthy"}}


def answer(name: str, sort: Sort = Sort.SINGLE, effect: str = "gravity", on: str = "z", size: float = 5.0) -> Answer:
    return Answer(name, sort, (Answered(effect, on, True, {"force_n": 300.0}, (), {"z_torque_a": size}),), {"z_torque_a": size})


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    """Three cases that two methods have done, and one that is left to do."""
    names = [f"case_{n:03d}" for n in range(1, 5)]
    check = begun(tmp_path / "check", 7, [Draft(name, Sort.SINGLE, n, "gravity") for n, name in enumerate(names)])
    for name in names:
        text = answers_json([answer(name)])
        check.keep_drawn(name, {"redraws": 0, "said": [], "digest": seal(text, check.salt).seal.digest})
        if name != "case_004":
            named = {"effect": "gravity", "on": "z", "parameters": {}, "indistinguishable_from": []}
            right = GAVE | {"diagnosis": {"verdict": "explained", "causes": [named]}}
            check.keep_given(name, json.loads(text), {"diagnosis": right, "bic": HEALTHY})
    return check


def test_tables_are_of_what_is_done(kept: Kept) -> None:
    text = tables(result_of(kept, "diagnosis"))
    assert "3 of 4 cases, seed 7" in text and kept.seal in text and kept.salt in text
    assert "| single effect: named right | 100 % (29–100; 3/3) | ≥ 95 % |" in text
    assert "| 3 to 10 | 100 % (29–100; 3/3) |" in text


def test_methods_are_compared_on_the_cases_that_all_have_done(kept: Kept) -> None:
    text = beside(kept)
    assert text.startswith("On 3 cases")
    assert "| single effect: named right | 100 % (29–100; 3/3) | 0 % (0–71; 0/3) |" in text


def test_the_command_prints_the_tables_and_draws_the_curve(
    kept: Kept, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(kept.folder), "--picture", str(tmp_path / "curve.svg")]) == 0
    assert "answers" not in capsys.readouterr().err
    assert (tmp_path / "curve.svg").read_text().startswith("<svg")


def test_a_table_has_a_cell_for_each_column() -> None:
    assert markdown(("", "a"), [("b", "")]) == "| | a |\n|---|---|\n| b | |"


def test_the_picture_is_well_formed_and_shows_each_score_that_there_is() -> None:
    cases = [Judged(answer("case", size=size), Given(Verdict.HEALTHY, (), (), 1.0)) for size in (0.8, 2.5, 20.0)]
    root = ET.fromstring(picture(scored(cases), "a title"))
    circles = [one for one in root.iter() if one.tag.endswith("circle")]
    assert len(circles) == 6, "right and wrong, in three bins; no pairs, nothing outside"
    assert len([one for one in root.iter() if one.tag.endswith("polyline")]) == len(LINES)
    assert all(15.0 < float(one.attrib["cy"]) < 335.0 for one in circles)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"learned": (GivenTerm("axis_force", "z", frozenset(), 0.9),)}, "learned"),
        ({"learned": (GivenTerm("axis_force", "x", frozenset(), 0.9),)}, "elsewhere"),
        ({"learned": (GivenTerm("controller", "z", frozenset(), 0.9),)}, "elsewhere"),
        ({"causes": (GivenCause(("payload", "z"), frozenset(), {}),)}, "named"),
        ({"verdict": Verdict.HEALTHY, "closure_unseen": 0.97}, "constants"),
        ({"verdict": Verdict.HEALTHY}, "missed"),
        ({"failed": "TwinError: no"}, "failed"),
        ({}, "unknown"),
    ],
)
def test_a_case_without_its_effect_ends_in_one_way(given: dict[str, object], said: str) -> None:
    plain = Given(Verdict.UNKNOWN, (), (), 1.0)
    assert outcome(Judged(answer("gravity-1"), replace(plain, **given))) == said


def result(cases: Sequence[Judged]) -> CheckResult:
    return CheckResult(1, "", "", len(cases), (), (), frozenset(), tuple(cases), scored(cases), 0.0)


def test_each_effect_has_a_row_with_the_names_that_were_given() -> None:
    named = Given(Verdict.EXPLAINED, (GivenCause(("payload", "z"), frozenset(), {}),), (), 1.0)
    found = result([Judged(answer("gravity-1"), named), Judged(answer("gravity-2", size=1.0), named)])
    assert rows(found)[0] == ("gravity", *("1" if end == "named" else "0" for end in OUTCOMES), "payload on z")
    assert rates(found) == (Rate(0, 1), Rate(1, 1))


def test_every_effect_of_the_reference_machine_has_a_site_wherever_it_is() -> None:
    assert all(sites_of(effect.name, on) for effect in NAMED for on in effect.places)


def test_an_effect_has_the_same_cases_whichever_else_is_asked() -> None:
    alone, among = drafts_of(["runout"], 2, 3), drafts_of(["backlash", "runout"], 2, 3)
    assert among[2:] == alone and [draft.name for draft in alone] == ["runout-1", "runout-2"]
