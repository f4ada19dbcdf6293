"""`columns.toml`: how the columns of a recording from elsewhere become those of a run log.

[time]                      # one of: a column with its unit or format, or a steady rate
column = "Time"
unit = "ms"                 # or format = "ISO 8601", or format = "%d.%m.%Y %H:%M:%S.%f"
# period_s = 0.001          # or rate_hz = 1000, where the file has no column of times

[columns.x_pos_mm]          # a column of a run log, or a canonical signal
from = "Axes.X.ActPos"
unit = "inch"               # absent: the unit that the file states, else that of the run log
scale = -1.0                # after the unit: value · scale + offset
offset = 0.0

[columns.coolant_on]
from = "M8"
true = ["ON"]               # the texts that mean true; `false` those that mean false; others are null

[columns.exec_state]
from = "State"
values = { RUN = "ACTIVE", IDLE = "READY" }

[options]                   # only where the file's own look does not tell
separator = ";"
decimal = ","
names_line = 3              # counted from 1; units_line, data_line likewise
encoding = "latin-1"
nulls = ["---", "n/a"]
"""

import math
import tomllib
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from cnctwin.errors import UsageError
from cnctwin.importing.run_columns import run_column, unit_of
from cnctwin.importing.units import conversion, units_for
from twin.vocabulary.faults import faults_of, report

BYTES_MAX = 1024 * 1024
ISO_8601 = "ISO 8601"


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("is no finite number")
    return value


Finite = Annotated[float, AfterValidator(_finite)]


class TimeOptions(_Table):
    """The place of the times: a column, or a steady rate."""

    column: str | None = None
    unit: str | None = None
    format: str | None = None
    period_s: float | None = Field(default=None, gt=0)
    rate_hz: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.period_s is not None and self.rate_hz is not None:
            raise ValueError("has period_s and rate_hz; give one of them")
        if self.column is not None and self.period is not None:
            raise ValueError("has a column of times and a rate; give one of them")
        if self.unit is not None and self.format is not None:
            raise ValueError("has unit and format; a number has a unit, a text a format")
        if self.unit is not None and conversion(self.unit, "s") is None:
            raise ValueError(f"unit = {self.unit!r} is no unit of time; there are {units_for('s')}")
        return self

    @property
    def period(self) -> float | None:
        """Return the seconds between two rows, where the file has a steady rate."""
        return 1.0 / self.rate_hz if self.rate_hz is not None else self.period_s


class ColumnOptions(_Table):
    """The source of one column, and how it becomes the run log's."""

    source: str = Field(alias="from")
    unit: str | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    true: tuple[str | int | float | bool, ...] = ()
    false: tuple[str | int | float | bool, ...] = ()
    values: dict[str, str | int | float | bool] = Field(default_factory=dict)


class FileOptions(_Table):
    """The look of a text file, where it does not tell itself."""

    separator: str | None = Field(default=None, min_length=1, max_length=1)
    decimal: str | None = Field(default=None, pattern=r"^[.,]$")
    header_lines: int | None = Field(default=None, ge=0, le=10_000)
    names_line: int | None = Field(default=None, ge=0, le=10_000)
    units_line: int | None = Field(default=None, ge=0, le=10_000)
    data_line: int | None = Field(default=None, ge=1, le=10_001)
    encoding: str | None = None
    nulls: tuple[str, ...] = ()


class ColumnMap(_Table):
    """The whole file."""

    time: TimeOptions = TimeOptions()
    columns: dict[str, ColumnOptions] = Field(default_factory=dict)
    options: FileOptions = FileOptions()

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name, options in self.columns.items():
            column = run_column(name)
            if column is None:
                raise ValueError(
                    f"columns.{name} is no column of a run log and no canonical signal; docs/how-to/recording.md lists them"
                )
            into = unit_of(column)
            if options.unit is not None and conversion(options.unit, into) is None:
                there_are = f"there are {units_for(into)}, or give scale and offset" if into else "it takes no unit"
                raise ValueError(f"columns.{name}: unit = {options.unit!r} does not become its unit; {there_are}")
        targets = [run_column(name) for name in self.columns]
        if twice := next((name for name in targets if targets.count(name) > 1), None):
            raise ValueError(f"columns: {twice} is given twice, by its two names; keep one")
        return self

    def by_column(self) -> dict[str, ColumnOptions]:
        """Return the options by the name of the run log's column."""
        return {column: options for name, options in self.columns.items() if (column := run_column(name)) is not None}


def read_map(path: Path) -> ColumnMap:
    """Read a columns.toml. Raises UsageError in one line."""
    try:
        if path.stat().st_size > BYTES_MAX:
            raise UsageError(f"{path}: has more than {BYTES_MAX} bytes; a map of columns is short")
        return ColumnMap.model_validate(tomllib.loads(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: is no TOML: {error}") from None
    except ValidationError as error:
        faults = faults_of([dict(fault) for fault in error.errors(include_url=False)], ColumnMap)
        raise UsageError(report(path, faults, "docs/how-to/recording.md")) from None
