"""Milling force over a motion (formats, section 4): at each tick, and its mean until the next one; and its peak between ticks.

A lane is one candidate tool and material, on the motion of all or on one of its own.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.effects.effect import Effect
from twin.errors import TwinError
from twin.kernels.assembly import kernel_function
from twin.machine import Tool
from twin.process.kernel import CUT, milling_kernel

Array = NDArray[np.float64]
LANES = (1, 8, 32)


@dataclass(frozen=True, slots=True)
class Milling:
    """The signals that the force depends on, tick by tick: each (ticks,), or (motions, ticks).

    spindle_angle_rad: phase of tooth 0; spindle_rpm: 0 or less = the spindle does not cut
    velocity_x_mm_s, velocity_y_mm_s: of the reference, at the tick
    axial_depth_mm: 0 or NaN = not in the cut
    entry_angle_rad, exit_angle_rad: of the engaged arc, which may go through 2π; NaN = not in the cut
    """

    spindle_angle_rad: Array
    spindle_rpm: Array
    velocity_x_mm_s: Array
    velocity_y_mm_s: Array
    axial_depth_mm: Array
    entry_angle_rad: Array
    exit_angle_rad: Array

    def rows(self) -> list[Array]:
        """All of them as (motions, ticks). Raises TwinError where their shapes do not fit each other."""
        fields = {name: np.asarray(getattr(self, name), dtype=np.float64) for name in self.__slots__}
        ticks = fields["spindle_angle_rad"].shape[-1:]
        for name, values in fields.items():
            if values.ndim not in (1, 2) or values.shape[-1:] != ticks:
                raise TwinError(f"{name} has the shape {values.shape}; it has to be (ticks,) or (motions, ticks), ticks {ticks}")
        return np.broadcast_arrays(*[np.atleast_2d(values) for values in fields.values()])  # type: ignore[return-value]


@dataclass(frozen=True, slots=True)
class MillingForce:
    """Forces on the tool, each (lanes, ticks), N.

    force_x_n, force_y_n: at the tick, as a dynamometer's sample shows them
    mean_force_x_n, mean_force_y_n: mean until the next tick, what moves the axes
    mean_tangential_n: mean of the tangential force of all teeth until the next tick
    cutting_speed_m_s: of the edge, (lanes, ticks); radius_m: of the tool, (lanes,)
    """

    force_x_n: Array
    force_y_n: Array
    mean_force_x_n: Array
    mean_force_y_n: Array
    mean_tangential_n: Array
    cutting_speed_m_s: Array
    radius_m: Array

    def cutting_power_w(self) -> Array:
        """P_cut = Σ F_t · π D n / 60, mean until the next tick."""
        return self.mean_tangential_n * self.cutting_speed_m_s

    def torque_nm(self) -> Array:
        """Σ F_t · D / 2 on the spindle, mean until the next tick."""
        return self.mean_tangential_n * self.radius_m[:, None]


def tool_constants(tool: Tool) -> dict[str, float]:
    """Name → value, for the physics of `twin.process`.

    >>> tool = Tool(diameter_mm=6.0, teeth=2, tangential_coefficient_n_per_mm2=1230.0, radial_ratio=0.5)
    >>> tool_constants(tool)
    {'tool_diameter_mm': 6.0, 'tangential_coefficient_n_per_mm2': 1230.0, 'radial_ratio': 0.5}
    """
    return {
        "tool_diameter_mm": tool.diameter_mm,
        "tangential_coefficient_n_per_mm2": tool.tangential_coefficient_n_per_mm2,
        "radial_ratio": tool.radial_ratio,
    }


def milling_force(
    constants: Mapping[str, ArrayLike],
    teeth: int,
    motion: Milling,
    *,
    period_s: float = 0.001,
    effects: Sequence[str] = (),
    reference_run: bool = False,
) -> MillingForce:
    """Forces of all lanes at all ticks.

    constants: name → a number or (lanes,), of the tool (`tool_constants`) and of the effects (`effect__parameter`); a motion of
    more than one row has one row for each lane
    effects: names of those that are in the kernel; lanes that do not have one carry its null values
    reference_run: in plain Python, slowly, from the same text

    A slot of 1 mm with one tooth in the middle of its arc, c = 0.1 mm, 900 N/mm², K_e = 0.4, feeding in x:

    >>> motion = Milling(*[np.array([v]) for v in (math.pi / 2, 600.0, 1.0, 0.0, 1.0, 0.0, math.pi)])
    >>> tool = Tool(diameter_mm=20.0, teeth=1, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)
    >>> force = milling_force(tool_constants(tool), 1, motion)
    >>> round(float(force.force_x_n[0, 0]), 9), round(float(force.force_y_n[0, 0]), 9)
    (-36.0, 90.0)

    Raises TwinError where arrays do not fit, EffectError where a constant is missing or an effect does not act on the cut.
    """
    rows = motion.rows()
    acting = CUT.effects(effects)
    lanes = _lane_count(constants, rows[0].shape[0])
    ticks = rows[0].shape[1]
    out = np.zeros((5, ticks, lanes))
    for chosen, width in _blocks(lanes, acting, shared=rows[0].shape[0] == 1):
        block = _Block(acting, width, teeth, reference_run)
        fed = [np.ascontiguousarray(row[chosen.start if row.shape[0] > 1 else 0]) for row in rows]
        block.milling(constants, chosen, fed, period_s, out)
    x, y, mean_x, mean_y, tangential = out.transpose(0, 2, 1)
    diameter_mm = np.broadcast_to(np.asarray(constants["tool_diameter_mm"], dtype=np.float64), (lanes,))
    speed_m_s = math.pi * diameter_mm[:, None] * np.broadcast_to(rows[1], (lanes, ticks)) / 60_000.0
    return MillingForce(x, y, mean_x, mean_y, tangential, speed_m_s, diameter_mm / 2000.0)


def peak_force(
    constants: Mapping[str, ArrayLike],
    teeth: int,
    spindle_rpm: ArrayLike,
    feed_mm_min: ArrayLike,
    axial_depth_mm: ArrayLike,
    entry_angle_rad: ArrayLike,
    exit_angle_rad: ArrayLike,
    *,
    effects: Sequence[str] = (),
    reference_run: bool = False,
) -> Array:
    """`cutting_force_peak_n`: the greatest resultant over a tooth period, whether or not a tick sees it; (lanes, cuts), N.

    Each cut is a number or an element of (cuts,), a lane as in `milling_force`. Where teeth differ it is the greatest of a turn.
    It is searched for between the angles at which a tooth enters or leaves, where the force is smooth, to 1e-9 of its value;
    with a helix to 1e-4.

    The slot of the reference paper: 6 mm, two flutes, 1,230 N/mm², K_e = 0.5, 0.8 mm deep, 400 mm/min at 8,000 rev/min make
    c = 0.025 mm and 1230 · 0.8 · 0.025 · √(1 + 0.5²) = 27.50 N:

    >>> tool = Tool(diameter_mm=6.0, teeth=2, tangential_coefficient_n_per_mm2=1230.0, radial_ratio=0.5)
    >>> round(float(peak_force(tool_constants(tool), 2, 8000.0, 400.0, 0.8, 0.0, math.pi)[0, 0]), 2)
    27.5

    Raises as `milling_force`.
    """
    given = [np.asarray(values, dtype=np.float64) for values in (spindle_rpm, feed_mm_min, axial_depth_mm)]
    given += [np.asarray(values, dtype=np.float64) for values in (entry_angle_rad, exit_angle_rad)]
    rows = [np.ascontiguousarray(values) for values in np.broadcast_arrays(*map(np.atleast_1d, given))]
    rows[1] = rows[1] / 60.0
    acting = CUT.effects(effects)
    lanes = _lane_count(constants, 1)
    out = np.zeros((len(rows[0]), lanes))
    for chosen, width in _blocks(lanes, acting, shared=True):
        _Block(acting, width, teeth, reference_run).peak(constants, chosen, rows, out)
    return out.T


def _lane_count(constants: Mapping[str, ArrayLike], motions: int) -> int:
    """Lanes by the longest constant, and by the motions where there is more than one."""
    sizes = {name: np.size(np.asarray(value)) for name, value in constants.items()} | {"the motion": motions}
    lanes = max(sizes.values())
    for name, size in sizes.items():
        if size not in (1, lanes):
            raise TwinError(f"{name} has {size} values for {lanes} lanes; it has to have one, or one for each lane")
    return lanes


def _blocks(lanes: int, effects: tuple[Effect, ...], *, shared: bool) -> list[tuple[slice, int]]:
    """Return the lanes that go side by side, and the width of their kernel: one by one where their angles differ."""
    apart = not shared or any("lag_rad" in effect.changes for effect in effects)
    size = 1 if apart else LANES[-1]
    chosen = [slice(first, min(first + size, lanes)) for first in range(0, lanes, size)]
    return [(block, next(width for width in LANES if width >= block.stop - block.start)) for block in chosen]


@dataclass(frozen=True, slots=True)
class _Block:
    """A few lanes side by side; a kernel that is too wide is filled up with copies of the last one."""

    effects: tuple[Effect, ...]
    width: int
    teeth: int
    reference_run: bool

    def milling(self, constants: Mapping[str, ArrayLike], chosen: slice, fed: list[Array], period_s: float, out: Array) -> None:
        """Fills `out`, (outputs, ticks, lanes)."""
        work = np.zeros(6 * self.width + 2 * self.teeth)
        row, radius_steps = self._prepared(constants, chosen)
        self._call("milling", chosen, out, [fed[0].size, self.teeth, period_s, row, radius_steps, work, *fed])

    def peak(self, constants: Mapping[str, ArrayLike], chosen: slice, fed: list[Array], out: Array) -> None:
        """Fills `out`, (cuts, lanes)."""
        row, radius_steps = self._prepared(constants, chosen)
        self._call("peak", chosen, out, [fed[0].size, self.teeth, row, radius_steps, *fed])

    def _prepared(self, constants: Mapping[str, ArrayLike], chosen: slice) -> tuple[Array, Array]:
        """Constants and radius steps in the order of the kernel's rows."""
        kernel = milling_kernel(self.width, self.effects)
        rows = np.empty((len(kernel.constants), self.width))
        for row, taken in enumerate(CUT.taken(constants, kernel.constants)):
            value = np.asarray(taken, dtype=np.float64)
            own = value.reshape(-1)[chosen] if value.size > 1 else value.reshape(-1)
            rows[row] = np.pad(own, (0, self.width - len(own)), mode="edge")
        radius_steps = np.zeros(self.teeth * self.width)
        if kernel.stepped:
            self._function("radii")(self.teeth, rows.reshape(-1), radius_steps)
        return rows.reshape(-1), radius_steps

    def _call(self, name: str, chosen: slice, out: Array, arguments: list[Any]) -> None:
        lanes = out.shape[-1]
        fits = chosen.stop - chosen.start == self.width
        target = out if fits else np.zeros((*out.shape[:-1], self.width))
        first, stride = (chosen.start, lanes) if fits else (0, self.width)
        self._function(name)(*arguments, target.reshape(-1), first, stride)
        if not fits:
            out[..., chosen] = target[..., : chosen.stop - chosen.start]

    def _function(self, name: str) -> Callable[..., None]:
        return kernel_function(milling_kernel(self.width, self.effects).text, name, reference_run=self.reference_run)
