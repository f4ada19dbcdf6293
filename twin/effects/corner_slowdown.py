"""The control slows down where the direction changes, and takes a way to be at speed again.

a = min(a_stated, a),  Δv_axis = min(Δv_stated, Δv),  a_across = min(a_stated, ratio · a) on arcs,  wait at each halt + t

A corner is passed at v ≤ min over the axes of Δv / |t⁺ − t⁻|; blocks shorter than v² / a never reach their feed; an arc of radius
r is travelled at v ≤ √(ratio · a · r).
"""

from math import inf

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def feed_acceleration_mm_s2(stated_mm_s2: float, acceleration_mm_s2: float) -> float:
    """Return the acceleration of the axes in cutting feed: the lower one."""
    return min(stated_mm_s2, acceleration_mm_s2)


def rapid_acceleration_mm_s2(stated_mm_s2: float, rapid_mm_s2: float) -> float:
    """Return the acceleration of the axes in rapid: the lower one."""
    return min(stated_mm_s2, rapid_mm_s2)


def across_acceleration_mm_s2(stated_mm_s2: float, acceleration_mm_s2: float, across_ratio: float) -> float:
    """On arcs: in proportion to that of cutting feed."""
    return min(stated_mm_s2, across_ratio * acceleration_mm_s2)


def corner_speed_difference_mm_min(stated_mm_min: float, corner_mm_min: float) -> float:
    """Return the difference that each axis may make at a corner: the lower one."""
    return min(stated_mm_min, corner_mm_min)


def in_position_s(stated_s: float, settle_s: float) -> float:
    """At every halt, on top of what is stated."""
    return stated_s + settle_s


EFFECT = Effect(
    name="corner_slowdown",
    says="the control slows down at corners",
    site=Site.PROGRAM,
    on=On.MACHINE,
    parameters=(
        Parameter("acceleration_mm_s2", "mm/s²", inf, 5.0, 1e6, 300.0, "of each axis in cutting feed"),
        Parameter("rapid_mm_s2", "mm/s²", inf, 5.0, 1e6, 1000.0, "acceleration of each axis in rapid"),
        Parameter("corner_mm_min", "mm/min", inf, 1.0, 1e6, 200.0, "permissible jump of the speed of an axis at a corner"),
        Parameter("settle_s", "s", 0.0, 0.0, 2.0, 0.05, "wait at every halt until the axes are in position"),
        Parameter("across_ratio", "", None, 0.1, 10.0, 1.0, "acceleration across an arc over that along it"),
    ),
    changes={
        "feed_acceleration_mm_s2": feed_acceleration_mm_s2,
        "rapid_acceleration_mm_s2": rapid_acceleration_mm_s2,
        "across_acceleration_mm_s2": across_acceleration_mm_s2,
        "corner_speed_difference_mm_min": corner_speed_difference_mm_min,
        "in_position_s": in_position_s,
    },
    shows_in=("line", "feed_mm_min"),
    equation="a = min(a_stated, a); v ≤ min Δv / |t⁺ − t⁻| at a corner, v² ≤ ratio · a · r on an arc; settle at every halt",
    reference="FANUC 30i, parameters 1660, 1620, 1783, 1735, 1826: acceleration, speed difference, arcs, in-position",
)
