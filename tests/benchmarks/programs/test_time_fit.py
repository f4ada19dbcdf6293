"""The time model: found again where it is known, and on recorded plates."""

import numpy as np
import pytest

from benchmarks.programs.time_fit import PARAMETERS, ProgramTimes, compare, ideal_limits, identify_program_times
from tests.recordings import recording
from twin.errors import RunLogError
from twin.gcode import Settings, interpret
from twin.motion.limits import Limits
from twin.motion.path import path_from_moves
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.recording.observations import Observation, Observations
from twin.recording.program_run import program_runs
from twin.recording.recorded_program import NOMINAL, RecordedProgram, SetUp, rapid_rate_mm_min, recorded_programs, windows

TRUE = Limits(
    rapid_mm_min=20000.0,
    acceleration_mm_s2=250.0,
    rapid_acceleration_mm_s2=900.0,
    corner_speed_difference_mm_min=150.0,
    tool_change_s=4.0,
)
KNOWN = ("acceleration_mm_s2", "rapid_acceleration_mm_s2", "corner_speed_difference_mm_min", "tool_change_s", "reference_z")


def shop_program(feed: float) -> str:
    """Two tools, a hundred zigzags of 1 to 9 mm, rapids between."""
    blocks = ["%", "G21G90G17", "T1M6"]
    for k in range(100):
        blocks += [f"G0X{k % 7 * 20.0:.1f}Y0.0", "G0Z2.0", f"G1Z-1.0F{feed:.1f}"]
        blocks += [f"G1X{k % 7 * 20.0 + n * (1 + k % 9):.1f}Y{(n % 2) * (1 + k % 5):.1f}" for n in range(1, 6)]
        blocks += ["G0Z20.0"] + (["G91G28Z0.0", "G90", "T2M6"] if k == 49 else [])
    return "\n".join([*blocks, "G91G28Z0.0", "M30", "%"])


def run_of(text: str, limits: Limits, set_up: SetUp, name: str = "made") -> RecordedProgram:
    """A recording as the machine with these limits would make it, asked every 0.15 s."""
    settings = Settings(
        start_mm=(set_up.tool_change_x, set_up.tool_change_y, set_up.reference_z), references_mm=((0.0, 0.0, set_up.reference_z),)
    )
    path = path_from_moves(interpret(text, settings), settings.start_mm)
    motion = sampled(plan(path, limits), 0.15)
    rows = [Observation(0.0, "Program_Status", "ACTIVE")]
    for t, line, feed in zip(motion.t_s.tolist(), motion.line.tolist(), motion.feed_mm_min.tolist(), strict=True):
        rows += [Observation(t, "Block_Number", str(line + 1)), Observation(t, "Feed_Rate", str(feed / 60.0))]
    rows.append(Observation(float(motion.t_s[-1]), "Program_Status", "PROGRAM_COMPLETED"))
    nominal = Settings(
        start_mm=(NOMINAL.tool_change_x, NOMINAL.tool_change_y, NOMINAL.reference_z),
        references_mm=((0.0, 0.0, NOMINAL.reference_z),),
    )
    return RecordedProgram(
        name, path_from_moves(interpret(text, nominal), nominal.start_mm), program_runs(Observations(tuple(rows), 0))[0]
    )


@pytest.fixture(scope="module")
def made() -> list[RecordedProgram]:
    set_up = NOMINAL._replace(reference_z=350.0)
    return [run_of(shop_program(feed), TRUE, set_up, f"made {feed}") for feed in (1500.0, 3000.0)]


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
    other = run_of(shop_program(600.0), TRUE, NOMINAL._replace(reference_z=350.0))
    compared = compare(other, found.plan(other))
    assert abs(compared.relative_error) < 0.005
    assert sum(section.recorded_s for section in compared.sections) == pytest.approx(compared.recorded_s)
    assert sum(section.predicted_s for section in compared.sections) == pytest.approx(compared.predicted_s)


def test_the_rapid_rate_is_read_off_the_long_rapids(made: list[RecordedProgram]) -> None:
    rate, spread = rapid_rate_mm_min(made)
    assert rate == pytest.approx(20000.0, rel=1e-6)
    assert spread == pytest.approx(0.0, abs=1.0)


def test_what_no_run_tells_is_said_to_be_undetermined(made: list[RecordedProgram]) -> None:
    model = identify_program_times(made[:1], ("tool_change_s", "spindle_deceleration_rpm_s"), ideal_limits(made))
    assert {e.path for e in model.estimates if not e.identifiable} == {"spindle_deceleration_rpm_s"}


def test_windows_are_apart(made: list[RecordedProgram]) -> None:
    begin, line = windows(made[0], 1.0)
    assert np.diff(begin).min() >= 1.0
    assert np.all(np.diff(line) > 0)


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
