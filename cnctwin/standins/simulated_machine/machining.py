"""Machining: the program simulated on the machine as it is, and what the control shows of it, ten times a second.

The tool number is empty while a tool is changed, as on the Okuma that was recorded; a load of an axis is the root mean square of
its torque over a tenth of a second, in % of the torque limit; the line is the index of the block in the text, as in a run log.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.simulated_machine.description import program_text
from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import Part
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.simulator.simulation import simulate

SHOWN_S = 0.1


def machined(number: int, machine: MachineFile) -> Part:
    """Part `number` of the day."""
    text = program_text()
    done = simulate(machine, text, seed=number)
    limits_a = {letter: axis.torque_limit_a for letter, axis in machine.axes.items()}
    return Part(tuple(moments_of_run(done.run, text.splitlines(), limits_a)), float(done.run.t_s[-1]))


def moments_of_run(run: RunLog, blocks: list[str], torque_limits_a: Mapping[str, float]) -> Iterator[Moment]:
    """Yield the control's states of a run every 0.1 s and at its end; `blocks`: program lines, `torque_limits_a`: by axis."""
    step = round(SHOWN_S / float(run.t_s[1] - run.t_s[0]))
    ticks = np.unique([*range(0, len(run), step), len(run) - 1])
    loads = {f"{a.upper()}load": _load_pct(run[f"{a}_torque_a"], ticks, limit) for a, limit in torque_limits_a.items()}
    for row, tick in enumerate(ticks):
        line, tool = int(run["line"][tick]), run["tool_number"][tick]
        values = {
            "block": blocks[line].strip(),
            "line": str(line),
            "Tool_number": "" if np.isnan(tool) else f"{tool:.0f}",
            "Srpm": f"{run['spindle_rpm'][tick]:.0f}",
            "Sload": _rounded(max(run["spindle_load_pct"][tick], 0.0), 1),
            "Fact": f"{run['feed_mm_min'][tick]:.0f}",
            "coolant": "ON" if run["coolant_on"][tick] else "OFF",
        }
        values |= {f"{a.upper()}abs": _rounded(run[f"{a}_pos_mm"][tick], 3) for a in torque_limits_a}
        values |= {key: f"{load[row]:.0f}" for key, load in loads.items()}
        yield Moment(round(float(run.t_s[tick]), 6), values)


def _load_pct(torque_a: NDArray[np.float64], ticks: NDArray[np.int64], limit_a: float) -> NDArray[np.float64]:
    """Root mean square since the row before, (rows,), % of the limit.

    >>> _load_pct(np.array([0.0, 3.0, 4.0]), np.array([0, 2]), 10.0).round(1).tolist()
    [0.0, 35.4]
    """
    total = np.concatenate([[0.0], np.cumsum(torque_a**2)])[np.concatenate([[0], ticks + 1])]
    return np.asarray(100.0 * np.sqrt(np.diff(total) / np.diff(ticks, prepend=-1)) / limit_a)


def _rounded(value: float, digits: int) -> str:
    """As a display shows it; there is no −0.

    >>> _rounded(-0.0002, 3), _rounded(-438.0004, 3)
    ('0', '-438')
    """
    return f"{round(value, digits) + 0.0:.{digits + 6}g}"
