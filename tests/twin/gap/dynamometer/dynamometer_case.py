"""Cases of a dynamometer alone: three runs at five feeds, the last to be judged on."""

from pathlib import Path

from tests.twin.gap.dynamometer.milled import Bench, Cutter, recorded
from twin.case import Case, RunAtHand, RunEntry, RunKind
from twin.machine import Machine, MachineFile, Tool
from twin.runlog import RunLog, run_log

ARC = (0.0, 1.9)
FEEDS = ((300.0, 1200.0), (600.0,), (450.0, 900.0))


def machine(cutter: Cutter) -> MachineFile:
    """The machine as it is told: a tool with no edge, no runout and no helix."""
    tool = Tool(diameter_mm=cutter.diameter_mm, teeth=cutter.teeth, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)
    return MachineFile(machine=Machine(name="bench"), tool=tool, uncertainty={"relative": 0.03})


def run_at_hand(name: str, role: str, log: RunLog) -> RunAtHand:
    """A run of kind cut."""
    return RunAtHand(RunEntry(file=name, kind=RunKind.CUT, role="check" if role == "check" else "fit"), Path(), log)


def dynamometer_case(
    cutter: Cutter, bench: Bench | None = None, *, with_angle: bool = False, air_s: float = 0.4, seed: int = 10
) -> Case:
    """The case."""
    runs = []
    for number, feeds in enumerate(FEEDS):
        log = run_log(recorded(cutter, feeds, arc=ARC, seed=seed + number, with_angle=with_angle, air_s=air_s, bench=bench))
        runs.append(run_at_hand(f"run_{number}", "check" if number == len(FEEDS) - 1 else "fit", log))
    return Case("bench", machine(cutter), tuple(runs))
