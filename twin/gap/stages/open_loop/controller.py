"""The controller of an axis alone: measured reference and position in, torque command out.

Position and velocity of the loop are the measured ones, smoothed to a stated bandwidth; the torque is compared through the same
filter on both sides, and so is what the sensor of the torque does to it. What the integral had stored at the start of a stretch,
and how it creeps on an error below the resolution of the scale, is not known: a line over each stretch is left out of the
comparison.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.axis_terms import readings_of_terms
from twin.gap.stages.free import Free
from twin.gap.stages.observed_through import Sensing
from twin.gap.stages.open_loop.lanes import Driven, run_lanes
from twin.gap.stages.open_loop.loop import added_at
from twin.gap.stages.smoothed import filled, low_passed, velocity_of
from twin.gap.stages.stage import Model
from twin.learned.words import LearnedSite
from twin.servo.kernel import axis_quantities
from twin.simulator.recorded import start_state
from twin.sites import Site

Floats = NDArray[np.float64]
BANDWIDTH_HZ, VELOCITY_OVER = 40.0, 6.0
"""Bandwidth of the comparison, Hz; cutoff of the measured velocity over it, so that it is smoothed by the comparison alone."""
TIMING = 0.05
"""Part of a sample period to which it is known when, within it, the loops looked at the velocity."""
PARTS = {Site.REFERENCE.name, Site.CONTROLLER.name}


@dataclass(frozen=True, slots=True)
class Controller:
    """Measured reference and position in, torque out."""

    name: str = "controller"
    driven_by: tuple[str, ...] = ("ref_mm", "pos_mm")
    compared: str = "torque_a"
    healthy_rms: float = 1.3
    sites: tuple[LearnedSite, ...] = (LearnedSite.CONTROLLER, LearnedSite.TORQUE_READING)

    def acts(self, effect: Effect) -> bool:
        """Return True where it changes the loops, or makes their reference late."""
        known = axis_quantities()
        late = effect.site is Site.REFERENCE and effect.late_s is not None
        return late or any(known.get(quantity) in PARTS for quantity in effect.changes)

    def sensors(self, effect: Effect) -> tuple[str, ...]:
        """The torque."""
        return ("torque_a",)

    def constants(self, free: tuple[Free, ...]) -> tuple[Free, ...]:
        """None: gains are exact."""
        return ()

    def recorded(self, data: AxisRunData) -> Floats:
        """The torque within the bandwidth, about a line over each stretch."""
        known = np.isfinite(data.of_loops(data.measured["pos_mm"])) & np.isfinite(data.measured["torque_a"])
        smooth = low_passed(filled(data.measured["torque_a"]), data.period_s, BANDWIDTH_HZ)
        smooth = np.where(known, smooth, np.nan)
        return np.concatenate([_about_line(smooth[s][None, :], known[s])[0] for s in data.stretches()])

    def timing(self, axis: AxisStage, data: AxisRunData) -> Floats:
        """The torque by which the velocity, a little older, is answered otherwise: (K_v a + K_i Δv) · delay."""
        delay_s, parts = TIMING * data.period_s, []
        velocity = velocity_of(filled(data.measured["pos_mm"]), data.period_s, BANDWIDTH_HZ)
        acceleration = np.gradient(velocity, data.period_s)
        for stretch in data.stretches():
            v, a = velocity[stretch], acceleration[stretch]
            torque = axis.axis.velocity_gain_a_s_per_mm * a + axis.axis.velocity_integral_gain_a_per_mm * (v - v[0])
            parts.append(_about_line(delay_s * torque[None, :], np.ones(len(v), dtype=bool))[0])
        return np.concatenate(parts)

    def answer(self, axis: AxisStage, model: Model, theta: Floats, data: AxisRunData) -> Floats:
        """The torque, (lanes, n), as `recorded`."""
        letter, period_s = axis.letter, data.period_s
        constants = axis.lane_constants(model, theta)
        values = model.values(theta)
        position = filled(data.measured["pos_mm"])
        velocity = velocity_of(position, period_s, VELOCITY_OVER * BANDWIDTH_HZ)
        known = np.isfinite(data.of_loops(data.measured["pos_mm"])) & np.isfinite(data.measured["torque_a"])
        torque = filled(data.measured["torque_a"])
        sensing = Sensing.of(values, f"{letter}_torque_a")
        terms = readings_of_terms(model, theta, f"{letter}_torque_a", data, axis.terms)
        whole = np.zeros((len(theta), sum(len(data.t_s[s]) for s in data.stretches())))
        first, carried = 0, dict[str, Floats]()
        for stretch in data.stretches():
            reference = axis.seen_reference(values, data, stretch, len(theta))
            read = start_state(axis.axis, data.reference_mm[stretch], position[stretch], torque[stretch], period_s)
            start = {name: np.full(len(theta), value) for name, value in read.items()} | carried
            added = added_at(self.sites, model, theta, axis, data, stretch)
            seen = {"position_mm": position[stretch], "velocity_mm_s": velocity[stretch]}
            driven = Driven(reference, None, recorded=seen, added=added)
            shown, state = run_lanes(constants, driven, start, "torque_a", period_s, stretch.start)
            whole[:, first : first + shown.shape[1]] = shown
            first += shown.shape[1]
            carried = {name: value for name, value in state.items() if name in axis.carried_states}
        shown = sensing.readings(whole, period_s) + terms
        first, parts = 0, []
        for stretch in data.stretches():
            ticks = len(data.t_s[stretch])
            smooth = low_passed(shown[:, first : first + ticks], period_s, BANDWIDTH_HZ)
            parts.append(_about_line(smooth, known[stretch]))
            first += ticks
        return np.concatenate(parts, axis=1)


def _about_line(values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Return values, (lanes, n), about a line through the samples that are known."""
    if known.sum() < 3:
        return values
    time = np.linspace(-1.0, 1.0, len(known))
    basis = np.stack([np.ones(len(known)), time])
    of_known = np.linalg.pinv(basis[:, known].T)
    return np.asarray(values - (values[:, known] @ of_known.T) @ basis)
