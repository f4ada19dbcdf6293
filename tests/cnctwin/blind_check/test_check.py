"""The blind check from draw to table, with diagnoses that know nothing, or everything."""

import json
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cnctwin.blind_check import piece
from cnctwin.blind_check.answer import Answer, answers_from_json, answers_json
from cnctwin.blind_check.case_folder import (
    FIT,
    UNSEEN,
    answer_of,
    machine_of,
    physics_with,
    recorded,
    write_case,
    write_folder,
)
from cnctwin.blind_check.check import CheckResult, run_checks
from cnctwin.blind_check.given import given_of
from cnctwin.blind_check.kept import read_kept
from cnctwin.blind_check.piece import Diagnose, diagnosed
from cnctwin.blind_check.question import (
    SHARES,
    SIZES,
    Draft,
    DrawnEffect,
    Question,
    Sort,
    Structure,
    draw,
    effect_on,
    names,
    question_of,
)
from cnctwin.blind_check.scoring import Judged, scored
from cnctwin.blind_check.table import table
from cnctwin.blind_check.write import main
from cnctwin.errors import UsageError
from cnctwin.files.sealed import SealError, opened, seal
from cnctwin.jobs.spread import spread_over
from cnctwin.standins.reference_machine.controllers import STRUCTURES
from cnctwin.standins.reference_machine.named_effects import NAMED
from cnctwin.standins.reference_machine.unnamed_effects import UNNAMED
from twin.case import Case, read_case
from twin.effects.catalogue import effect_named
from twin.errors import TwinError
from twin.gap.diagnosis import Diagnosed, Diagnosis, GapNumbers, Verdict
from twin.machine import MachineFile

WARM = Question("case_001", Sort.SINGLE, 5, ("warmup",), (DrawnEffect("coolant_cooling", "", 8.0),))


def nothing_found(case: Case) -> Diagnosed:
    numbers = GapNumbers(1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, {})
    found = Diagnosis(Verdict.HEALTHY, "", (), (), (), (), numbers, (), (), (), None, (), 0.0)
    return Diagnosed(found, case.machine)


def never_comes(case: Case) -> Diagnosed:
    raise TwinError(f"{case.name} cannot be diagnosed")


class BreakError(Exception):
    """An error of no family."""


def breaks(case: Case) -> Diagnosed:
    raise BreakError(f"{case.name} is too much")


NOTHING = {"nothing": f"{__name__}:nothing_found"}
DRAFTS = (Draft("case_001", Sort.SINGLE, 1002, "coolant_cooling"), Draft("case_002", Sort.HEALTHY, 1005, None))
"""Two warm-ups, which are quick."""


def check(folder: Path, drafts: Sequence[Draft] = DRAFTS, **how: Any) -> CheckResult:
    return run_checks(drafts, NOTHING, folder, seed=1, **how)["nothing"]


def test_a_draw_has_the_shares_of_the_protocol_and_every_effect() -> None:
    questions = draw(600, seed=1)
    for sort, share in SHARES.items():
        assert sum(q.sort is sort for q in questions) == pytest.approx(600 * share, abs=1)
    asked = [a for q in questions for a in q.asked]
    assert {a.effect for a in asked} == {*names(named=True), *names(named=False)}
    assert all(SIZES[0] <= a.target <= SIZES[1] for a in asked)
    assert all(a.named is (q.sort is not Sort.OUTSIDE) for q in questions for a in q.asked)
    assert draw(600, seed=1) == questions != draw(600, seed=2)


def test_effects_bear_the_names_and_parameters_of_the_catalogue_or_none_of_them() -> None:
    chance = np.random.default_rng(1)
    for effect in (*NAMED, *STRUCTURES):
        known = {p.name for p in effect_named(effect.name).parameters}
        assert set(effect.parameters(1.0, effect.traits(chance))) <= known
        assert set(effect.exact) <= known
    assert not {effect.name for effect in UNNAMED} & {effect.name for effect in NAMED}
    for name in names(named=False):
        with pytest.raises(TwinError):
            effect_named(name)


def test_a_case_has_the_size_that_was_asked_for_and_reads_as_a_case(tmp_path: Path) -> None:
    answer = write_case(tmp_path / "case", WARM)
    assert answer.effects[0].size == pytest.approx(8.0, rel=0.6), "the check run may show more or less of it than the fit run"
    case = read_case(tmp_path / "case")
    assert [run.entry.role for run in case.runs] == ["fit", "fit", "check"]
    assert all(run.log.has("spindle_temp_c") for run in case.runs)
    assert case.machine.uncertainty == {"relative": 0.03}
    text = (tmp_path / "case" / "case.toml").read_text() + (tmp_path / "case" / "machine.toml").read_text()
    assert "coolant_cooling" not in text


def test_what_a_machine_states_is_not_what_it_is() -> None:
    machine = machine_of(Question("case", Sort.HEALTHY, 3, ("air",), ()))
    ratios = [machine.healthy.axes[a].mass_kg / machine.stated.axes[a].mass_kg for a in "xyz"]
    assert all(ratio != 1.0 and abs(ratio - 1.0) <= 0.06 for ratio in ratios)
    assert all(machine.healthy.axes[a].position_gain == machine.stated.axes[a].position_gain_per_s for a in "xyz")


def test_the_same_question_has_the_same_answer_and_the_same_recording() -> None:
    assert answer_of(WARM) == answer_of(WARM)
    one, other = (machine_of(WARM) for _ in range(2))
    first, second = (recorded(m, m.healthy, "warmup", FIT)["spindle_temp_c"] for m in (one, other))
    assert (first == second).all()


def write_unseen(folder: Path, question: Question) -> None:
    """Write a case of the same machine whose only runs are of programs that the case of `write_case` does not have."""
    machine = machine_of(question)
    physics = physics_with(machine, answer_of(question))
    write_folder(folder, machine, physics, [(kind, UNSEEN) for kind in question.kinds])


def test_runs_of_a_program_are_repeated_and_others_differ(tmp_path: Path) -> None:
    question = Question("case", Sort.HEALTHY, 4, ("cut",), ())
    write_case(tmp_path / "case", question)
    write_unseen(tmp_path / "unseen", question)
    case, unseen = read_case(tmp_path / "case"), read_case(tmp_path / "unseen")
    (one, other), *_ = case.repeats()
    assert (one.log["x_ref_mm"] == other.log["x_ref_mm"]).all()
    assert (one.log["x_pos_mm"] != other.log["x_pos_mm"]).any()
    programs = [(tmp_path / "case" / "runs" / f"cut_{name}.nc").read_text() for name in ("fit", "fit_2", "check")]
    programs.append((tmp_path / "unseen" / "runs" / "cut_check.nc").read_text())
    assert programs[0] == programs[1] and len(set(programs)) == 3
    assert unseen.machine == case.machine


def test_answers_go_through_json_and_are_sealed() -> None:
    answer = answer_of(WARM)
    text = answers_json([answer])
    assert answers_json(answers_from_json(text)) == text
    sealed = seal(text)
    assert opened(sealed.seal, sealed.salt, text) == text
    with pytest.raises(SealError, match="not those that were sealed"):
        opened(sealed.seal, sealed.salt, text.replace("coolant_cooling", "sensor_bias"))
    assert seal(text).seal != sealed.seal


def test_the_quick_questions_are_quick() -> None:
    assert [question_of(draft).kinds for draft in DRAFTS] == [("warmup",), ("warmup",)]


def test_a_diagnosis_that_finds_nothing_is_right_on_a_healthy_machine_only(tmp_path: Path) -> None:
    said: list[str] = []
    result = check(tmp_path, progress=said.append)
    assert result.scored.healthy.share == 1.0
    assert result.scored.judged.single_right.share == 0.0
    assert result.scored.judged.closure < 0.2
    sealed_at = next(i for i, line in enumerate(said) if result.seal in line)
    assert all("diagnosing" not in line for line in said[:sealed_at])
    assert "called healthy" in table(result) and result.seal in table(result)


def test_a_check_goes_on_where_it_stopped(tmp_path: Path) -> None:
    once = check(tmp_path / "once")
    done: list[str] = []

    def counted(function: Callable[[str], str], texts: Sequence[str]) -> Iterator[str]:
        for text in texts:
            done.append(function.__name__)
            yield function(text)

    asked = chain([False] * 4, repeat(True))
    first = check(tmp_path / "twice", spread=counted, stopped=lambda: next(asked))
    assert (len(first.cases), first.asked, done) == (1, 2, ["drawn", "drawn", "judged"])
    assert f"1 of 2 cases, seed 1, answers sealed as {first.seal}" in table(first)
    again = check(tmp_path / "twice", spread=counted)
    assert done == ["drawn", "drawn", "judged", "judged"]
    assert (again.seal, again.salt) == (first.seal, first.salt)
    assert [case.answer for case in again.cases] == [case.answer for case in once.cases]
    check(tmp_path / "twice", spread=counted)
    assert len(done) == 4


def test_a_check_in_other_processes_is_the_same(tmp_path: Path) -> None:
    here = check(tmp_path / "here")
    with spread_over(2) as spread:
        there = check(tmp_path / "there", spread=spread)
    assert [case.answer for case in there.cases] == [case.answer for case in here.cases]
    assert [case.given.closure_unseen for case in there.cases] == [case.given.closure_unseen for case in here.cases]


def test_no_answer_is_in_a_file_before_its_case_is_diagnosed(tmp_path: Path) -> None:
    asked = chain([False, False], repeat(True))
    check(tmp_path, DRAFTS, stopped=lambda: next(asked))
    kept = [path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()]
    assert kept == [Path("check.json")]
    assert "size_over_floor" not in (tmp_path / "check.json").read_text()


def test_another_check_does_not_go_on_in_the_same_folder(tmp_path: Path) -> None:
    check(tmp_path, DRAFTS[1:])
    with pytest.raises(UsageError, match="holds another check, of 1 cases with seed 1"):
        check(tmp_path)


def test_an_answer_that_was_changed_does_not_open(tmp_path: Path) -> None:
    check(tmp_path, DRAFTS[:1])
    path = tmp_path / "nothing" / "case_001.json"
    path.write_text(path.read_text().replace("coolant_cooling", "sensor_bias"))
    with pytest.raises(SealError):
        read_kept(tmp_path).judged("nothing")


def test_a_question_that_cannot_be_drawn_is_drawn_again_and_ends_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(question: Question) -> Answer:
        if question.name == "case_001" and question.seed < DRAFTS[0].seed + failing:
            raise ZeroDivisionError("division by zero")
        return answer_of(question)

    monkeypatch.setattr(piece, "answer_of", fails)
    failing = 1
    result = check(tmp_path / "once")
    assert result.redrawn == ("case_001: ZeroDivisionError: division by zero",)
    assert len(result.cases) == 2 and "questions drawn again: 1" in table(result)
    failing = 100
    result = check(tmp_path / "never")
    assert result.undrawn == ("case_001",) and len(result.cases) == 1
    assert "could not be drawn: case_001" in table(result)


def test_an_axis_that_warms_and_does_not_move_is_drawn() -> None:
    """A triple in air and in the cut, in which z rests: seed 424242 ended on it."""
    question = Question("case", Sort.SINGLE, 5, ("cut",), (DrawnEffect("viscous_warmup", "z", 4.0),))
    machine = machine_of(question)
    warming = machine.healthy.with_axis("z", warmup=0.3, warmup_s=8.0)
    assert np.isfinite(recorded(machine, warming, "cut", FIT, "z")["z_pos_mm"]).all()


@pytest.mark.parametrize(("diagnose", "said"), [(never_comes, "TwinError"), (breaks, "BreakError")])
def test_a_diagnosis_that_raises_is_counted(diagnose: Diagnose, said: str, tmp_path: Path) -> None:
    write_case(tmp_path / "case", WARM)
    given, twin = diagnosed(tmp_path / "case", diagnose)
    assert given["failed"].startswith(said) and not given["diagnosis"] and not twin
    judged = Judged(answer_of(WARM), given_of(given | {"closure_unseen": None}))
    assert scored([judged]).failed.share == 1.0 and not (judged.right or judged.wrong or judged.unknown)


def test_a_third_of_the_machines_has_another_controller_beside_what_is_asked() -> None:
    questions = draw(600, seed=1)
    other = [q for q in questions if q.controller is not None]
    assert len(other) == 200
    assert {q.controller.effect for q in other if q.controller} == {structure.name for structure in STRUCTURES}
    for question in other:
        assert question.asked and {"air", "cut"} & set(question.kinds)
        assert not any(effect_on(asked).in_controller for asked in question.asked)
    assert not any(q.controller for q in draw(40, 1, Sort.SINGLE))


def test_another_controller_is_a_gap_that_the_answer_holds_and_no_file_tells(tmp_path: Path) -> None:
    question = Question(
        "case", Sort.SINGLE, 5, ("cut",), (DrawnEffect("backlash", "x", 8.0),), controller=Structure("velocity_feedforward", "x")
    )
    answer = write_case(tmp_path / "case", question)
    assert [effect.effect for effect in answer.effects] == ["backlash"]
    assert answer.effects[0].size == pytest.approx(8.0, rel=0.6), "sized beside the machine with that controller"
    assert answer.controller is not None and answer.controller.size_over_floor["x_pos_mm"] > 100.0
    text = answers_json([answer])
    assert "velocity_feedforward" in text and answers_json(answers_from_json(text)) == text
    assert "feedforward" not in (tmp_path / "case" / "machine.toml").read_text()


def test_cases_are_written_with_their_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "cases"
    assert main([str(out), "--cases", "1", "--seed", "3", "--effect", "second_thermal_mass"]) == 0
    answers = json.loads((out / "answers.json").read_text())
    assert answers["case_001"]["effects"][0]["effect"] == "second_thermal_mass"
    assert main([str(out)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert isinstance(read_case(out / "case_001").machine, MachineFile)
