"""A run of plain production, second by second: a spindle at a few speeds, cuts in between, tool changes."""

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, RunAtHand, RunEntry, RunKind
from twin.machine import MachineFile, machine_from_toml
from twin.runlog import RunLog, run_log

MACHINE = machine_from_toml("""
[machine]
name = "vmc"
[spindle]
rated_power_kw = 10.0
efficiency = 0.85
idle_power_kw = 0.3
[program]
rapid_mm_min = 24000.0
acceleration_mm_s2 = 4000.0
tool_change_s = 6.0
[noise]
spindle_load_pct = 0.2
""")
SPEEDS_RPM = (2000.0, 5000.0, 8000.0)
PART_S = 40


def produced(seed: int, role: str = "fit", slope_pct: float = 0.0, factor: float = 1.0, step_pct: float = 0.1) -> RunAtHand:
    """Return a run of 20 operations: 6 s of tool change, 10 s in air, the rest in the cut.

    slope_pct: what the load in air has on top at 5,000 rev/min, in proportion to the speed; factor: on all that the meter shows
    """
    chance = np.random.default_rng(seed)
    second = np.tile(np.arange(PART_S), 20)
    rpm = np.where(second < 6, 0.0, np.repeat(chance.permutation(np.resize(SPEEDS_RPM, 20)), PART_S))
    cutting = second >= 16
    idle = np.where(rpm > 0.0, 3.0 + slope_pct * rpm / 5000.0, 0.0)
    load = factor * (idle + np.where(cutting, chance.uniform(10.0, 40.0, len(second)), 0.0))
    load = np.round((load + 0.2 * chance.standard_normal(len(second))) / step_pct) * step_pct
    columns = {
        "t_s": np.arange(len(second), dtype=np.float64),
        "spindle_rpm": rpm,
        "spindle_load_pct": load,
        "feed_mm_min": np.where(cutting, 900.0, 0.0),
        "tool_change_active": (second < 6).astype(np.float64),
    }
    return run_of(run_log(columns), role)


def run_of(log: RunLog, role: str = "fit") -> RunAtHand:
    """Return a recording as a run of a case."""
    entry = RunEntry(file=role, kind=RunKind.WARMUP, role=role)  # type: ignore[arg-type]
    return RunAtHand(entry, None, log)  # type: ignore[arg-type]


def without(run: RunAtHand, *names: str) -> RunAtHand:
    """Return the run as a control records it that does not say some of it."""
    kept: dict[str, NDArray[np.float64]] = {n: v for n, v in run.log.columns.items() if n not in names}
    return run_of(run_log({"t_s": run.log.t_s, **kept}), run.entry.role)


def case_with(machine: MachineFile = MACHINE, **changes: float) -> Case:
    """Return a case with a run to learn from and one to judge on."""
    return Case("produced", machine, (produced(1, **changes), produced(2, "check", **changes)))  # type: ignore[arg-type]
