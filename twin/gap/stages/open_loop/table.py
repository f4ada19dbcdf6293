"""The table of an axis alone: measured motor position and torque in, table position out, compared as table minus motor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect, On
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.axis_terms import readings_of_terms
from twin.gap.stages.free import Free
from twin.gap.stages.observed_through import Sensing
from twin.gap.stages.open_loop.lanes import Driven, run_lanes
from twin.gap.stages.open_loop.loop import added_at, over_stretches
from twin.gap.stages.smoothed import filled, velocity_of
from twin.gap.stages.stage import Model
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
VELOCITY_HZ = 40.0
"""Cutoff of the measured velocity, whose changes tell the force that moves the mass."""


@dataclass(frozen=True, slots=True)
class Table:
    """Measured motor side in, table side out."""

    driven_by: tuple[str, ...]
    name: str = "table"
    compared: str = "table_mm"
    healthy_rms: float = 1.3
    sites: tuple[LearnedSite, ...] = (LearnedSite.TABLE_POSITION, LearnedSite.TABLE_READING)

    def acts(self, effect: Effect) -> bool:
        """Return True where it moves the table beside the motor; by the force in between, where the torque was measured."""
        if effect.on is On.AXIS and "reading" in effect.changes:
            return True
        change = effect.changes.get("table_mm")
        needs = () if change is None else change.__code__.co_varnames[: change.__code__.co_argcount]
        return change is not None and ("torque_a" in self.driven_by or "drive_force_n" not in needs)

    def sensors(self, effect: Effect) -> tuple[str, ...]:
        """The table's scale."""
        return ("table_mm",)

    def constants(self, free: tuple[Free, ...]) -> tuple[Free, ...]:
        """None."""
        return ()

    def recorded(self, data: AxisRunData) -> Floats:
        """Table minus motor."""
        return over_stretches(data, data.measured["table_mm"] - data.measured["pos_mm"])

    def timing(self, axis: AxisStage, data: AxisRunData) -> Floats:
        """Nothing that counts."""
        return over_stretches(data, np.zeros(len(data.t_s)))

    def answer(self, axis: AxisStage, model: Model, theta: Floats, data: AxisRunData) -> Floats:
        """Table minus motor, (lanes, n)."""
        constants = axis.lane_constants(model, theta)
        values = model.values(theta)
        position = filled(data.measured["pos_mm"])
        velocity = velocity_of(position, data.period_s, VELOCITY_HZ)
        torque = filled(data.measured["torque_a"]) if "torque_a" in data.measured else np.zeros(len(position))
        parts: list[Floats] = []
        carried: dict[str, Floats] = {}
        for stretch in data.stretches():
            seen = {"position_mm": position[stretch], "velocity_mm_s": velocity[stretch], "torque_a": torque[stretch]}
            drive_force_n = constants["newton_per_command"] * torque[stretch][0]
            start = {
                "position_mm": np.full(len(theta), position[stretch][0]),
                "velocity_mm_s": np.full(len(theta), velocity[stretch][0]),
                "drive_force_n": drive_force_n,
                "force_n": drive_force_n,
            }
            added = added_at(self.sites, model, theta, axis, data, stretch)
            driven = Driven(data.reference_mm[stretch], None, recorded=seen, added=added)
            shown, state = run_lanes(constants, driven, start | carried, "table_mm", data.period_s, stretch.start)
            parts.append(shown)
            carried = {name: value for name, value in state.items() if name in axis.carried_states}
        signal = f"{axis.letter}_table_mm"
        shown = Sensing.of(values, signal).readings(np.concatenate(parts, axis=1), data.period_s)
        shown = shown + readings_of_terms(model, theta, signal, data, axis.terms)
        return axis.grown(shown, values, data) - over_stretches(data, position)
