"""One run of a program on a machine, every 0.1 s: what drives its spindle and its heat, and what its control tells.

The path of the program, the control's times and the cut are those of the simulator. The power of the cut is read off a load
meter without idle power, losses or effects, so that what the machine's own meter shows can be worked out over a whole day.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.machine import MachineFile, SpindleDrive
from twin.simulator.simulation import simulate
from twin.sites import Site

Floats = NDArray[np.float64]
TICK_S = 0.1
PLAIN_METER = SpindleDrive(rated_power_kw=100.0, efficiency=1.0, idle_power_kw=0.0)
"""It shows 1 % for each kW of cut."""
NOT_OF_A_CYCLE = frozenset({Site.SPINDLE, Site.THERMAL, Site.SENSOR, Site.CLOCK})


@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """Arrays (n,), one row for each 0.1 s from cycle start to its end.

    cutting_power_kw: mean over the last 0.1 s; spindle_rpm, spindle_rpm_cmd without a sense; tool_number: 0 while there is none
    tool_change_active, coolant_on: 0 or 1; line: index of the program line
    """

    program: str
    cutting_power_kw: Floats
    spindle_rpm: Floats
    spindle_rpm_cmd: Floats
    feed_mm_min: Floats
    tool_number: Floats
    tool_change_active: Floats
    coolant_on: Floats
    line: Floats

    def __len__(self) -> int:
        return len(self.spindle_rpm)

    @classmethod
    def of(cls, machine: MachineFile, program: str, text: str) -> Self:
        """Return a run of a program text. Raises what `simulate` raises."""
        done = simulate(_bare(machine), text, name=program)
        run = done.run
        rows = np.searchsorted(run.t_s, np.arange(0.0, run.t_s[-1], TICK_S) + TICK_S / 2.0)
        rows = np.minimum(rows, len(run) - 1)
        command = np.zeros(len(run))
        for begin_s, _, _, after_rpm in done.plan.spindle_ramps:
            command[run.t_s >= begin_s] = abs(after_rpm)
        return cls(
            program,
            run["spindle_load_pct"][rows],
            run["spindle_rpm"][rows],
            command[rows],
            run["feed_mm_min"][rows],
            np.nan_to_num(run["tool_number"][rows]),
            run["tool_change_active"][rows],
            run["coolant_on"][rows],
            run["line"][rows],
        )


def _bare(machine: MachineFile) -> MachineFile:
    """The machine without axes, noise, and effects on what is worked out over the day."""
    effects = tuple(
        added
        for added in machine.effects
        if (effect := effect_named(added.effect)).on is On.MACHINE and effect.site not in NOT_OF_A_CYCLE
    )
    return machine.model_copy(
        update={"axes": {}, "noise": {}, "effects": effects, "learned": (), "thermal": None, "spindle": PLAIN_METER}
    )
