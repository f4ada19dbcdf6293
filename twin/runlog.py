"""Run log: one recording of one machine, as columns over the time since its start (formats, section 3).

A sample that a signal does not have is NaN, or None where the column is text. Signals of several rates share one log.
"""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.rotary import COLUMN as ROTARY_COLUMN
from twin.rotary import inside_column, outside_names
from twin.run_file import csv_columns, parquet_columns, parquet_names

Floats = NDArray[np.float64]

AXIS_COLUMN = re.compile(r"^([a-z][a-z0-9]?)_(ref_mm|pos_mm|table_mm|torque_a)$")
COLUMNS = frozenset(
    {
        *("t_s", "line", "spindle_rpm", "spindle_angle_rad", "spindle_load_pct", "spindle_power_kw", "axial_depth_mm"),
        *("entry_angle_rad", "exit_angle_rad", "force_x_n", "force_y_n", "coolant_on", "ambient_temp_c", "spindle_temp_c"),
        *("vibration_rms_g", "feed_mm_min", "tool_number", "tool_change_active", "cutting_force_peak_n"),
        *("feed_override_pct", "rapid_override_pct", "spindle_override_pct"),
        *("spindle_rpm_cmd", "spindle_current_a", "vibration_velocity_mm_s"),
        *(f"axis_{axis}_load_pct" for axis in "xyzabc"),
    }
)
TEXT_COLUMNS = frozenset({"exec_state", "program"})


@dataclass(frozen=True, slots=True, eq=False)
class RunLog:
    """One run.

    t_s: (n,), s, increasing; columns: name → (n,), in the unit of the name; text: name → (n,) of text; ignored: columns that are
    not in the format; source: what to call it in a message; rotary: letters of the axes that its file has in degrees, whose
    columns are called here as those of the others (`twin.rotary`)
    """

    t_s: Floats
    columns: Mapping[str, Floats]
    text: Mapping[str, NDArray[np.object_]]
    ignored: tuple[str, ...] = ()
    source: str = "run"
    rotary: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.t_s)

    def __getitem__(self, name: str) -> Floats:
        """The column `name`, (n,). Raises RunLogError with the columns there are where it is missing."""
        try:
            return self.columns[name]
        except KeyError:
            raise RunLogError(f"{self.source}: there is no column {name}; there are {', '.join(self.columns)}") from None

    def has(self, *names: str) -> bool:
        """Return True where each of the columns is there with at least one sample."""
        return all(name in self.columns and bool(np.isfinite(self.columns[name]).any()) for name in names)

    def axes(self) -> tuple[str, ...]:
        """Letters of the axes that have a reference or a position."""
        return tuple(dict.fromkeys(m[1] for name in self.columns if (m := AXIS_COLUMN.match(name))))


def run_log(columns: Mapping[str, NDArray[np.generic]], source: str = "run") -> RunLog:
    """The run log of these columns, checked.

    Raises RunLogError where t_s is missing, is not finite or does not increase, or a column has another length or is not numbers.
    """
    if "t_s" not in columns:
        raise RunLogError(f"{source}: there is no column t_s; a run log has the time since its start in it, in s")
    numbers: dict[str, Floats] = {}
    text: dict[str, NDArray[np.object_]] = {}
    rotary = frozenset(match[1] for name in columns if (match := ROTARY_COLUMN.match(name)))
    ignored = tuple(n for n in columns if not (n in COLUMNS or n in TEXT_COLUMNS or AXIS_COLUMN.match(inside_column(n))))
    if both := [name for name in columns if inside_column(name) != name and inside_column(name) in columns]:
        raise RunLogError(f"{source}: there are {both[0]} and {inside_column(both[0])}; an axis turns or goes straight")
    columns = {inside_column(name): values for name, values in columns.items()}
    rows = len(columns["t_s"])
    for name, values in columns.items():
        if len(values) != rows:
            raise RunLogError(f"{source}: column {name} has {len(values)} rows, t_s has {rows}")
        if name in TEXT_COLUMNS:
            text[name] = np.asarray(values, dtype=object)
        elif name in COLUMNS or AXIS_COLUMN.match(name):
            numbers[name] = _numbers(name, values, source)
    t_s = numbers.pop("t_s")
    if not len(t_s):
        raise RunLogError(f"{source}: has no rows")
    if not np.isfinite(t_s).all():
        raise RunLogError(f"{source}: t_s is not a number in row {int(np.flatnonzero(~np.isfinite(t_s))[0]) + 1}")
    back = np.flatnonzero(np.diff(t_s) <= 0)
    if len(back):
        row = int(back[0])
        raise RunLogError(
            f"{source}: t_s does not increase from row {row + 1} ({t_s[row]:g} s) to {row + 2} ({t_s[row + 1]:g} s)"
        )
    return RunLog(t_s, numbers, text, ignored, source, rotary)


def _numbers(name: str, values: NDArray[np.generic], source: str) -> Floats:
    try:
        return np.array([np.nan if v is None else v for v in values] if values.dtype == object else values, dtype=np.float64)
    except (TypeError, ValueError):
        raise RunLogError(f"{source}: column {name} holds what is not a number") from None


def read_run(path: Path) -> RunLog:
    """The run log in a Parquet or CSV file (by its ending). Raises RunLogError where there is none, or one beyond the bounds."""
    try:
        if path.suffix == ".csv":
            return run_log(csv_columns(path), str(path))
        names = parquet_names(path)
        numbers = {name for name in names if name in COLUMNS or AXIS_COLUMN.match(inside_column(name))}
        log = run_log(parquet_columns(path, numbers, TEXT_COLUMNS), str(path))
    except FileNotFoundError:
        raise RunLogError(f"{path}: there is no such file") from None
    except (OSError, pa.ArrowException, UnicodeDecodeError, csv.Error) as error:
        raise RunLogError(
            f"{path}: cannot be read as a run log: {(str(error).splitlines() or [type(error).__name__])[0]}"
        ) from None
    return replace(log, ignored=tuple(name for name in names if name not in numbers and name not in TEXT_COLUMNS))


def run_table(run: RunLog) -> pa.Table:
    """Return a run log as a table with the columns of its file; NaN is null."""
    arrays = {"t_s": pa.array(run.t_s)}
    arrays |= {outside_names(name, run.rotary): pa.array(values, from_pandas=True) for name, values in run.columns.items()}
    arrays |= {name: pa.array(list(values), type=pa.string()) for name, values in run.text.items()}
    return pa.table(arrays)


def write_run(run: RunLog, path: Path) -> None:
    """Writes a run log as Parquet, or as CSV where the path ends so; NaN becomes null."""
    table = run_table(run)
    if path.suffix == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(table.column_names)
            columns = [column.to_pylist() for column in table.columns]
            writer.writerows(["" if v is None else v for v in row] for row in zip(*columns, strict=True))
        return
    pq.write_table(table, path, compression="zstd")
