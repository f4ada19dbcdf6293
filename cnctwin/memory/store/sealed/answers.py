"""Questions to the sealed hours, through DuckDB over the files that the manifest lists."""

import threading
from collections.abc import Iterable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.hot import SeriesOf
from cnctwin.memory.store.sealed.manifest import File
from cnctwin.memory.store.value_form import ARRAYS, NUMBERS, PLAIN, Kind, given
from cnctwin.memory.store.windows import Numbers, StoredSample, Windows
from sparkplug.values import Value

THREADS, MEMORY = 2, "256MB"
_SOURCE = "read_parquet($files, hive_partitioning = false)"
_SOURCE_BY_NAME = "read_parquet($files, union_by_name = true, hive_partitioning = false)"
_WITHIN = "t >= $from AND t < $to"
_ODD = " AND (quality <> 0 OR nulls IS NOT NULL)"


class SealedAnswers:
    """One DuckDB in memory, made with the first question; any thread may ask."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._duck: duckdb.DuckDBPyConnection | None = None

    def _cursor(self) -> duckdb.DuckDBPyConnection:
        with self._lock:
            if self._duck is None:
                self._duck = duckdb.connect(":memory:", config={"threads": THREADS, "memory_limit": MEMORY})
                for setting in ("parquet_metadata_cache = true", "temp_directory = ''", "autoinstall_known_extensions = false"):
                    self._duck.execute(f"SET {setting}")
            return self._duck.cursor()

    def close(self) -> None:
        """Give its memory back."""
        with self._lock:
            if self._duck is not None:
                self._duck.close()

    def told(self, files: Sequence[File], series: Iterable[SeriesOf], from_ms: int, to_ms: int) -> dict[int, list[StoredSample]]:
        """The samples of these series in [from_ms, to_ms), by series. FileNotFoundError where a file is gone by now."""
        return self._rows(files, series, from_ms, to_ms)

    def fill(
        self,
        files: Sequence[File],
        windows: Mapping[int, Windows],
        series: Sequence[SeriesOf],
        from_ms: int,
        to_ms: int,
        *,
        with_last: bool = False,
    ) -> None:
        """Put the samples of these series into the windows of each. FileNotFoundError where a file is gone by now.

        with_last: also the last number of each window, which costs something
        """
        numbers = [s for s in series if s.kind in NUMBERS]
        self._sum_up(files, windows, numbers, (from_ms, to_ms), with_last=with_last)
        odd = [file for file in files if file.is_odd]
        nulls = [s for s in series if s.kind is Kind.NULL]
        for sid, told in self._rows(odd, [*numbers, *nulls], from_ms, to_ms, _ODD).items():
            windows[sid].add(told)
        others = [s for s in series if s.kind not in NUMBERS and s.kind is not Kind.NULL]
        for sid, told in self._rows(files, others, from_ms, to_ms).items():
            windows[sid].add(told)

    def _sum_up(
        self,
        files: Sequence[File],
        windows: Mapping[int, Windows],
        series: Sequence[SeriesOf],
        span_ms: tuple[int, int],
        *,
        with_last: bool,
    ) -> None:
        for layout, some in _layouts(files, series).items():
            self._sum_up_alike(some, windows, layout, span_ms, with_last=with_last)

    def _sum_up_alike(
        self,
        files: Sequence[File],
        windows: Mapping[int, Windows],
        layout: tuple[tuple[int, str], ...],
        span_ms: tuple[int, int],
        *,
        with_last: bool,
    ) -> None:
        """Sum up files that keep all series that are asked for in the same way, so that they are summed up as they are kept."""
        every_ms = next(iter(windows.values())).every_us // 1000
        sums = {sid: _sums(sid, ending, with_last=with_last) for sid, ending in layout}
        wanted = "".join(f", {part} AS {name}{sid}" for sid, some in sums.items() for name, part in some.items())
        where = _WITHIN + (" AND quality = 0" if any(file.is_odd for file in files) else "")
        text = f"SELECT t // {every_ms} AS w{wanted} FROM {_SOURCE} WHERE {where} GROUP BY w"  # noqa: S608
        found = self._ask(text, files, *span_ms).fetchnumpy()
        numbers = found["w"].tolist()
        starts = [number * every_ms * 1000 for number in numbers]
        for sid, some in sums.items():
            of = {name: found[f"{name}{sid}"].tolist() for name in some}
            last_us = [0 if t is None else t * 1000 for t in of["t"]] if with_last else starts
            count, good, last = of["count"], of.get("good", of["count"]), of.get("last", repeat(None))
            total = (one or 0.0 for one in of["total"])
            windows[sid].put_all(numbers, map(Numbers, count, good, total, of["low"], of["high"], last_us, last))

    def _rows(
        self, files: Sequence[File], series: Iterable[SeriesOf], from_ms: int, to_ms: int, where: str = ""
    ) -> dict[int, list[StoredSample]]:
        every = {s.sid: s for s in series}
        endings = _endings(files, every.values())
        nulls = {sid for file in files for sid in file.nulls} & every.keys()
        if not endings and not nulls:
            return {}
        wanted = ", ".join(_value(sid, kept) for sid, kept in endings.items())
        having = _having(files, endings, nulls)
        text = (
            f"SELECT t, sub, quality, reason, nulls{', ' if wanted else ''}{wanted} FROM {_SOURCE_BY_NAME} WHERE {_WITHIN}{where}"  # noqa: S608
        )
        found = list(self._ask(text, having, from_ms, to_ms).fetchnumpy().values())
        t = (np.asarray(found[0], dtype=np.int64) * 1000 + np.asarray(found[1], dtype=np.int64)).tolist()
        ranks, reasons = np.ma.filled(found[2], 0).tolist(), _objects(found[3])
        answer: dict[int, list[StoredSample]] = {}
        for sid, column in zip(endings, found[5:], strict=True):
            kind, values = every[sid].kind, column.tolist()
            at = np.flatnonzero(~np.ma.getmaskarray(column)).tolist()
            if kind in PLAIN:
                answer[sid] = [(t[i], values[i], ranks[i], reasons[i]) for i in at]
            else:
                answer[sid] = [(t[i], _given(kind, values[i]), ranks[i], reasons[i]) for i in at]
        if nulls:
            for i, sids in enumerate(_objects(found[4])):
                for sid in nulls.intersection(() if sids is None else sids.tolist()):
                    answer.setdefault(sid, []).append((t[i], None, ranks[i], reasons[i]))
        return answer

    def _ask(self, text: str, files: Sequence[File], from_ms: int, to_ms: int) -> Any:
        names = [str(self._folder / file.name) for file in files]
        try:
            return self._cursor().execute(text, {"files": names, "from": from_ms, "to": to_ms})
        except duckdb.IOException as error:
            missing = [name for name in names if not Path(name).exists()]
            if missing:
                raise FileNotFoundError(missing[0]) from None
            raise StoreError(f"{self._folder}: sealed hours cannot be read: {str(error).splitlines()[0]}") from None
        except duckdb.Error as error:
            raise StoreError(f"{self._folder}: sealed hours cannot be asked: {str(error).splitlines()[0]}") from None


def _endings(files: Iterable[File], series: Iterable[SeriesOf]) -> dict[int, list[str]]:
    """Return how each of these series is kept in these files; those that are in none are left out."""
    wanted = {s.sid for s in series}
    found: dict[int, list[str]] = {}
    for file in files:
        for sid, ending in file.endings.items():
            if sid in wanted and ending not in found.setdefault(sid, []):
                found[sid].append(ending)
    return found


def _having(files: Iterable[File], endings: Mapping[int, Sequence[str]], nulls: Iterable[int] = ()) -> list[File]:
    return [file for file in files if not endings.keys().isdisjoint(file.endings) or not set(nulls).isdisjoint(file.nulls)]


def _value(sid: int, endings: Sequence[str]) -> str:
    """The value of a series in SQL, to the last bit, from however many columns."""
    parts = [
        _FORMS[ending.rstrip("0123456789")].format(name=f"s{sid}{ending}", power="1e" + ending.lstrip("lez"))
        for ending in endings
    ]
    return parts[0] if len(parts) == 1 else f"coalesce({', '.join(parts)})"


def _layouts(files: Iterable[File], series: Iterable[SeriesOf]) -> dict[tuple[tuple[int, str], ...], list[File]]:
    """The files by how they keep these series; those that have none of them are left out."""
    wanted = {s.sid for s in series}
    found: dict[tuple[tuple[int, str], ...], list[File]] = {}
    for file in files:
        layout = tuple(sorted((sid, ending) for sid, ending in file.endings.items() if sid in wanted))
        if layout:
            found.setdefault(layout, []).append(file)
    return found


def _sums(sid: int, ending: str, *, with_last: bool) -> dict[str, str]:
    """Return the sums of a series by name; as whole numbers where they are kept as such. good: where not all may be finite."""
    name, value, digits = f"s{sid}{ending}", _value(sid, [ending]), ending[1:]
    if ending[0] in "ezi":
        whole = f"({name} & -2)" if ending[0] == "z" else name
        scale = {"e": f" / 1e{digits}", "z": f" / 2e{digits}", "i": "::DOUBLE"}[ending[0]]
        sums = {"total": f"sum({whole}){scale}", "low": f"min({whole}){scale}", "high": f"max({whole}){scale}"}
    else:
        finite = f"CASE WHEN isfinite({value}) THEN {value} END"
        sums = {"total": f"sum({finite})", "low": f"min({finite})", "high": f"max({finite})", "good": f"count({finite})"}
    if with_last:
        sums |= {"t": f"max(t) FILTER ({name} IS NOT NULL)", "last": f"arg_max({value}, t)"}
    return {"count": f"count({name})", **sums}


_FORMS = {
    "e": "({name} / {power})",
    "z": "(CASE WHEN ({name} & 1) = 1 THEN CAST('-0.0' AS DOUBLE) ELSE {name} / (2 * {power}) END)",
    "f": "CAST({name} AS DOUBLE)",
    "le": "list_transform({name}, lambda x: x / {power})",
    "lz": "list_transform({name}, lambda x: CASE WHEN (x & 1) = 1 THEN CAST('-0.0' AS DOUBLE) ELSE x / (2 * {power}) END)",
    "lf": "CAST({name} AS DOUBLE[])",
} | dict.fromkeys(("d", "i", "b", "t", "x", "ld", "li", "lb"), "{name}")


def _given(kind: Kind, value: Any) -> Value:
    if kind in ARRAYS:
        return tuple(value.tolist())
    return bytes(value) if kind is Kind.BYTES else given(kind, value)


def _objects(column: Any) -> list[Any]:
    """The values of a column of objects; one that is null throughout comes as something else."""
    return column.tolist() if column.dtype.kind == "O" else [None] * len(column)
