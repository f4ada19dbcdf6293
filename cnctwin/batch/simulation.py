"""A simulated run of a part program and its figures: for the command line, and for Python."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from twin.effects.added import check_effects
from twin.errors import EffectError
from twin.machine import MachineFile, read_machine
from twin.simulator.simulation import Simulation


@dataclass(frozen=True, slots=True)
class Figures:
    """Root mean square and greatest amount of a signal over a run, in the unit of the signal."""

    rms: float
    peak: float

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> "Figures":
        """Return the figures of these values; those that are missing are left out.

        >>> Figures.of(np.array([3.0, -4.0, np.nan]))
        Figures(rms=3.5355339059327378, peak=4.0)
        """
        return cls(float(np.sqrt(np.nanmean(values**2))), float(np.nanmax(np.abs(values))))


@dataclass(frozen=True, slots=True)
class AxisFigures:
    """An axis over a run: its following error, in mm or (where it turns) in deg, and its torque command, A."""

    following_error: Figures
    unit: str
    torque_a: Figures


@dataclass(frozen=True, slots=True)
class Summary:
    """The figures of a run.

    seconds: time that the program takes; cutting_force_n: while cutting, None in air; spindle_load_pct, spindle_temp_c: greatest,
    None where the machine states nothing to compute them from
    """

    seconds: float
    axes: Mapping[str, AxisFigures]
    cutting_force_n: Figures | None = None
    spindle_load_pct: float | None = None
    spindle_temp_c: float | None = None

    def as_json(self) -> dict[str, Any]:
        """Everything, for a program to read."""

        def told(figures: Figures) -> dict[str, float]:
            return {"rms": figures.rms, "peak": figures.peak}

        axes = {
            name: {f"following_error_{axis.unit}": told(axis.following_error), "torque_a": told(axis.torque_a)}
            for name, axis in self.axes.items()
        }
        values: dict[str, Any] = {"seconds": self.seconds, "axes": axes}
        if self.cutting_force_n is not None:
            values["cutting_force_n"] = told(self.cutting_force_n)
        peaks = {"spindle_load_pct": self.spindle_load_pct, "spindle_temp_c": self.spindle_temp_c}
        return values | {name: {"peak": peak} for name, peak in peaks.items() if peak is not None}


def machine_to_simulate(path: Path) -> MachineFile:
    """The machine of a file, its effects checked. Raises MachineError, or UsageError where an effect does not fit."""
    machine = read_machine(path)
    try:
        check_effects(machine)
    except EffectError as error:
        raise UsageError(f"{path}: {error}") from None
    return machine


def summary_of(done: Simulation) -> Summary:
    """Return the figures of a simulation."""
    run = done.run
    axes = {
        axis: AxisFigures(Figures.of(error), "deg" if axis in run.rotary else "mm", Figures.of(run[f"{axis}_torque_a"]))
        for axis, error in done.following_error_mm().items()
    }
    force = None
    if "force_x_n" in run.columns and (cutting := run["axial_depth_mm"] > 0.0).any():
        resultant = np.hypot(run["force_x_n"], run["force_y_n"])[cutting]
        force = Figures(Figures.of(resultant).rms, float(run["cutting_force_peak_n"].max()))
    peaks = {name: float(np.nanmax(run[name])) for name in ("spindle_load_pct", "spindle_temp_c") if name in run.columns}
    return Summary(done.seconds, axes, force, peaks.get("spindle_load_pct"), peaks.get("spindle_temp_c"))
