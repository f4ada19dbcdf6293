"""The blind check from draw to table, with diagnoses that know nothing, or everything."""

import json
from pathlib import Path

import numpy as np
import pytest

from cnctwin.blind_check import check as check_module
from cnctwin.blind_check.answer import answers_from_json, answers_json
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
from cnctwin.blind_check.check import diagnosed, run_check
from cnctwin.blind_check.question import SHARES, SIZES, DrawnEffect, Question, Sort, draw, names
from cnctwin.blind_check.sealed import SealError, opened, seal
from cnctwin.blind_check.table import table
from cnctwin.blind_check.write import main
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


def only_warm(count: int, seed: int) -> tuple[Question, ...]:
    return (WARM, Question("case_002", Sort.HEALTHY, 6, ("warmup",), ()))[:count]


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
    for effect in NAMED:
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
    """Write a case of the same machine whose only runs are of programs that the case of `write_case` has not got."""
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


def test_a_diagnosis_that_finds_nothing_is_right_on_a_healthy_machine_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_module, "draw", only_warm)
    said: list[str] = []
    result = run_check(2, 1, nothing_found, workers=0, progress=said.append)
    assert result.scored.healthy.share == 1.0
    assert result.scored.judged.single_right.share == 0.0
    assert result.scored.judged.closure < 0.2
    sealed_at = next(i for i, line in enumerate(said) if result.seal in line)
    assert all("diagnosing" not in line for line in said[:sealed_at])
    assert "called healthy" in table(result) and result.seal in table(result)


def test_a_diagnosis_that_raises_is_counted(tmp_path: Path) -> None:
    write_case(tmp_path / "case", WARM)
    given, twin = diagnosed(tmp_path / "case", never_comes)
    assert "cannot be diagnosed" in given.failed and not given.causes and not twin


def test_cases_are_written_with_their_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "cases"
    assert main([str(out), "--cases", "1", "--seed", "3", "--effect", "second_thermal_mass"]) == 0
    answers = json.loads((out / "answers.json").read_text())
    assert answers["case_001"]["effects"][0]["effect"] == "second_thermal_mass"
    assert main([str(out)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert isinstance(read_case(out / "case_001").machine, MachineFile)
