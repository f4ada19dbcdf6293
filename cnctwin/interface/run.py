"""A run log: one recording of one machine, as numpy columns, an Arrow table or a DataFrame over the time since its start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

import twin.runlog
from cnctwin.files.output import check_suffix, write
from cnctwin.interface.errors import RunError, one_tree
from cnctwin.interface.frame import frame_of
from twin.rotary import outside_names
from twin.runlog import TEXT_COLUMNS, RunLog, run_log, run_table

if TYPE_CHECKING:
    import pandas as pd

Columns = Mapping[str, Sequence[Any] | NDArray[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One recording; names and units of its columns are those of the run log's file (docs/how-to/recording.md).

    >>> run = Run.of({"t_s": [0.0, 0.1, 0.2], "spindle_load_pct": [12.0, None, 14.0], "exec_state": ["ACTIVE", None, None]})
    >>> run.columns, len(run), run.seconds
    (('t_s', 'spindle_load_pct', 'exec_state'), 3, 0.2)
    >>> run["spindle_load_pct"]
    array([12., nan, 14.])
    """

    log: RunLog

    @classmethod
    def of(cls, columns: "Columns | pa.Table | pd.DataFrame", name: str = "run") -> "Run":
        """The run of these columns, checked; what is missing is None or NaN.

        name: what a message calls it. A frame has `t_s` as a column or as its index. Raises RunError where t_s is missing or does
        not increase, or a column holds what it cannot.
        """
        given = {column: _values(column, values) for column, values in _columns(columns).items()}
        with one_tree():
            return cls(run_log(given, name))

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns, `t_s` first."""
        log = self.log
        return ("t_s", *(outside_names(name, log.rotary) for name in log.columns), *log.text)

    @property
    def seconds(self) -> float:
        """Time from the first row to the last."""
        return float(self.log.t_s[-1] - self.log.t_s[0])

    @property
    def ignored(self) -> tuple[str, ...]:
        """Columns that came with it and are not of a run log."""
        return self.log.ignored

    def __len__(self) -> int:
        return len(self.log)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The column `name`, (n,): numbers, NaN where there is no sample, or texts, None where there is none.

        Raises RunError with the columns there are.
        """
        log = self.log
        if name == "t_s":
            return log.t_s
        inside = {outside_names(column, log.rotary): values for column, values in log.columns.items()} | dict(log.text)
        if name not in inside:
            raise RunError(f"{log.source}: there is no column {name}; there are {', '.join(self.columns)}")
        return inside[name]

    def table(self) -> pa.Table:
        """Return the columns as an Arrow table; a missing sample is null."""
        return run_table(self.log)

    def frame(self) -> "pd.DataFrame":
        """Return the columns as a DataFrame by `t_s`. Raises MissingPackageError without pandas."""
        return frame_of(self.table(), "t_s")


def read_run(path: str | Path) -> Run:
    """Read a run log, Parquet or CSV by the ending of its name. Raises RunError."""
    with one_tree():
        return Run(twin.runlog.read_run(Path(path)))


def write_run(run: "Run | Columns | pa.Table | pd.DataFrame", path: str | Path) -> Run:
    """Write a run log as .parquet or .csv and return it as it was checked. Raises RunError, UsageError."""
    out = Path(path)
    check_suffix(out)
    checked = run if isinstance(run, Run) else Run.of(run, str(out))
    write(lambda: twin.runlog.write_run(checked.log, out), out)
    return checked


def _columns(columns: Any) -> dict[str, Any]:
    if isinstance(columns, pa.Table):
        return {name: columns.column(name).to_numpy(zero_copy_only=False) for name in columns.column_names}
    if isinstance(columns, Mapping):
        return dict(columns)
    if getattr(columns.index, "name", None) == "t_s":  # a frame, as `Run.frame` gives it
        columns = columns.reset_index()
    return {str(name): columns[name].to_numpy() for name in columns.columns}


def _values(name: str, values: Any) -> NDArray[Any]:
    if name not in TEXT_COLUMNS:
        return np.asarray(values)
    return np.array([value if isinstance(value, str) else None for value in values], dtype=object)
