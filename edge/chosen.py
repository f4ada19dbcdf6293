"""The tables [variables] and [plc] of an edge's configuration: what to read by its address on the control, and its name.

    [variables]
    part_width = { address = "#500", unit = "mm" }

    [plc]
    coolant_pressure = { address = "D300:2", unit = "bar", scale = 0.1 }
    door_open = { address = "R100.3", kind = "flag" }

They become the signals `variable_part_width`, `plc_coolant_pressure` and `plc_door_open`. The model is the same for every
control; how an address is written is the control's own, and `Adapter.address` reads it.
"""

from collections.abc import Mapping
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import Field, StringConstraints, model_validator

from edge.errors import ConfigError
from edge.reading import Target
from edge.sample import Offer
from edge.section import Section
from edge.units import between
from twin.vocabulary.signals import CHOSEN_NAME, PLC_PREFIX, VARIABLE_PREFIX, Kind

CHOSEN_MAX = 200  # of each table
ChosenName = Annotated[str, StringConstraints(pattern=rf"^{CHOSEN_NAME}$")]


class VariableSection(Section):
    """A variable of the control: published = native * scale, in `unit`."""

    address: str = Field(min_length=1, max_length=400)
    unit: str = Field(default="", max_length=32)
    scale: float = Field(default=1.0, allow_inf_nan=False)

    @property
    def of_kind(self) -> Kind:
        """A variable is a number."""
        return Kind.NUMBER


class PlcSection(VariableSection):
    """An address of the control's PLC; a flag is on where its bit, byte or word is 1, and has neither unit nor scale."""

    kind: Literal["number", "flag"] = "number"

    @model_validator(mode="after")
    def _flag_has_no_unit(self) -> Self:
        if self.kind == "flag" and (self.unit or self.scale != 1.0):
            raise ValueError("is a flag with a unit or a scale; remove them, or make it a number")
        return self

    @property
    def of_kind(self) -> Kind:
        """The kind that the configuration declares."""
        return Kind.FLAG if self.kind == "flag" else Kind.NUMBER


Variables = Annotated[dict[ChosenName, VariableSection], Field(max_length=CHOSEN_MAX)]
PlcAddresses = Annotated[dict[ChosenName, PlcSection], Field(max_length=CHOSEN_MAX)]


class Chosen(NamedTuple):
    """One signal that is read by its address. `is_plc`: from [plc], else from [variables]."""

    signal: str
    address: str
    unit: str = ""
    scale: float = 1.0
    kind: Kind = Kind.NUMBER
    is_plc: bool = False

    @property
    def table(self) -> str:
        """Return the table of the file, for messages."""
        prefix = PLC_PREFIX if self.is_plc else VARIABLE_PREFIX
        return f"{'plc' if self.is_plc else 'variables'}.{self.signal.removeprefix(prefix)}"

    def target(self, fact: str, native_unit: str = "") -> Target:
        """Return how the value of this fact becomes the signal's; ConfigError where the control states a unit of another kind.

        A scale says that the configuration knows better: then nothing is converted, and nothing refused.

        >>> Chosen("plc_pressure", "D300:2", "bar", 0.1).target("pmc.D300:2").factor
        0.1
        >>> Chosen("plc_pressure", "p", "bar").target("p", "PASCAL").factor
        1e-05
        """
        if self.scale != 1.0 or self.kind is not Kind.NUMBER:
            return Target(fact, self.signal, self.scale, kind=self.kind)
        try:
            way = between(native_unit, self.unit)
        except ConfigError as error:
            why = f"{self.table}.unit = {self.unit!r}: the control says otherwise: {error}; correct it, or add a scale"
            raise ConfigError(why) from None
        return Target(fact, self.signal, way.factor, way.offset, kind=self.kind)

    def offer(self, source: str, native_unit: str = "") -> Offer:
        """Return what the birth certificate says of it."""
        return Offer(self.signal, source, native_unit, unit=self.unit, kind=self.kind)


def chosen_of(variables: Mapping[str, VariableSection], plc: Mapping[str, PlcSection]) -> tuple[Chosen, ...]:
    """Return what both tables ask for, in their order."""
    return (
        *(_chosen(VARIABLE_PREFIX + name, section, is_plc=False) for name, section in variables.items()),
        *(_chosen(PLC_PREFIX + name, section, is_plc=True) for name, section in plc.items()),
    )


def _chosen(signal: str, section: VariableSection, *, is_plc: bool) -> Chosen:
    return Chosen(signal, section.address, section.unit, section.scale, section.of_kind, is_plc)
