"""The table [validation]: how far the twin may be off, and how much has to be seen before it is judged."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationError

from cnctwin.errors import UsageError
from processors.config import read_tables, table_faults
from twin.vocabulary.faults import report

TABLE = "validation"


class Budgets(BaseModel):
    """Budgets, and what a figure has to rest on.

    force_floor_n: a percentage is taken of forces above it only; force_cutting_s_min: of windows above it
    hour_share_min: an hour is one of which so much was seen; hours_min: of all
    held_s_max: a value that was not told again for longer is not known any more
    truth_offset_s_max: by how much the clock of a truth file with times since 1970 is searched
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    temperature_mae_k: PositiveFloat = 2.0
    temperature_rmse_k: PositiveFloat = 3.0
    force_mape_pct: PositiveFloat = 20.0
    force_floor_n: PositiveFloat = 20.0
    force_cutting_s_min: PositiveFloat = 10.0
    vibration_r: float = Field(default=0.85, gt=0.0, lt=1.0)
    vibration_s_min: PositiveFloat = 60.0
    following_error_pct: PositiveFloat = 2.0
    cycle_time_pct: PositiveFloat = 5.0
    hours_min: PositiveFloat = 1.0
    hour_share_min: float = Field(default=0.5, gt=0.0, le=1.0)
    held_s_max: PositiveFloat = 600.0
    truth_offset_s_max: PositiveFloat = 60.0


def tables_of(config: Path | None) -> dict[str, dict[str, Any]]:
    """The tables of a configuration file; none where none is given. Raises ConfigurationError."""
    return {} if config is None else read_tables(config)


def budgets_of(table: dict[str, Any], source: str) -> Budgets:
    """The budgets in a table. Raises UsageError naming key and value."""
    try:
        return Budgets.model_validate(table)
    except ValidationError as error:
        raise UsageError(report(source, table_faults(Budgets, error, TABLE), "docs/how-to/validation.md")) from None
