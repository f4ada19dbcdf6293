"""The axis kernel with some of its quantities taken from the recording, over one stretch, in many lanes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.axis import axis_effects, filled
from twin.servo.run import AxisInput, run_axes

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Driven:
    """Series that drive the lanes over a stretch; each is (ticks,), (1, ticks) for all lanes or (lanes, ticks).

    recorded: quantity → series in place of it; added: quantity → series on top of it
    """

    reference_mm: Floats
    disturbance_n: Floats | None = None
    recorded: Mapping[str, Floats] = field(default_factory=dict)
    added: Mapping[str, Floats] = field(default_factory=dict)


def run_lanes(
    constants: Mapping[str, Floats],
    driven: Driven,
    start: Mapping[str, Floats],
    output: str,
    period_s: float,
    first_tick: int,
) -> tuple[Floats, Mapping[str, Floats]]:
    """Return an output of the kernel, (lanes, ticks), and the state after it, name → (lanes,)."""
    lanes = len(next(iter(constants.values())))
    series = [np.atleast_2d(one) for one in (driven.reference_mm, *driven.recorded.values(), *driven.added.values())]
    columns = max(len(one) for one in series)
    index = np.minimum(np.arange(filled(lanes)), lanes - 1)
    recorded = dict(zip(driven.recorded, series[1:], strict=False))
    added = dict(zip(driven.added, series[1 + len(recorded) :], strict=True))
    disturbance = None if driven.disturbance_n is None else np.atleast_2d(driven.disturbance_n)
    run = run_axes(
        {name: value[index] for name, value in constants.items()},
        AxisInput(series[0], np.minimum(index, columns - 1), disturbance, recorded, added),
        period_s=period_s,
        effects=tuple(effect.name for effect in axis_effects()),
        outputs=(output,),
        start={name: np.broadcast_to(value, (lanes,))[index] for name, value in start.items()},
        first_tick=first_tick,
    )
    return run.outputs[output][:lanes], {name: value[:lanes] for name, value in run.state.items()}
