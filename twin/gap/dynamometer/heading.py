"""The heading of the feed over the dynamometer's axes, where no reference tells it.

A dynamometer is set up square: the feed goes along x, unless the forces lie much better beside one of the other three directions.
A free angle is not asked for, since with the phase of the spindle it could not be told from another ratio of radial to tangential
force.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.gap.dynamometer.mean_turn import Engagement, best_phase, fine_turn, orders_of
from twin.gap.dynamometer.turn_mean import PASSINGS
from twin.machine import MachineFile
from twin.process.kernel import process_quantities
from twin.process.milling import tool_constants

Floats = NDArray[np.float64]
QUADRANTS = (0.0, np.pi / 2.0, np.pi, -np.pi / 2.0)
MUCH_BETTER = 0.6
"""Part of what is left with the feed along x that another direction may leave to be taken."""
WORDS = {0.0: "along x", np.pi / 2.0: "along y", np.pi: "against x", -np.pi / 2.0: "against y"}


def square_heading(machine: MachineFile, cuts: Sequence[tuple[Engagement, Floats]], signals: Sequence[int]) -> float:
    """The heading of one run; cuts: each stretch with its mean turn, (signals, points); signals: 0 for x, 1 for y."""
    if len(signals) < 2:
        return 0.0
    left = {heading: sum(_left(machine, replace(cut, heading_rad=heading), turn) for cut, turn in cuts) for heading in QUADRANTS}
    best = min(left, key=lambda heading: left[heading])
    return best if left[best] < MUCH_BETTER * left[0.0] else 0.0


def _left(machine: MachineFile, cut: Engagement, turn: Floats) -> float:
    """Energy that the twin as stated leaves of a mean turn at its best phase and size."""
    assert machine.tool is not None
    effects = added_effects(machine, process_quantities())
    constants = tool_constants(machine.tool) | {
        f"{name}__{key}": value for name, given in effects.items() for key, value in effect_named(name).checked(given).items()
    }
    highest = PASSINGS * machine.tool.teeth
    twin = fine_turn(constants, machine.tool.teeth, cut, tuple(effects)).orders(highest)
    measured = orders_of(turn, highest)
    measured[..., 0] = twin[..., 0] = 0.0
    late = twin[:, 0] * np.exp(-1j * np.arange(highest + 1) * best_phase(measured, twin, np.pi)[0])
    size = float(np.sum((np.conj(late) * measured).real) / max(np.sum(np.abs(late) ** 2), 1e-300))
    return float(np.sum(np.abs(measured - max(size, 0.0) * late) ** 2))
