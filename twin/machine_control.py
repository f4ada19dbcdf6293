"""[control] of machine.toml: what the control of the machine makes of a program, beside the program's own text.

The keys are those of `twin.programs.Settings`, which says what they mean; what is left out is as there.
"""

from dataclasses import fields
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from twin.errors import TwinError
from twin.programs import DwellUnit, IntegerWords, LeadIn, OffsetLookup, OutsideCorner, Settings, ToolOffset
from twin.programs.discovery import dialects, named

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Place = tuple[Finite, Finite, Finite]
Number = Annotated[str, Field(pattern=r"^[0-9]{1,4}$")]


class OffsetRow(BaseModel):
    """[control.tool_offsets.N]: what H and D number N name, mm. Geometry and wear add up; `radius` is a radius."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    length_mm: Finite = 0.0
    radius_mm: Finite = 0.0
    length_wear_mm: Finite = 0.0
    radius_wear_mm: Finite = 0.0


class ControlSection(BaseModel):
    """[control]. None and empty = as `Settings` has it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    dialect: str | None = None
    start_mm: Place | None = None
    inch: bool | None = None
    work_offsets_mm: dict[str, Place] = Field(default_factory=dict)
    tool_offsets: dict[Number, OffsetRow] = Field(default_factory=dict)
    references_mm: tuple[Place, ...] = Field(default=(), max_length=4)
    integer_words: IntegerWords | None = None
    dwell_unit: DwellUnit | None = None
    offset_lookup: OffsetLookup | None = None
    outside_corner: OutsideCorner | None = None
    lead_in: LeadIn | None = None
    peck_retract_mm: Positive | None = None
    peck_clearance_mm: Positive | None = None
    bore_shift_deg: Finite | None = None
    scale_unit: Positive | None = None
    angle_signed: bool | None = None
    arc_radius_error_mm_max: Positive | None = None
    block_skip: tuple[Annotated[int, Field(ge=0, le=9)], ...] = ()
    optional_stop: bool | None = None
    variables: dict[Annotated[str, Field(pattern=r"^[0-9]{1,5}$")], Finite] = Field(default_factory=dict)
    parameters: dict[str, Finite] = Field(default_factory=dict)
    tool_numbers: dict[str, Annotated[int, Field(ge=0, le=32_767)]] = Field(default_factory=dict)
    spindle_rpm_max: Positive | None = None
    builder_m_codes: tuple[Annotated[int, Field(ge=0, le=9999)], ...] = ()

    @model_validator(mode="after")
    def _can_be_set(self) -> "ControlSection":
        try:
            languages = [named(self.dialect)] if self.dialect is not None else list(dialects().values())
            for code in self.builder_m_codes:
                if all(code in language.m_codes for language in languages):
                    raise ValueError(f"builder_m_codes has {code}: every control has M{code}, and it is not passed over")
            self.settings()
        except TwinError as error:
            raise ValueError(str(error)) from None
        return self

    def settings(self) -> Settings:
        """The settings of the interpreter.

        >>> section = ControlSection(tool_offsets={"1": OffsetRow(length_mm=100.0)}, builder_m_codes=(13,))
        >>> section.settings().tool_offsets[1].length_mm
        100.0
        """
        given: dict[str, Any] = {
            one.name: value for one in fields(Settings) if (value := getattr(self, one.name, None)) not in (None, (), {})
        }
        given["tool_offsets"] = {int(n): ToolOffset(**row.model_dump()) for n, row in self.tool_offsets.items()}
        given["variables"] = {int(n): value for n, value in self.variables.items()}
        given |= {name: frozenset(given[name]) for name in ("block_skip", "builder_m_codes") if name in given}
        return Settings(**given)
