"""Learned terms of the cut: a specific cutting force on top of K_t, or a force on the tool in one direction.

The force is linear in K_t (formats, section 4, and with every effect of the catalogue), F = A K_t + B, so what a specific force
adds is A times it, tick by tick, and A K_t is the difference that twice the K_t makes:

    F' = F(K_t) + (k / K_t) (F(2 K_t) − F(K_t))

A force in one direction is there while a tooth can cut.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.process.milling import Milling, MillingForce, milling_force

Floats = NDArray[np.float64]
COEFFICIENT = "tangential_coefficient_n_per_mm2"
KNOWN = ("chip_mm", "axial_depth_mm")
"""Arguments that a cut tells whatever its speed, place and time."""
ANGLES_BY_TOOTH = 48
FORCES = ("force_x_n", "force_y_n", "mean_force_x_n", "mean_force_y_n", "mean_tangential_n")


def cut_arguments(milling: Milling, teeth: int) -> dict[str, Floats]:
    """Return the arguments that a cut tells, as its signals are shaped; its chip is the mean of the teeth that cut at the tick.

    One tooth of a slot in the middle of its arc, at 0.1 mm a tooth:

    >>> milling = Milling(*[np.array([v]) for v in (np.pi / 2, 600.0, 1.0, 0.0, 1.0, 0.0, np.pi)])
    >>> round(float(cut_arguments(milling, 1)["chip_mm"][0]), 9)
    0.1
    """
    rpm = np.nan_to_num(milling.spindle_rpm)
    speed = np.hypot(milling.velocity_x_mm_s, milling.velocity_y_mm_s)
    advance = np.where(rpm > 0.0, 60.0 * speed / (teeth * np.maximum(rpm, 1e-9)), 0.0)
    heading = np.arctan2(milling.velocity_y_mm_s, milling.velocity_x_mm_s)
    entry, leaving = np.nan_to_num(milling.entry_angle_rad), np.nan_to_num(milling.exit_angle_rad)
    thickness, engaged = np.zeros(rpm.shape), np.zeros(rpm.shape)
    for tooth in range(teeth):
        angle = milling.spindle_angle_rad + 2.0 * np.pi * tooth / teeth - heading
        cuts = (np.mod(angle - entry, 2.0 * np.pi) <= leaving - entry) & is_cutting(milling)
        thickness += np.where(cuts, advance * np.sin(angle), 0.0)
        engaged += cuts
    return {
        "chip_mm": thickness / np.maximum(engaged, 1.0),
        "axial_depth_mm": np.nan_to_num(milling.axial_depth_mm),
        "spindle_angle_rad": milling.spindle_angle_rad,
        "spindle_rpm": rpm,
    }


def is_cutting(milling: Milling) -> NDArray[np.bool_]:
    """Return True at the ticks at which a tooth can cut, as its signals are shaped."""
    return np.asarray((np.nan_to_num(milling.axial_depth_mm) > 0.0) & (np.nan_to_num(milling.spindle_rpm) > 0.0))


def cut_series(terms: Sequence[Term], arguments: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return what the terms of the cut add: direction x or y, or empty for a specific force → (ticks,)."""
    series: dict[str, Floats] = {}
    for term in terms:
        if term.site is LearnedSite.CUT_FORCE:
            direction = direction_of(term.on)
            own = term.at(arguments)
            series[direction] = series[direction] + own if direction in series else own
    return series


def direction_of(on: str) -> str:
    """Return the direction of a force that is put on an axis or on the signal that shows it.

    >>> direction_of("force_x_n"), direction_of("y"), direction_of("")
    ('x', 'y', '')
    """
    return on.removeprefix("force_").removesuffix("_n")


def milling_with_terms(
    constants: Mapping[str, ArrayLike], teeth: int, motion: Milling, series: Mapping[str, Floats], **options: Any
) -> MillingForce:
    """Return `milling_force` with learned terms in it.

    series: direction x or y → N, and empty → N/mm² on top of K_t, each (ticks,) or (lanes, ticks)
    options: as `milling_force` takes them
    """
    force = milling_force(constants, teeth, motion, **options)
    if "" in series:
        coefficient = np.atleast_1d(np.asarray(constants[COEFFICIENT], dtype=np.float64))
        steeper = milling_force({**constants, COEFFICIENT: 2.0 * coefficient}, teeth, motion, **options)
        part = np.atleast_2d(series[""]) / coefficient[:, None]
        force = replace(
            force, **{name: getattr(force, name) + part * (getattr(steeper, name) - getattr(force, name)) for name in FORCES}
        )
    for direction in series.keys() & {"x", "y"}:
        push = np.where(is_cutting(motion), np.atleast_2d(series[direction]), 0.0)
        force = replace(
            force, **{name: getattr(force, name) + push for name in (f"force_{direction}_n", f"mean_force_{direction}_n")}
        )
    return force


def sampled_forces(
    terms: Sequence[Term],
    cuts: Floats,
    advance_mm: Floats,
    teeth: int,
    constants: Mapping[str, ArrayLike],
    effects: tuple[str, ...],
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Return greatest resultant and mean tangential force over a turn, (cuts,) each, with terms of the cut and without them.

    cuts: depth, entry and exit, (3, cuts); advance_mm: in a tooth period, (cuts,); terms: over `KNOWN` alone
    """
    angles = ANGLES_BY_TOOTH * teeth
    shape = (cuts.shape[1], angles)
    turn = np.broadcast_to(2.0 * np.pi * np.arange(angles) / angles, shape)
    depth, entry, leaving, advance = (np.broadcast_to(row[:, None], shape) for row in (*cuts, advance_mm))
    # a turn a second, so that the speed is what is cut in one
    motion = Milling(turn, np.full(shape, 60.0), advance * teeth, np.zeros(shape), depth, entry, leaving)
    series = cut_series(terms, cut_arguments(motion, teeth) | {"time_since_start_s": np.zeros(shape)})
    options = {"period_s": 1.0 / angles, "effects": effects}
    with_terms, without = (_sizes(milling_with_terms(constants, teeth, motion, own, **options)) for own in (series, {}))
    return with_terms, without


def _sizes(force: MillingForce) -> tuple[Floats, Floats]:
    return np.hypot(force.force_x_n, force.force_y_n).max(axis=1), force.mean_tangential_n.mean(axis=1)
