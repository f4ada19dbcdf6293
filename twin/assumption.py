"""`[assumed]` of machine.toml: constants that are typical of machines of a class, until recordings tell them.

    "axes.x.mass_kg" = { range = [250.0, 900.0], source = "engineering estimate: table, workpiece and rotor" }

The range holds such machines with 95 %, so a fit begins with σ = ln(highest / lowest) / 4 of the constant's logarithm. A path may
also name a section, without a range. Whatever stands here is assumed as if `assumed` of [machine] named it.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

SIGMAS = 4.0
"""Standard deviations in a range that holds 95 %."""
DIGITS = 4


class Assumption(BaseModel):
    """One entry: the lowest and highest value that machines of the class have, and where these come from."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    range: (
        tuple[Annotated[float, Field(ge=0, allow_inf_nan=False)], Annotated[float, Field(gt=0, allow_inf_nan=False)]] | None
    ) = None
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _lowest_is_below_highest(self) -> Self:
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range {list(self.range)} has its lowest at or above its highest")
        return self

    @property
    def deviation(self) -> float | None:
        """One standard deviation, relative, that the range is worth; None without a range.

        >>> Assumption(range=(250.0, 900.0), source="estimate").deviation
        0.3202
        """
        return None if self.range is None else deviation_of(*self.range)


def deviation_of(low: float, high: float) -> float:
    """Return the relative standard deviation of a range; one that begins at 0 is as wide as its middle.

    >>> deviation_of(0.8, 0.9), deviation_of(0.0, 0.5)
    (0.02945, 0.5)
    """
    sigma = math.log(high / low) / SIGMAS if low > 0.0 else 2.0 / SIGMAS
    return float(f"{sigma:.{DIGITS}g}")


def with_assumptions(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the tables of a file with what [assumed] says in the places that everything reads: paths in `assumed` of
    [machine], and standard deviations in [uncertainty] where it names none."""
    given, machine = tables.get("assumed"), tables.get("machine")
    if not isinstance(given, Mapping) or not isinstance(machine, Mapping) or not given:
        return tables
    named = tuple(machine.get("assumed", ()))
    deviations = {path: sigma for path, entry in given.items() if (sigma := _deviation(entry)) is not None}
    stated = tables.get("uncertainty", {"relative": 0.05})
    return {
        **tables,
        "machine": {**machine, "assumed": [*named, *(path for path in given if path not in named)]},
        "uncertainty": deviations | dict(stated) if isinstance(stated, Mapping) else stated,
    }


def without_assumptions(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a machine as a file has them: what [assumed] says stands there only."""
    given = tables.get("assumed", {})
    machine = {**tables["machine"], "assumed": [path for path in tables["machine"].get("assumed", ()) if path not in given]}
    stated = {
        path: sigma
        for path, sigma in tables.get("uncertainty", {}).items()
        if path not in given or sigma != _deviation(given[path])
    }
    return {**tables, "machine": machine, "uncertainty": stated}


def checked(given: Mapping[str, Assumption], sections: Mapping[str, Any]) -> None:
    """Raise ValueError where an entry names nothing in the file, has a range but no number, or a number outside its range."""
    for path, one in given.items():
        value = value_at(sections, path)
        if value is None:
            raise ValueError(f"{path} is assumed, but the file does not state it")
        numbers = value if isinstance(value, tuple) else (value,)
        if one.range is None:
            continue
        if not all(isinstance(number, int | float) for number in numbers):
            raise ValueError(f"{path} is no number, so it has no range; leave range out")
        low, high = one.range
        for number in numbers:
            if not low * (1.0 - 1e-9) <= number <= high * (1.0 + 1e-9):
                raise ValueError(f"{path} = {number:g} is outside its range {low:g} to {high:g}")


def value_at(sections: Mapping[str, Any], path: str) -> Any:
    """Return what stands at a path, by keys and by the names of fields; None where there is nothing."""
    value: Any = sections
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else getattr(value, key, None)
    return value


def _deviation(entry: Any) -> float | None:
    """Return the deviation of an entry as the file has it, which may have anything in it."""
    try:
        return Assumption.model_validate(entry).deviation
    except ValueError:
        return None
