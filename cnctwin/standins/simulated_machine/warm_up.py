"""The warm-up of the spindle in air at the begin of a shift: some speeds, each without coolant and then with it.

The load is that of the drive in air; the power that speeds the spindle up is not in it, as in the simulation.
"""

from collections.abc import Iterator
from random import Random

from cnctwin.standins.simulated_machine.moment import Moment
from twin.live.spindle import SIGNAL, LiveSpindle
from twin.machine import MachineFile

PROGRAM = "O1700"
BLOCK = "O1700 (SPINDLE WARM-UP IN AIR)"
SPEEDS_RPM = (3000.0, 9000.0, 6000.0, 11000.0)
DRY_S, WET_S = 5.0, 5.0
"""Seconds at each speed without coolant, and then with it."""
SHOWN_S = 0.1
SECONDS = len(SPEEDS_RPM) * (DRY_S + WET_S)


def warm_up(machine: MachineFile) -> Iterator[Moment]:
    """Yield what the control shows of it, from its begin on."""
    drive, noise_pct = LiveSpindle.of(machine), machine.noise.get(SIGNAL, 0.0)
    program = machine.program
    acceleration_rpm_s = (program and program.spindle_acceleration_rpm_s) or 5000.0
    rpm, random = 0.0, Random(PROGRAM)  # noqa: S311 — no secret
    yield Moment(0.0, {"execution": "ACTIVE", "program": PROGRAM, "block": BLOCK, "line": "0"})
    for step in range(1, round(SECONDS / SHOWN_S)):
        at_s = round(step * SHOWN_S, 1)
        number, within_s = divmod(at_s, DRY_S + WET_S)
        most = acceleration_rpm_s * SHOWN_S
        rpm += min(max(SPEEDS_RPM[int(number)] - rpm, -most), most)
        load_pct = drive.load_pct(0.0, rpm) + random.gauss(0.0, noise_pct)
        coolant = "ON" if within_s >= DRY_S else "OFF"
        yield Moment(at_s, {"Srpm": f"{rpm:.0f}", "Sload": f"{max(load_pct, 0.0):.1f}", "coolant": coolant})
    stopped = f"{drive.load_pct(0.0, 0.0):.1f}"
    yield Moment(SECONDS, {"execution": "PROGRAM_COMPLETED", "Srpm": "0", "Sload": stopped, "coolant": "OFF"})
