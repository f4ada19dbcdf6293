"""The time model: found again where it is known, and on recorded plates."""

import numpy as np
import pytest

from benchmarks.programs.plates import recorded_programs
from benchmarks.programs.time_fit import PARAMETERS, ProgramTimes, compare, ideal_limits, identify_program_times
from tests.recordings import recording
from tests.twin.recording.made_programs import SET_UP, TRUE, made_programs, run_of, shop_program
from twin.errors import RunLogError
from twin.motion.plan import plan
from twin.recording.recorded_program import RecordedProgram, rapid_rate_mm_min

KNOWN = ("acceleration_mm_s2", "rapid_acceleration_mm_s2", "corner_speed_difference_mm_min", "tool_change_s", "reference_z")


@pytest.fixture(scope="module")
def made() -> list[RecordedProgram]:
    return made_programs()


@pytest.fixture(scope="module")
def found(made: list[RecordedProgram]) -> ProgramTimes:
    return identify_program_times(made, KNOWN, ideal_limits(made))


def test_the_constants_of_a_known_machine_are_found_again(found: ProgramTimes) -> None:
    truth = {name: getattr(TRUE, name) for name in KNOWN[:-1]} | {"reference_z": 350.0}
    for estimate in found.estimates:
        assert estimate.identifiable
        assert estimate.value == pytest.approx(truth[estimate.path], rel=0.15)
    inside = [estimate.low <= truth[estimate.path] <= estimate.high for estimate in found.estimates]
    assert sum(inside) >= 3


def test_a_program_at_another_feed_is_predicted_by_them(found: ProgramTimes) -> None:
    other = run_of(shop_program(600.0), TRUE, SET_UP)
    compared = compare(other, found.plan(other))
    assert abs(compared.relative_error) < 0.005
    assert sum(section.recorded_s for section in compared.sections) == pytest.approx(compared.recorded_s)
    assert sum(section.predicted_s for section in compared.sections) == pytest.approx(compared.predicted_s)


def test_what_no_run_tells_is_said_to_be_undetermined(made: list[RecordedProgram]) -> None:
    model = identify_program_times(made[:1], ("tool_change_s", "spindle_deceleration_rpm_s"), ideal_limits(made))
    assert {e.path for e in model.estimates if not e.identifiable} == {"spindle_deceleration_rpm_s"}


def plates(*names: str) -> dict[str, RecordedProgram]:
    texts = [
        (
            name,
            recording(f"nist/nc/NIST_MTC_CRADA_PLATE-{int(name)}.NC").read_text(),
            recording(f"nist/plate/Plate-Hurco04-{name}of20.txt").read_text(),
        )
        for name in names
    ]
    return {program.name: program for program in recorded_programs(texts)}


def test_one_recorded_plate_predicts_another_within_two_percent_and_six_seconds_a_tool() -> None:
    every = plates("03", "04", "11", "13")
    model = identify_program_times([every["13"]], PARAMETERS)
    for name in ("03", "11"):
        compared = compare(every[name], model.plan(every[name]))
        assert abs(compared.relative_error) < 0.02
        assert np.mean([abs(section.predicted_s - section.recorded_s) for section in compared.sections]) < 6.0
    length = compare(every["03"], plan(every["03"].path, ideal_limits([every["13"]])))
    assert length.relative_error < -0.1
    assert rapid_rate_mm_min([every["13"]])[0] == pytest.approx(800 * 25.4, rel=1e-3)


def test_what_cannot_be_judged_says_why_and_is_not_fitted() -> None:
    every = plates("04")
    assert every["04"].refusal() == "aborted"
    assert every["04/2"].refusal() == ""
    assert "ran to line index 59" in every["04/3"].refusal()
    with pytest.raises(RunLogError, match="04: aborted"):
        identify_program_times([every["04"]])
