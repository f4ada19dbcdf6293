"""Both programs on the whole simulated machine, servo loops and friction included, which the optimiser leaves out."""

import numpy as np

from twin.errors import TwinError
from twin.machine import MachineFile
from twin.optimisation.answer import Resimulated
from twin.simulator.simulation import Simulation, simulate


def resimulated(machine: MachineFile, before: str, after: str, is_planned: bool) -> Resimulated | None:
    """None where the machine has no axes. A run that the simulator refuses is a note, not the end of an optimisation.

    is_planned: what is cut is known from a run log only, so that the simulation is one in air
    """
    if not machine.axes:
        return None
    runs: list[Simulation] = []
    try:
        runs = [simulate(machine, text, name=name) for text, name in ((before, "the program"), (after, "the optimised program"))]
    except TwinError as error:
        return Resimulated((float("nan"), float("nan")), (float("nan"), float("nan")), {}, (f"not simulated: {error}",))
    errors = [run.following_error_mm() for run in runs]
    axes = {axis: (_peak(errors[0][axis]), _peak(errors[1][axis])) for axis in errors[0] if axis in errors[1]}
    notes = tuple(dict.fromkeys(note for run in runs for note in run.notes))
    if is_planned:
        notes += ("what is cut is known from a run log only: this run is in air",)
    return Resimulated((runs[0].seconds, runs[1].seconds), (_force(runs[0]), _force(runs[1])), axes, notes)


def _peak(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> float:
    return float(np.nanmax(np.abs(values)))


def _force(run: Simulation) -> float:
    return float(run.run["cutting_force_peak_n"].max()) if "cutting_force_peak_n" in run.run.columns else 0.0
