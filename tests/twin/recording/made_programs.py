"""Runs of programs of a shop, recorded as a machine with known limits would have recorded them."""

from twin.motion.limits import Limits
from twin.motion.path import path_from_moves
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.programs import Settings, interpret
from twin.recording.observations import Observation, Observations
from twin.recording.program_run import program_runs
from twin.recording.recorded_program import NOMINAL, RecordedProgram, SetUp

TRUE = Limits(
    rapid_mm_min=20000.0,
    acceleration_mm_s2=250.0,
    rapid_acceleration_mm_s2=900.0,
    corner_speed_difference_mm_min=150.0,
    tool_change_s=4.0,
)
SET_UP = NOMINAL._replace(reference_z=350.0)


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


def made_programs() -> list[RecordedProgram]:
    """Two of them, at two feeds."""
    return [run_of(shop_program(feed), TRUE, SET_UP, f"made {feed}") for feed in (1500.0, 3000.0)]
