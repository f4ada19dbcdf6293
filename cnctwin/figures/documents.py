"""The records of `production`, checked as they come from a store or a broker: what does not have its shape is left out."""

from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

from processors.wall_clock import zone

TEXT_MAX = 200
Text = Annotated[str, Field(max_length=TEXT_MAX)]
Seconds = Annotated[float, Field(ge=0.0, le=1e12)]
Count = Annotated[int, Field(ge=0, le=10**9)]
Moment = Annotated[int, Field(ge=0, le=250_000_000_000_000)]


def _zone_or_none(name: object) -> object:
    """Return the name of a time zone, or None where there is none of this name: times are then shown in UTC."""
    try:
        zone(str(name))
    except (ValueError, LookupError, OSError):
        return None
    return name


KnownZone = Annotated[Text | None, BeforeValidator(_zone_or_none)]


class _Record(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class StopTold(_Record):
    """The stops for one reason: the time element, seconds, count."""

    kind: Text
    s: Seconds
    n: Count


class ShiftTold(_Record):
    """A shift, over or so far (processors/production/record.py)."""

    kind: Literal["shift"]
    id: Text
    machine: Text
    shift: Text | None
    begin: Moment
    end: Moment
    time_zone: KnownZone = None
    over: bool
    calendar: bool
    planned_s: Seconds
    production_s: Seconds
    setup_s: Seconds
    delay_s: Seconds
    down_s: Seconds
    unknown_s: Seconds
    beside_s: Seconds
    stops: dict[Text, StopTold] = Field(max_length=100)
    energy_kwh: float | None
    energy_s: Seconds


class PartTold(_Record):
    """A part that has ended."""

    kind: Literal["part"]
    id: Text
    machine: Text
    program: Text | None
    shift: Text | None
    shift_begin: Moment
    begin: Moment
    end: Moment
    complete: bool
    ideal_s: Seconds | None
    active_s: Seconds
    interrupted_s: Seconds
    unknown_s: Seconds
    energy_kwh: float | None
    quality: Literal["good", "scrap"] | None


Told = ShiftTold | PartTold
_ADAPTER: TypeAdapter[Told] = TypeAdapter(Annotated[Told, Field(discriminator="kind")])


def read_records(texts: Iterable[str]) -> tuple[list[ShiftTold], list[PartTold], int]:
    """Return shifts and parts by time, and how many texts were none. Of several with one id the last holds."""
    found: dict[str, Told] = {}
    refused = 0
    for text in texts:
        try:
            record = _ADAPTER.validate_json(text)
        except ValidationError:
            refused += 1
        else:
            found[record.id] = record
    shifts = [one for one in found.values() if isinstance(one, ShiftTold)]
    parts = [one for one in found.values() if isinstance(one, PartTold)]
    return (
        sorted(shifts, key=lambda one: (one.machine, one.begin)),
        sorted(parts, key=lambda one: (one.machine, one.end)),
        refused,
    )
