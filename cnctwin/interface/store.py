"""A store, wherever it lies, as Arrow tables and DataFrames."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from cnctwin.errors import UsageError
from cnctwin.interface.errors import one_tree
from cnctwin.interface.frame import frame_of
from cnctwin.interface.signal_columns import batch_of, schema_of, type_of
from cnctwin.memory.store import contract, opening
from cnctwin.memory.store.contract import Query, Series
from cnctwin.terminal.moment import length_ms, moment_ms

if TYPE_CHECKING:
    import pandas as pd

Moment = datetime | str | int
"""A datetime (UTC where it has no zone), a text as the commands take it (`2026-11-22T06:00`, `-15m`), or ms since 1970."""

SLICE_MS, SLICE_MS_MAX = 60_000, 7 * 86_400_000
ROWS = 50_000


@dataclass(frozen=True, slots=True)
class StoredSignal:
    """A signal of a machine in a store: its unit, the nodes that told it, and the times of its first and last sample."""

    name: str
    unit: str | None
    nodes: tuple[str, ...]
    first: datetime
    last: datetime


class Store:
    """A store that is open for reading; `with cnctwin.open_store(...) as store:` closes it.

    Other processes may read and one may write meanwhile.
    """

    def __init__(self, inner: contract.Store) -> None:
        self._inner = inner

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it; twice does no harm."""
        self._inner.close()

    def machines(self) -> list[str]:
        """All machines, by name."""
        with one_tree():
            return self._inner.machines()

    def signals(self, machine: str) -> list[StoredSignal]:
        """The signals of a machine, by name. Raises UsageError where the store has no such machine."""
        return [
            StoredSignal(
                name,
                next((one.unit for one in series if one.unit), None),
                tuple(sorted({one.node for one in series})),
                _moment(min(one.first_us for one in series)),
                _moment(max(one.last_us for one in series)),
            )
            for name, series in self._series(machine).items()
        ]

    def batches(
        self,
        machine: str,
        signals: Sequence[str] | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
        *,
        every: str | timedelta | None = None,
        details: bool = False,
        as_text: Collection[str] = (),
    ) -> pa.RecordBatchReader:
        """Stream what `table` returns, in batches of at most 50,000 rows: a span may be longer than the memory holds.

        Raises UsageError and StoreError at once, or while it is read.
        """
        series = self._series(machine)
        names = list(dict.fromkeys(series if signals is None else signals))
        _check(machine, names, list(series))
        told = [one for name in names for one in series[name]]
        held_ms = min(one.first_us for one in told) // 1000, max(one.last_us for one in told) // 1000 + 1
        from_ms = held_ms[0] if start is None else _ms(start, "start")
        to_ms = held_ms[1] if end is None else _ms(end, "end")
        with one_tree():
            query = Query(machine, tuple(names), from_ms, to_ms, _every_ms(every))
        with one_tree():
            latest = self._inner.latest(machine)
        types = {name: pa.string() if name in as_text else type_of(name, latest) for name in names}
        units = {name: next((one.unit for one in series[name] if one.unit), None) for name in names}
        schema = schema_of(types, units, windows=every is not None, details=details)
        return pa.RecordBatchReader.from_batches(schema, self._batches(query, held_ms, schema, details=details))

    def table(
        self,
        machine: str,
        signals: Sequence[str] | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
        *,
        every: str | timedelta | None = None,
        details: bool = False,
        as_text: Collection[str] = (),
    ) -> pa.Table:
        """The signals of a machine in [start, end): a column `t`, then one for each signal, a row for each moment of a sample.

        signals: names, None = all; start, end: None = from the first sample, to the last
        every: windows, as "1s" or a timedelta, with the mean of each (of a text or flag its last); None = samples as they came
        details: beside each signal `.quality` and `.reason` and, with `every`, `.low`, `.high`, `.count`; a value that is not
            good then stands as it came. Without, it is null
        as_text: signals to read as text, because they once told a number and once a text

        Raises UsageError where machine, signal or span cannot be, StoreError.
        """
        return self.batches(machine, signals, start, end, every=every, details=details, as_text=as_text).read_all()

    def frame(
        self,
        machine: str,
        signals: Sequence[str] | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
        *,
        every: str | timedelta | None = None,
        details: bool = False,
        as_text: Collection[str] = (),
    ) -> "pd.DataFrame":
        """Return `table` as a DataFrame by `t`, units in `attrs["units"]`. Raises as it, MissingPackageError without pandas."""
        return frame_of(self.table(machine, signals, start, end, every=every, details=details, as_text=as_text), "t")

    def _series(self, machine: str) -> dict[str, list[Series]]:
        with one_tree():
            opening.check_machine(self._inner, machine)
            series: dict[str, list[Series]] = {}
            for one in self._inner.series(machine):
                series.setdefault(one.signal, []).append(one)
        return series

    def _batches(self, query: Query, held_ms: tuple[int, int], schema: pa.Schema, *, details: bool) -> Iterator[pa.RecordBatch]:
        """Yield slices of the time for which there are samples, each about as long as has ROWS rows by the one before it."""
        windows, step = query.every_ms is not None, query.every_ms or 1
        at_ms, to_ms, slice_ms = max(query.from_ms, held_ms[0]), min(query.to_ms, held_ms[1]), SLICE_MS
        while at_ms < to_ms:
            # The end of a slice is that of a window, so that each window is asked for whole.
            until_ms = min(-(-(at_ms + slice_ms) // step) * step, to_ms)
            with one_tree():
                columns = self._inner.query(Query(query.machine, query.signals, at_ms, until_ms, query.every_ms))
            batch = batch_of(columns, schema, windows=windows, details=details)
            for first in range(0, batch.num_rows, ROWS):
                yield batch.slice(first, ROWS)
            slice_ms = min(SLICE_MS_MAX, max(1000, int(slice_ms * min(8.0, ROWS / max(batch.num_rows, 1)))))
            at_ms = until_ms


def open_store(where: str | Path | None = None) -> Store:
    """Open a store for reading: a folder, or an address as the commands take it; None = $CNCTWIN_STORE, else the usual folder.

    Raises StoreError.
    """
    with one_tree():
        return Store(opening.open_store(opening.default_place() if where is None else where))


def _check(machine: str, names: Sequence[str], known: Sequence[str]) -> None:
    if not names:
        raise UsageError(f"{machine}: name at least one signal; the store has {', '.join(known)}")
    if unknown := [name for name in names if name not in known]:
        raise UsageError(f"{machine}: the store has no signal {unknown[0]}; it has {', '.join(known)}")


def _moment(us: int) -> datetime:
    return datetime.fromtimestamp(0, UTC) + timedelta(microseconds=us)


def _ms(moment: Moment, name: str) -> int:
    if isinstance(moment, datetime):
        aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        return (aware - datetime.fromtimestamp(0, UTC)) // timedelta(milliseconds=1)
    return moment if isinstance(moment, int) else moment_ms(moment, name)


def _every_ms(every: str | timedelta | None) -> int | None:
    if every is None:
        return None
    return every // timedelta(milliseconds=1) if isinstance(every, timedelta) else length_ms(every, "every")
