"""The physics that a residual model corrects: a correction of one spindle's heat is none of another."""

from collections.abc import Callable
from typing import Any, Self

from pydantic import Field, model_serializer

from twin.anomaly.calibration import Finite, NotNegative, Positive, Record
from twin.effects.added import added_effects
from twin.heat.network import thermal_quantities
from twin.learned.section import LearnedSection
from twin.learned.words import LearnedSite
from twin.live.heat import SIGNAL
from twin.machine import AddedEffect, Machine, MachineFile, Thermal
from twin.sensor.sensing import sensor_quantities

SITES = (LearnedSite.HEAT_INPUT, LearnedSite.HEAT_LOSS, LearnedSite.TEMPERATURE_READING)


class Physics(Record):
    """The heat that is corrected, and the ambient temperature where no signal tells it.

    description: version of the machine's description that it was taken from; effects, learned: those of its heat and its sensor
    """

    alpha_w_per_pct_rpm2: NotNegative = 1.8e-8
    beta_w_per_rpm: NotNegative = 1.2e-3
    resistance_k_per_w: Positive = 0.18
    capacity_j_per_k: Positive = 14_500.0
    ambient_temp_c: Finite | None = Field(default=None)
    description: str = ""
    effects: tuple[AddedEffect, ...] = ()
    learned: tuple[LearnedSection, ...] = ()

    @classmethod
    def of(cls, machine: MachineFile, ambient_temp_c: float | None = None, description: str = "") -> Self:
        """Return the physics of a machine that states its heat."""
        assert machine.thermal is not None, "the heat is stated or assumed"
        acting = {(name, "") for name in added_effects(machine, thermal_quantities())}
        acting |= {(name, SIGNAL) for name in added_effects(machine, sensor_quantities(), SIGNAL)}
        return cls(
            **machine.thermal.model_dump(),
            ambient_temp_c=ambient_temp_c,
            description=description,
            effects=tuple(one for one in machine.effects if (one.effect, one.on) in acting),
            learned=tuple(one for one in machine.learned if one.site in SITES),
        )

    @property
    def time_constant_s(self) -> float:
        """R·C."""
        return self.resistance_k_per_w * self.capacity_j_per_k

    @property
    def machine(self) -> MachineFile:
        """The machine as far as its heat goes."""
        thermal = Thermal(**{name: getattr(self, name) for name in Thermal.model_fields})
        return MachineFile(machine=Machine(name="heat"), thermal=thermal, effects=self.effects, learned=self.learned)

    def is_as(self, other: "Physics") -> bool:
        """Return True where both are the same heat, whatever the ambient is and whichever file they were taken from."""
        return self._alone == other._alone

    @property
    def _alone(self) -> tuple[Any, ...]:
        return (*(getattr(self, name) for name in Thermal.model_fields), self.effects, self.learned)

    @model_serializer(mode="wrap")
    def _without_what_is_not_there(self, dump: Callable[["Physics"], dict[str, Any]]) -> dict[str, Any]:
        """Models that were kept before there were descriptions stay what they are, to the last digit of their version."""
        values = dump(self)
        return {name: value for name, value in values.items() if value or name not in ("description", "effects", "learned")}
