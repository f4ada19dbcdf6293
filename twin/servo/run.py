"""Runs axes: the servo loops and mechanics of any number of lanes over a reference.

A lane is one axis of one candidate machine. One lane, three axes or thousands of candidates go through the same kernel text; it
is made for 4, 8 or 32 lanes side by side, and the last block is filled up with copies of its first lane.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect
from twin.kernels.assembly import kernel_function
from twin.servo.kernel import AXES, AxisKernel, axis_kernel
from twin.servo.metrics import AxisMetrics

Array = NDArray[np.float64]
LANES = (4, 8, 32)


@dataclass(frozen=True, slots=True)
class AxisRun:
    """The result of the lanes.

    outputs: name → (lanes, ticks); state: name → (lanes,), to go on from; ticks: how many have been run since the start, so that
    effects that age go on ageing
    """

    outputs: Mapping[str, Array]
    state: Mapping[str, Array]
    ticks: int

    def following_error_rms_mm(self) -> Array:
        """Root mean square of the following error, (lanes,), where the run was measured."""
        return np.sqrt(self.state["following_error_sum_mm2"] / self.ticks)

    def torque_rms_a(self) -> Array:
        """Root mean square of the torque command, (lanes,), where the run was measured."""
        return np.sqrt(self.state["torque_sum_a2"] / self.ticks)


@dataclass(frozen=True, slots=True)
class AxisInput:
    """The inputs of the lanes, by tick.

    reference_mm: (columns, ticks); disturbance_n: the same shape, or None; recorded: quantity → (columns, ticks), taken from a
    recording in place of what the model makes; added: quantity → (columns, ticks), put on top of what the model makes
    column: (lanes,) which column a lane follows; what has only one goes to all lanes
    """

    reference_mm: Array
    column: NDArray[np.intp]
    disturbance_n: Array | None = None
    recorded: Mapping[str, Array] = field(default_factory=dict)
    added: Mapping[str, Array] = field(default_factory=dict)


def run_axes(
    constants: Mapping[str, Array],
    inputs: AxisInput,
    *,
    period_s: float = 0.001,
    steps: int = 1,
    effects: Sequence[str] = (),
    outputs: tuple[str, ...] = ("position_mm", "torque_a"),
    measured: bool = False,
    start: Mapping[str, Array | float] | None = None,
    first_tick: int = 0,
    reference_run: bool = False,
) -> AxisRun:
    """Runs all lanes over all ticks.

    constants: name → (lanes,), of the axes (`twin.servo.constants`) and of the effects (`effect__parameter`)
    steps: of the mechanics between two ticks; with one, halving it moves no position by 0.1 µm
    effects: names of those that are in the kernel; lanes that do not have one carry its null values
    outputs: quantities to keep at every tick; measured: whether to keep sums and peaks (`twin.servo.metrics`)
    start: the state to start from, by name; what is not given starts at rest on the reference
    reference_run: in plain Python, slowly, from the same text

    Raises EffectError where a constant is missing, or an effect does not act on an axis.
    """
    acting = AXES.effects(effects)
    lanes = len(inputs.column)
    states: list[dict[str, Array]] = []
    blocks = _blocks(inputs.column)
    room = _width(lanes) if len(blocks) == 1 else lanes
    whole = np.empty((len(outputs), room, inputs.reference_mm.shape[1]))
    for block in blocks:
        job = _Block(block, constants, inputs, acting, outputs, measured, start or {}, reference_run)
        state = job.run(first_tick, steps, period_s, whole)
        states.append({name: values[: len(block)] for name, values in state.items()})
    order = np.argsort(np.concatenate(blocks)) if lanes else np.array([], dtype=np.intp)
    return AxisRun(
        dict(zip(outputs, whole[:, :lanes], strict=True)),
        {name: np.concatenate([state[name] for state in states])[order] for name in states[0]} if states else {},
        first_tick + inputs.reference_mm.shape[1],
    )


def _width(lanes: int) -> int:
    """Return the width of the narrowest kernel that takes so many lanes."""
    return next(width for width in LANES if width >= lanes)


def _blocks(column: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Lanes that run side by side: as many as go on one column, what is left over together."""
    full, left = [], []
    for value in dict.fromkeys(column.tolist()):
        lanes = np.flatnonzero(column == value)
        whole = len(lanes) // LANES[-1] * LANES[-1]
        full += list(lanes[:whole].reshape(-1, LANES[-1]))
        left.append(lanes[whole:])
    rest = np.concatenate(left) if left else np.array([], dtype=np.intp)
    return [*full, *(rest[i : i + LANES[-1]] for i in range(0, len(rest), LANES[-1]))]


@dataclass(frozen=True, slots=True)
class _Block:
    """A few lanes side by side."""

    lanes: NDArray[np.intp]
    constants: Mapping[str, Array]
    inputs: AxisInput
    effects: tuple[Effect, ...]
    outputs: tuple[str, ...]
    measured: bool
    start: Mapping[str, Array | float]
    reference_run: bool

    def run(self, first_tick: int, steps: int, period_s: float, whole: Array) -> dict[str, Array]:
        """Fills the block's lanes of `whole`, (outputs, lanes, ticks), and the room after them; the states at the end."""
        width = _width(len(self.lanes))
        filled = np.concatenate([self.lanes, np.full(width - len(self.lanes), self.lanes[0])])
        column = self.inputs.column[filled]
        shared = bool((column == column[0]).all())
        series = self._series()
        kernel = axis_kernel(
            width,
            self.effects,
            tuple(self.inputs.recorded),
            () if shared else tuple(name for name, values in series.items() if len(values) > 1),
            self.inputs.disturbance_n is not None,
            self.outputs,
            self.measured,
            tuple(self.inputs.added),
        )
        fed = [np.ascontiguousarray(_fed(values, column, shared=shared), dtype=np.float64) for values in series.values()]
        ticks = whole.shape[2]
        scratch = self._scratch(kernel, filled).reshape(-1)
        straight = bool((np.diff(self.lanes) == 1).all())
        in_place = straight and (len(self.lanes) == width or whole.shape[1] == width)
        out = whole if in_place else np.empty((len(self.outputs), width, ticks))
        where = (out.shape[1], int(self.lanes[0]) if in_place else 0)
        axes = kernel_function(kernel.text, "axes", reference_run=self.reference_run)
        axes(first_tick, ticks, steps, period_s, scratch, *fed, *where, out.reshape(-1))
        if not in_place:
            whole[:, self.lanes] = out[:, : len(self.lanes)]
        rows = scratch.reshape(-1, width)
        return {name: rows[row] for row, name in enumerate(kernel.scratch[: kernel.states])}

    def _series(self) -> dict[str, Array]:
        """All inputs by the names that the kernel has for them, in its order."""
        disturbance = self.inputs.disturbance_n
        first = {"reference_mm": self.inputs.reference_mm} | ({} if disturbance is None else {"disturbance_n": disturbance})
        recorded = {f"recorded__{name}": values for name, values in self.inputs.recorded.items()}
        return first | recorded | {f"added__{name}": values for name, values in self.inputs.added.items()}

    def _scratch(self, kernel: AxisKernel, filled: NDArray[np.intp]) -> Array:
        """States and constants, (names, width)."""
        rows = np.zeros((kernel.rows, len(filled)))
        first_mm = self.inputs.reference_mm[:, 0]
        reference = first_mm[self.inputs.column[filled] if len(first_mm) > 1 else np.zeros(len(filled), dtype=np.intp)]
        at_rest: dict[str, Array | float] = {"position_mm": reference, "previous_reference_mm": reference}
        at_rest |= dict.fromkeys(AxisMetrics._fields, 0.0)
        for effect in self.effects:
            for name, value in effect.states.items():
                start = self.start.get(value, at_rest.get(value, 0.0)) if isinstance(value, str) else value
                at_rest[f"{effect.name}__{name}"] = start
        for row, name in enumerate(kernel.scratch):
            if name in self.start:
                given = np.asarray(self.start[name], dtype=np.float64)
                rows[row] = given[filled] if given.ndim else given
            elif row < kernel.states:
                first = np.asarray(at_rest.get(name, 0.0))
                rows[row] = first[filled] if first.ndim and len(first) != len(filled) else first
            else:
                rows[row] = np.asarray(AXES.taken(self.constants, [name])[0])[filled]
        return rows


def _fed(values: Array, column: NDArray[np.intp], *, shared: bool) -> Array:
    """Return a series as the kernel takes it: (ticks,), or where lanes have their own (ticks · lanes,), lanes fastest."""
    if shared or len(values) == 1:
        return np.asarray(values[column[0] if len(values) > 1 else 0])
    if values.strides[0] == 0:  # the same for all lanes
        return np.repeat(values[0], len(column))
    straight = bool((np.diff(column) == 1).all())
    rows = values[column[0] : column[-1] + 1] if straight else values[column]
    return np.asarray(rows.T.reshape(-1))
