"""A stretch of a store as a run log (formats, section 3), for gap diagnosis, identification and training."""

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.files.output import check_suffix
from cnctwin.memory.store.contract import Column, Query, Store, StoreError
from cnctwin.memory.store.known_before import known_before
from cnctwin.memory.store.opening import open_store
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.errors import RunLogError
from twin.runlog import AXIS_COLUMN, COLUMNS, TEXT_COLUMNS, RunLog, run_log, write_run

_AXIS_POSITION = re.compile(r"^axis_([a-z][a-z0-9]?_pos_(?:mm|deg))$")
_RENAMED = {"nc_line": "line"}


def column_name(signal: str) -> str | None:
    """The column of a run log that a signal is; None where it is none.

    >>> column_name("axis_x_pos_mm"), column_name("axis_c_pos_deg"), column_name("nc_line"), column_name("alarm")
    ('x_pos_mm', 'c_pos_deg', 'line', None)
    """
    if match := _AXIS_POSITION.match(signal):
        return match[1]
    name = _RENAMED.get(signal, signal)
    return name if name in COLUMNS | TEXT_COLUMNS or AXIS_COLUMN.match(name) else None


def export(
    where: str | Path, machine: str, span_ms: tuple[int, int], out: Path, *, every_ms: int | None = None, held: bool = False
) -> int:
    """Write a stretch of a store as a run log and return its number of rows. Raises ApplicationError in one line."""
    check_suffix(out)
    store = open_store(where)
    try:
        run = run_of(store, machine, *span_ms, every_ms=every_ms, held=held)
        write_run(run, out)
    except (RunLogError, OSError) as error:
        raise UsageError(f"{out}: {error}") from None
    finally:
        store.close()
    return len(run)


def run_of(
    store: Store,
    machine: str,
    from_ms: int,
    to_ms: int,
    *,
    every_ms: int | None = None,
    held: bool = False,
    only: Collection[str] | None = None,
) -> RunLog:
    """The run log of a machine in [from_ms, to_ms): a row for each time at which a signal said something.

    The first row also has what was known before: of each signal that says nothing in it the last value, where that was good.

    every_ms: windows, with the mean of each. held: a signal that says nothing keeps what it said last (controls report what
    changes); a value that is not good ends that. only: these signals; else all. Raises StoreError where there is nothing.
    """
    series = [s for s in store.series(machine) if only is None or s.signal in only]
    names = {s.signal: name for s in series if (name := column_name(s.signal)) is not None}
    if not names:
        known = ", ".join(store.machines()) or "none"
        raise StoreError(f"{machine}: the store has no signal of it that a run log knows; machines it has: {known}")
    columns = [c for c in store.query(Query(machine, tuple(sorted(names)), from_ms, to_ms, every_ms)) if c.t_us]
    if not columns:
        raise StoreError(f"{machine}: the store has nothing from {from_ms} to {to_ms}; ask `cnctwin store status` what it has")
    t_us = np.unique(np.concatenate([np.array(c.t_us, dtype=np.int64) for c in columns]))
    told: dict[str, NDArray[np.generic]] = {"t_s": (t_us - t_us[0]) / 1e6}
    silent = names.keys() - {column.signal for column in columns if column.t_us[0] == t_us[0]}
    before = known_before(store, machine, silent, from_ms)
    said = {column.signal: column for column in columns}
    for signal in sorted(said.keys() | before.keys()):
        at_us, good = _good(said.get(signal))
        if signal in before:
            at_us, good = [int(t_us[0]), *at_us], [before[signal].value, *good]
        told[names[signal]] = _spread(at_us, good, t_us, is_text=names[signal] in TEXT_COLUMNS, held=held)
    return run_log(_merged(told), f"{machine} from the store")


def _good(column: Column | None) -> tuple[list[int], list[Value]]:
    """The times of a column, and its values, None where one is not good."""
    if column is None:
        return [], []
    pairs = zip(column.value, column.quality, strict=True)
    return column.t_us, [value if quality is Quality.GOOD else None for value, quality in pairs]


def _spread(
    at_us: Sequence[int], good: Sequence[object], t_us: NDArray[np.int64], *, is_text: bool, held: bool
) -> NDArray[np.generic]:
    at = np.searchsorted(t_us, np.array(at_us, dtype=np.int64))
    values = np.array([_text(v) if is_text else _number(v) for v in good], dtype=object if is_text else np.float64)
    spread = np.full(len(t_us), None if is_text else np.nan, dtype=values.dtype)
    if not held:
        spread[at] = values
        return spread
    last = np.searchsorted(at, np.arange(len(t_us)), side="right") - 1
    spread[last >= 0] = values[last[last >= 0]]
    return spread


def _text(value: object) -> str | None:
    return None if value is None else str(value)


def _number(value: object) -> float:
    return float(value) if isinstance(value, bool | int | float) else float("nan")


def _merged(told: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Without columns that hold nothing."""
    empty = {name for name, values in told.items() if all(v is None or v != v for v in values.tolist())}  # noqa: PLR0124
    return {name: values for name, values in told.items() if name not in empty}
