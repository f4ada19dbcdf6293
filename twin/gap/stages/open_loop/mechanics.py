"""The mechanics of an axis alone: the measured torque pushes the twin's axis, and an observer keeps it on the measured position.

    torque = measured + K (ω/2 · (pos − pos_twin) + v − v_twin),    K k / M = 2 ω

with k newton for each unit of the torque, so that the twin follows the measured motion with two poles at −ω. What the observer
has to add is the force that the twin lacks, in units of the torque, seen through ω² / (s + ω)²; it is 0 where the mechanics are
right. No controller needs to be known. K comes from the mass that the machine states, so the observer is the same instrument for
all candidates.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect, called
from twin.gap.stages.axis import AxisStage, at_rest
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.free import Free
from twin.gap.stages.observed_through import Sensing
from twin.gap.stages.open_loop.lanes import Driven, run_lanes
from twin.gap.stages.open_loop.loop import added_at, over_stretches
from twin.gap.stages.smoothed import filled, low_passed, sample_period_s, velocity_of
from twin.gap.stages.stage import Model
from twin.learned.words import LearnedSite
from twin.servo.kernel import axis_quantities
from twin.sites import Site

Floats = NDArray[np.float64]
BANDWIDTH_HZ = 15.0
"""Bandwidth of the observer, Hz; in slower recordings a part of their rate."""
OF_RATE = 0.04
VELOCITY_OVER, ANSWER_OVER = 6.0, 2.0
"""Cutoffs of the measured velocity and of the observer's torque, over its bandwidth."""
NO_LIMIT_A = 1e9
STANDS_S = 0.02
"""Time over which the start of a stretch is averaged, where it stands."""
PARTS = {Site.DRIVE_FORCE.name, Site.FRICTION.name, Site.MECHANICS.name}


@dataclass(frozen=True, slots=True)
class Mechanics:
    """Measured torque in, motion out."""

    name: str = "mechanics"
    driven_by: tuple[str, ...] = ("pos_mm", "torque_a")
    compared: str = "torque_a"
    healthy_rms: float = 2.0  # an observer sees how an axis comes to rest and breaks away far below the floor of the torque
    sites: tuple[LearnedSite, ...] = (LearnedSite.AXIS_FORCE, LearnedSite.FRICTION)

    def acts(self, effect: Effect) -> bool:
        """Return True where it changes a force, friction or the mass."""
        known = axis_quantities()
        return any(known.get(quantity) in PARTS and quantity != "table_mm" for quantity in effect.changes)

    def sensors(self, effect: Effect) -> tuple[str, ...]:
        """The torque, where its sensor shifts it; one that scales it is the newton for each unit of the torque."""
        shifts = effect.undo is not None and called(effect.undo, effect.typical_values(), 0.0) != 0.0
        return ("torque_a",) if shifts else ()

    def constants(self, free: tuple[Free, ...]) -> tuple[Free, ...]:
        """All of them."""
        return free

    def recorded(self, data: AxisRunData) -> Floats:
        """No correction, where position and torque were measured."""
        known = np.isfinite(data.measured["pos_mm"]) & np.isfinite(data.measured["torque_a"])
        return over_stretches(data, np.where(known, 0.0, np.nan))

    def timing(self, axis: AxisStage, data: AxisRunData) -> Floats:
        """Nothing that counts."""
        return over_stretches(data, np.zeros(len(data.t_s)))

    def answer(self, axis: AxisStage, model: Model, theta: Floats, data: AxisRunData) -> Floats:
        """The torque of the observer, (lanes, n), in units of the torque command."""
        letter, period_s = axis.letter, data.period_s
        hz = min(BANDWIDTH_HZ, OF_RATE / sample_period_s(data.measured["pos_mm"], period_s))
        constants, base = axis.lane_constants(model, theta), axis.axis
        force_n = base.newton_per_command
        gain = 2.0 * (2.0 * np.pi * hz) * base.mass_kg / 1000.0 / force_n
        own = {
            "position_gain_per_s": np.pi * hz,
            "velocity_gain_a_s_per_mm": gain,
            "velocity_integral_gain_a_per_mm": 0.0,
            "torque_limit_a": NO_LIMIT_A,
        }
        constants |= {name: np.full(len(theta), value) for name, value in own.items()}
        position = filled(data.measured["pos_mm"])
        velocity = velocity_of(position, period_s, VELOCITY_OVER * hz)
        torque = Sensing.of(model.values(theta), f"{letter}_torque_a").undone(filled(data.measured["torque_a"]))
        parts: list[Floats] = []
        carried: dict[str, Floats] = {}
        for stretch in data.stretches():
            pushed = np.broadcast_to(torque[:, stretch], (len(torque), len(data.t_s[stretch])))
            added = {"velocity_command_mm_s": velocity[stretch], "torque_command_a": pushed}
            added |= added_at(self.sites, model, theta, axis, data, stretch)
            force = None if data.disturbance_n is None else data.disturbance_n[stretch]
            start = self._start(constants, position[stretch], velocity[stretch], pushed, data, stretch) | carried
            driven = Driven(position[stretch], force, added=added)
            shown, state = run_lanes(constants, driven, start, "torque_a", period_s, stretch.start)
            parts.append(low_passed(shown - pushed, period_s, ANSWER_OVER * hz))
            carried = {name: value for name, value in state.items() if name in axis.carried_states}
        return np.concatenate(parts, axis=1)

    def _start(
        self,
        constants: Mapping[str, Floats],
        position: Floats,
        velocity: Floats,
        torque: Floats,
        data: AxisRunData,
        stretch: slice,
    ) -> dict[str, Floats]:
        """The state at the start of a stretch: as measured, at rest where the reference stands."""
        lanes = len(constants["mass_kg"])
        few = max(1, round(STANDS_S / data.period_s))
        stands = bool(np.ptp(data.reference_mm[stretch][:few]) == 0.0)
        held = constants["newton_per_command"] * torque[:, :few].mean(axis=1) - at_rest("load_n", constants, {}, lanes)
        held = np.clip(held, -constants["static_minus_n"], constants["static_plus_n"])
        bent = at_rest("bristle_mm", constants, {"held_n": held}, lanes)
        return {
            "position_mm": np.full(lanes, position[:few].mean() if stands else position[0]),
            "velocity_mm_s": np.full(lanes, 0.0 if stands else velocity[0]),
            "bristle_mm": bent,
        }
