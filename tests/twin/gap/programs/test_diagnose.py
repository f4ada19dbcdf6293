"""The time gap of programs: what was withheld is named, what was recorded is explained, and what isn't comparable is said."""

from pathlib import Path

import numpy as np
import pytest

from tests.twin.gap.programs.written import case_of, made_case, plate_program, plate_runs, plate_slice, whole_program
from twin.errors import CaseError
from twin.gap.diagnosis import Diagnosed, Verdict
from twin.gap.programs.diagnose import diagnose_programs
from twin.gap.programs.knobs import with_rapids_read
from twin.gap.programs.trial import Trial, trial_of
from twin.motion.control import control_of
from twin.motion.path import path_from_moves
from twin.programs import Settings, interpret
from twin.runlog import run_log
from twin.simulator.simulation import IDEAL_TIMES

FEEDS = {"fit": (1200.0, 3000.0), "check": (2000.0,)}
RAPID = "[program]\nrapid_mm_min = 30000.0\nacceleration_mm_s2 = 1e9\n"


@pytest.fixture(scope="module")
def plates(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    folder = tmp_path_factory.mktemp("plates")
    runs = {f"plate_{name}": (role, plate_slice(name), plate_program(name)) for name, role in (("13", "fit"), ("15", "fit"))}
    runs |= {f"plate_{name}": ("check", plate_slice(name), plate_program(name)) for name in ("02", "03")}
    runs["back_face"] = ("check", run_log(plate_runs("13")[1], "back"), plate_program("13"))
    runs["aborted"] = ("check", run_log(plate_runs("19")[0], "aborted"), whole_program("19"))
    return diagnose_programs(case_of(folder, runs))


def test_recorded_parts_take_longer_in_corners_and_tool_changes_and_in_the_engraving_most(plates: Diagnosed) -> None:
    d = plates.diagnosis
    assert {cause.effect for cause in d.causes} == {"corner_slowdown", "tool_change_time"}
    assert d.verdict in (Verdict.PARTLY, Verdict.EXPLAINED)
    sections = [cell for cell in d.where if cell.signal == "section_time_s"]
    assert sections[0].regime == "section T23" and sections[0].discovered
    assert sum(cell.share for cell in sections) == pytest.approx(1.0)
    assert {"short blocks", "tool change and spindle"} <= {cell.regime for cell in d.where}


def test_the_program_is_a_subsystem(plates: Diagnosed) -> None:
    (program,) = plates.diagnosis.subsystems
    assert program.subsystem == "program" and program.before == plates.diagnosis.gap.before
    assert set(program.causes) == {"corner_slowdown", "tool_change_time"}


def test_the_gap_shrinks_on_parts_that_were_not_fitted(plates: Diagnosed) -> None:
    gap = plates.diagnosis.gap
    assert gap.closure > 0.95
    assert gap.closure_low <= gap.closure <= gap.closure_high
    assert gap.by_signal["program_time_s"].after < 0.15 * gap.by_signal["program_time_s"].before
    assert sum(cause.closure for cause in plates.diagnosis.causes) == pytest.approx(gap.closure)
    assert {trace.run for trace in plates.traces if not trace.fitted} == {"plate_02.parquet", "plate_03.parquet"}


def test_a_run_of_another_program_and_one_that_was_broken_off_are_said_to_be_so(plates: Diagnosed) -> None:
    notes = plates.diagnosis.notes
    assert any(n.startswith("back_face.parquet ran another program than the one given: it ended at line 60") for n in notes)
    assert any(n.startswith("aborted.parquet was interrupted and not finished: it came to line 12") for n in notes)


def test_the_twin_handed_over_takes_as_long_as_the_diagnosis_says(plates: Diagnosed, tmp_path: Path) -> None:
    (said,) = [note for note in plates.diagnosis.notes if "reference position" in note]
    place = (0.0, 0.0, float(said.split("taken to be ")[1].split(" mm")[0]))
    settings = Settings(start_mm=place, references_mm=(place,), optional_stop=True)
    path = path_from_moves(interpret(plate_program("03"), settings), place)
    (trace,) = [trace for trace in plates.traces if trace.run == "plate_03.parquet"]
    assert plates.twin.program is not None
    (run,) = case_of(tmp_path, {"plate_03": ("check", plate_slice("03"), plate_program("03"))}).runs
    trial = trial_of(run, Settings())
    assert isinstance(trial, Trial)
    ((knobs,), _) = with_rapids_read([trial], float(plates.twin.program.rapid_mm_min))
    planned = control_of(plates.twin, IDEAL_TIMES).plan(path, *knobs.recorded.overrides())
    assert planned.total_s == pytest.approx(trace.after[-1], rel=1e-3)
    assert trace.after[-1] == pytest.approx(trace.measured[-1], rel=0.05)


@pytest.mark.parametrize(
    ("withheld", "machine"),
    [
        ({}, ""),
        ({"block_overhead": {"block_s": 0.08}}, ""),
        ({"feed_override": {"ratio": 0.9, "rapid": 0.5}}, RAPID),
        ({"corner_slowdown": {"acceleration_mm_s2": 100.0, "corner_mm_min": 150.0}, "tool_change_time": {"change_s": 3.0}}, ""),
    ],
    ids=lambda value: " and ".join(value) or "nothing" if isinstance(value, dict) else "",
)
def test_what_was_withheld_is_named_and_found_again(tmp_path: Path, withheld: dict[str, dict[str, float]], machine: str) -> None:
    found = diagnose_programs(made_case(tmp_path, withheld, FEEDS, machine))
    d = found.diagnosis
    assert {cause.effect for cause in d.causes} == set(withheld)
    assert d.verdict is (Verdict.EXPLAINED if withheld else Verdict.HEALTHY)
    assert d.gap.closure > 0.99 or not withheld
    for cause in d.causes:
        for name, value in withheld[cause.effect].items():
            assert cause.parameters[name].value == pytest.approx(value, rel=0.1)
    assert {effect.effect for effect in found.twin.effects} == set(withheld)
    told = {path for path in found.twin.uncertainty if path.startswith("effects.")}
    assert told == {f"effects.{effect.effect}.{name}" for effect in found.twin.effects for name in effect.parameters}


def test_an_effect_that_is_left_out_of_the_catalogue_is_not_named_and_leaves_a_remainder(tmp_path: Path) -> None:
    case = made_case(tmp_path, {"tool_change_time": {"change_s": 5.0}}, FEEDS)
    d = diagnose_programs(case, without=frozenset({"tool_change_time"})).diagnosis
    assert "tool_change_time" not in {c.effect for c in d.candidates}
    assert d.verdict is Verdict.UNKNOWN and not np.isnan(d.gap.after)
    assert d.where[0].regime == "tool change and spindle" or d.where[0].regime.startswith("section")


def test_a_case_with_nothing_to_compare_is_one_clear_line(tmp_path: Path) -> None:
    case = made_case(tmp_path, {}, {"fit": (1000.0,)})
    (tmp_path / "fit_1000.nc").write_text("G1 X10\n")
    with pytest.raises(CaseError, match=r"no run can be compared with its program: fit_1000\.parquet"):
        diagnose_programs(case)
