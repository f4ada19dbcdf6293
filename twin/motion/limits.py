"""The limits that a control states for its motion, and what they allow on each segment and at each corner of a path.

The corner rule is that of FANUC's AI contour control (A-63512EN; permissible speed difference, parameter 1783): with unit
tangents t⁻, t⁺ before and after a corner, the speed there is v ≤ min over axes of D_i / |t⁺_i − t⁻_i|. The other rule that
controls use is by contour tolerance (junction deviation δ): with γ the angle between the two lines, v² ≤ a δ sin(γ/2) / (1 −
sin(γ/2)). The circle that touches both lines and leaves the corner by δ has the radius r = δ sin(γ/2) / (1 − sin(γ/2)), and
v² / r is the acceleration along the path there (S. K. Jeon, *Improving Grbl: cornering algorithm*, 2011). Where the program
itself states a tolerance (HEIDENHAIN cycle 32, SINUMERIK CYCLE832), this rule with that tolerance alone decides. A limit that is
infinite does not exist.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import MachineError
from twin.machine import Program
from twin.motion.path import Event, EventKind, Kind, Path

Floats = NDArray[np.float64]
ACCELERATION_MAX_MM_S2 = 1e9
"""The acceleration that stands for no limit: from rest to any feed in less than a microsecond."""
PerAxis = float | tuple[float, ...]
"""One figure for all axes, or one for each in the order of the path's axes."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The control's parameters. FANUC's numbers are those of the 30i series.

    rapid_mm_min: rapid traverse rate of each axis (1420)
    acceleration_mm_s2: of each axis in cutting feed (1660)
    rapid_acceleration_mm_s2: of each axis in rapid (1620); None = as in cutting feed
    jerk_mm_s3: of each axis (bell-shaped acceleration before interpolation, 1772); infinite = trapezoid
    rapid_jerk_mm_s3: None = as in cutting feed
    corner_speed_difference_mm_min: permissible jump of the speed of each axis at a corner (1783)
    corner_deviation_mm: contour tolerance at a corner; infinite = that rule is not used
    centripetal_mm_s2: on arcs (1735); None = the acceleration of the axes of the plane
    block_time_s: no block takes less
    in_position_s: at every halt, until the following error is within the in-position width (1826)
    rapid_overlap: rapids that follow one another meet like cutting moves instead of at rest (1722)
    tool_change_s: from the stopped spindle to the tool in it
    spindle_acceleration_rpm_s: ramp of the spindle; spindle_deceleration_rpm_s: None = the same
    spindle_base_rpm: above it power is constant instead of torque, and the ramp falls off with 1 / speed
    rapid_waits_for_spindle: the blocks after an M3 begin when the spindle has its speed, rapids too
    """

    rapid_mm_min: PerAxis
    acceleration_mm_s2: PerAxis
    rapid_acceleration_mm_s2: PerAxis | None = None
    jerk_mm_s3: PerAxis = np.inf
    rapid_jerk_mm_s3: PerAxis | None = None
    corner_speed_difference_mm_min: PerAxis = np.inf
    corner_deviation_mm: float = np.inf
    centripetal_mm_s2: float | None = None
    block_time_s: float = 0.0
    in_position_s: float = 0.0
    rapid_overlap: bool = False
    tool_change_s: float = 0.0
    spindle_acceleration_rpm_s: float = np.inf
    spindle_deceleration_rpm_s: float | None = None
    spindle_base_rpm: float = np.inf
    rapid_waits_for_spindle: bool = False

    @classmethod
    def of(cls, program: Program) -> Self:
        """The limits of [program] in machine.toml. A corner_speed_difference_mm_min of 0 there is no limit, as on a control."""
        return cls(
            rapid_mm_min=program.rapid_mm_min,
            acceleration_mm_s2=program.acceleration_mm_s2,
            jerk_mm_s3=program.jerk_mm_s3 or np.inf,
            corner_speed_difference_mm_min=program.corner_speed_difference_mm_min or np.inf,
            block_time_s=program.block_time_s,
            tool_change_s=program.tool_change_s,
            spindle_acceleration_rpm_s=program.spindle_acceleration_rpm_s or np.inf,
            rapid_acceleration_mm_s2=program.rapid_acceleration_mm_s2,
            centripetal_mm_s2=program.centripetal_mm_s2,
            corner_deviation_mm=program.corner_deviation_mm or np.inf,
            in_position_s=program.in_position_s,
            spindle_deceleration_rpm_s=program.spindle_deceleration_rpm_s,
            spindle_base_rpm=program.spindle_base_rpm or np.inf,
            rapid_waits_for_spindle=program.rapid_waits_for_spindle,
            rapid_overlap=program.rapid_overlap,
        )

    def with_(self, **changes: float | tuple[float, ...] | bool | None) -> Self:
        """These limits with some of them changed."""
        return replace(self, **changes)  # type: ignore[arg-type]


class Bounds(NamedTuple):
    """The bounds that the limits set on one path, whatever its feed. mm and s.

    speed_mm_s, acceleration_mm_s2, jerk_mm_s3: (n,) along each segment
    junction_mm_s: (n + 1,) at the start of each segment and at the end of the last
    """

    speed_mm_s: Floats
    acceleration_mm_s2: Floats
    jerk_mm_s3: Floats
    junction_mm_s: Floats


def bounds(path: Path, limits: Limits) -> Bounds:
    """The bounds of `path` under `limits`. Raises MachineError where the limits have another number of axes."""
    rapid = path.kind == Kind.RAPID
    starting = path.tangents(np.arange(len(path)), np.zeros(len(path)))
    reach = _axis_share(path, starting)
    in_rapid = limits.rapid_acceleration_mm_s2 if limits.rapid_acceleration_mm_s2 is not None else limits.acceleration_mm_s2
    rapid_jerk = limits.rapid_jerk_mm_s3 if limits.rapid_jerk_mm_s3 is not None else limits.jerk_mm_s3

    def slowest(feed: PerAxis, fast: PerAxis) -> Floats:
        """The tightest axis of each segment: limit over its share of the motion."""
        each = np.where(rapid[:, None], _each_axis(fast, path), _each_axis(feed, path))
        return np.asarray(np.min(np.where(reach > 1e-12, each / np.maximum(reach, 1e-12), np.inf), axis=1), dtype=np.float64)

    acceleration = np.minimum(slowest(limits.acceleration_mm_s2, in_rapid), ACCELERATION_MAX_MM_S2)
    speed = slowest(np.inf, limits.rapid_mm_min) / 60.0
    curvature = path.curvature_per_mm()
    curved = curvature > 0.0
    speed[curved] = np.minimum(speed[curved], np.sqrt(_centripetal(path, limits)[curved] / curvature[curved]))
    if limits.block_time_s > 0.0:
        speed = np.where(rapid, speed, np.minimum(speed, path.length_mm / limits.block_time_s))
    jerk = slowest(limits.jerk_mm_s3, rapid_jerk)
    jerk[~path.jerk_limited] = np.inf
    return Bounds(speed, acceleration, jerk, _junctions(path, limits, acceleration, starting))


def _each_axis(value: PerAxis, path: Path) -> Floats:
    if isinstance(value, tuple):
        if len(value) != len(path.axes):
            raise MachineError(f"limits {value} are for {len(value)} axes, the path has {len(path.axes)}: {', '.join(path.axes)}")
        return np.array(value, dtype=np.float64)
    return np.full(len(path.axes), float(value))


def _axis_share(path: Path, starting: Floats) -> Floats:
    """The largest |dp_i/ds| of each axis on each segment (n, axes), of the tangents where they start."""
    share = np.abs(starting)
    arcs = np.flatnonzero(path.kind == Kind.ARC)
    u, v = path.plane_axes[arcs].T
    share[arcs, u] = share[arcs, v] = np.hypot(share[arcs, u], share[arcs, v])
    return share


def _centripetal(path: Path, limits: Limits) -> Floats:
    """The acceleration across each arc."""
    if limits.centripetal_mm_s2 is not None:
        return np.full(len(path), limits.centripetal_mm_s2)
    each = _each_axis(limits.acceleration_mm_s2, path)
    allowed = np.full(len(path), np.inf)
    arcs = np.flatnonzero(path.kind == Kind.ARC)
    allowed[arcs] = np.min(each[path.plane_axes[arcs]], axis=1)
    return allowed


def stops(event: Event) -> bool:
    """Return True where the axes stand still for this event. Coolant is switched in passing."""
    return event.kind != EventKind.COOLANT


def _junctions(path: Path, limits: Limits, acceleration: Floats, starting: Floats) -> Floats:
    n = len(path)
    junction = np.zeros(n + 1)
    if n == 0:
        return junction
    rapid = path.kind == Kind.RAPID
    before, after = path.tangents(np.arange(n), path.length_mm)[:-1], starting[1:]
    jump = np.abs(after - before)
    allowed = _each_axis(limits.corner_speed_difference_mm_min, path) / 60.0
    junction[1:-1] = np.min(np.where(jump > 1e-9, allowed / np.maximum(jump, 1e-9), np.inf), axis=1)
    slower = np.minimum(acceleration[:-1], acceleration[1:])
    if np.isfinite(limits.corner_deviation_mm):
        junction[1:-1] = np.minimum(junction[1:-1], _by_deviation(before, after, limits.corner_deviation_mm, slower))
    # At the corner where a tolerance begins or ends, the tighter of the two holds, or the one that there is.
    stated = np.fmin(path.tolerance_mm[:-1], path.tolerance_mm[1:])
    if not np.isnan(stated).all():
        junction[1:-1] = np.where(np.isnan(stated), junction[1:-1], _by_deviation(before, after, stated, slower))
    at_rest = path.exact_stop[:-1] | (rapid[:-1] ^ rapid[1:])
    if not limits.rapid_overlap:
        at_rest |= rapid[:-1] | rapid[1:]
    junction[1:-1][at_rest] = 0.0
    for event in path.events:
        if stops(event):
            junction[event.segment] = 0.0
    return junction


def _by_deviation(before: Floats, after: Floats, tolerance_mm: Floats | float, acceleration: Floats) -> Floats:
    """Speed (n − 1,) of the circle that leaves a corner by no more than the tolerance: cos γ = −t⁻·t⁺."""
    cosine = np.clip(-np.sum(before * after, axis=1), -1.0, 1.0)
    half = np.sqrt(0.5 * (1.0 - cosine))
    straight = half > 1.0 - 1e-12
    return np.where(straight, np.inf, np.sqrt(acceleration * tolerance_mm * half / np.where(straight, 1.0, 1.0 - half)))
