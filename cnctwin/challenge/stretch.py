"""The data that models are compared on: a run log, or a stretch of the store, once a second, the twin's signals among it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Query, Store
from cnctwin.validation.evidence import track_of
from cnctwin.validation.track import Floats, Grid, held
from processors.joint_anomaly.config import NUMBERS
from twin.errors import RunLogError
from twin.residual.features import SIGNALS
from twin.run_file import parquet_columns
from twin.runlog import TEXT_COLUMNS, RunLog, read_run

EVERY_S = 1.0
HELD_S = 600.0
MEASURED, CHANGE = "spindle_temp_c", "tool_change_active"
WANTED = tuple(sorted({*SIGNALS, *NUMBERS, MEASURED, CHANGE, "tool_number", "ambient_temp_c"}))


def read_stretch(path: Path) -> RunLog:
    """A run log, with columns of numbers that are none of a run log's kept as they are."""
    log = read_run(path)
    if path.suffix == ".csv" or not log.ignored:
        return log
    try:
        read = parquet_columns(path, log.ignored, ())
        more = {name: np.asarray(values, dtype=np.float64) for name, values in read.items()}
    except (OSError, pa.ArrowException, TypeError, ValueError, RunLogError):
        return log
    return replace(log, columns={**log.columns, **more}, ignored=())


def stretch_of_store(store: Store, machine: str, from_ms: int, to_ms: int, source: str) -> RunLog:
    """Return the signals that models look at, once a second; time counts from 1970. Raises UsageError where nothing was told."""
    if machine not in (there := store.machines()):
        raise UsageError(f"{source}: holds no machine {machine}; there are {', '.join(there[:20]) or 'none'}")
    every_ms = round(1000.0 * EVERY_S)
    from_ms -= from_ms % every_ms
    grid = Grid.over(from_ms / 1000.0, to_ms / 1000.0, EVERY_S)
    columns: dict[str, Floats] = {}
    text: dict[str, NDArray[np.object_]] = {}
    for column in store.query(Query(machine, (*WANTED, *sorted(TEXT_COLUMNS)), from_ms, to_ms, every_ms)):
        if not column.t_us:
            continue
        if column.signal in TEXT_COLUMNS:
            place = np.searchsorted(np.array(column.t_us), 1e6 * (grid.starts_s + EVERY_S) - 1.0) - 1
            text[column.signal] = np.array([None if n < 0 else column.value[n] for n in place.tolist()], dtype=object)
        else:
            columns[column.signal] = held(track_of(column, EVERY_S), grid, HELD_S)
    known = {name: values for name, values in columns.items() if np.isfinite(values).any()}
    if not known or grid.count < 2:
        raise UsageError(f"{source}: nothing of {machine} in this time that a model looks at")
    return RunLog(grid.starts_s, known, text, (), source)
