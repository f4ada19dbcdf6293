"""Questions to an InfluxDB, in InfluxQL over `/query`."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from cnctwin.memory.store.contract import DERIVED, RAW, Query, Sample, Series, StoreError
from cnctwin.memory.store.influx import influxql
from cnctwin.memory.store.influx.address import PINNED, Address
from cnctwin.memory.store.influx.columns import Answered, Window, newest_series
from cnctwin.memory.store.influx.plain_http import PlainHttp
from cnctwin.memory.store.influx.sample_row import QUALITY, SampleRow, SeriesKey
from twin.vocabulary.twin_signals import TWIN_PREFIX

_MISSING = "database not found"
_SIGNALS_AT_ONCE = 50
_Question = Callable[[str], str | list[str]]
"""From the measurement, quoted, to statements."""


class InfluxReader:
    """Reads what the lines of `line_protocol` say. Any thread."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._http = PlainHttp(address, timeout_s=max(address.timeout_s, 30.0))

    def close(self) -> None:
        """Nothing stays open."""

    def machines(self) -> list[str]:
        """All machines, by name."""
        found = {str(row[1]) for name in (RAW, DERIVED) for _, row in self._rows(name, name, influxql.machines)}
        return sorted(found)

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name."""
        times: dict[tuple[str, str, str], list[int]] = {}
        for name in (RAW, DERIVED):
            for tags, row in self._rows(name, name, lambda source: influxql.ends(source, machine)):
                times.setdefault((tags["node"], tags["signal"], tags["unit"]), []).append(row[0])
        return newest_series(
            Series(machine, node, signal, unit or None, min(told), max(told)) for (node, signal, unit), told in times.items()
        )

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal."""
        found: dict[str, Sample] = {}
        for name in (RAW, DERIVED):
            rows = (_sample(machine, *told) for told in self._rows(name, name, lambda s: influxql.last_samples(s, machine)))
            for row in sorted(rows, key=lambda row: row.t_us):
                found[row.key.signal] = Sample(row.key.signal, row.t_us, row.value, row.quality, row.reason, row.unit)
        return found

    def samples(self, machine: str, measurement: str, from_ms: int, to_ms: int) -> list[SampleRow]:
        """All samples of a machine in a stretch, but for those of the pinned bucket."""
        told = self._rows(measurement, measurement, lambda source: influxql.samples(source, machine, None, from_ms, to_ms))
        return [_sample(machine, tags, row) for tags, row in told]

    def answer(self, query: Query) -> Answered:
        """Return the answer to a question: of its own bucket and of the pinned one, whose samples outlive those."""
        answered = Answered({}, {}, {})
        for name in (RAW, DERIVED):
            signals = [signal for signal in query.signals if signal.startswith(TWIN_PREFIX) is (name == DERIVED)]
            for start in range(0, len(signals), _SIGNALS_AT_ONCE):
                part = Query(
                    query.machine, tuple(signals[start : start + _SIGNALS_AT_ONCE]), query.from_ms, query.to_ms, query.every_ms
                )
                for bucket in (name, PINNED):
                    self._fill(answered, part, bucket, name)
        return answered

    def _fill(self, answered: Answered, query: Query, bucket: str, name: str) -> None:
        newest: dict[str, int] = {}
        for tags, row in self._rows(bucket, name, lambda source: influxql.units(source, query)):
            if row[0] > newest.get(tags["signal"], -1) and (bucket == name or tags["signal"] not in answered.units):
                newest[tags["signal"]] = row[0]
                answered.units[tags["signal"]] = tags["unit"] or None
        if query.every_ms is None:
            stretch = (query.machine, query.signals, query.from_ms, query.to_ms)
            for told in self._rows(bucket, name, lambda source: influxql.samples(source, *stretch)):
                row = _sample(query.machine, *told)
                answered.rows.setdefault(row.key.signal, []).append(row)
            return
        for signal, windows in _windows(self._results(bucket, name, lambda source: influxql.windows(source, query))).items():
            answered.windows.setdefault(signal, []).extend(windows)

    def _results(self, bucket: str, measurement: str, ask: _Question) -> list[list[dict[str, Any]]]:
        """The series of each statement; none where the bucket has not been made yet."""
        asked = ask(influxql.identifier(measurement))
        statements = [asked] if isinstance(asked, str) else asked
        results = self._query(bucket, "; ".join(statements))
        error = next((result["error"] for result in results if "error" in result), "")
        if error == "not executed" and len(statements) > 1:  # all that several statements say of a missing database
            error = self._query(bucket, statements[0])[0].get("error", error)
        if error and _MISSING not in error:
            raise StoreError(f"{self._address.base}/query: {error}")
        return [] if error else [result.get("series", []) for result in results]

    def _query(self, bucket: str, text: str) -> list[dict[str, Any]]:
        address = self._address
        told = self._http.get_json("/query", {"db": address.bucket(bucket), "q": text, "epoch": "u"})
        try:
            results: list[dict[str, Any]] = told["results"]
        except (KeyError, TypeError):
            raise StoreError(f"{address.base}/query: the answer is not InfluxQL's JSON; is that an InfluxDB?") from None
        return results

    def _rows(self, bucket: str, measurement: str, ask: _Question) -> Iterator[tuple[dict[str, str], Sequence[Any]]]:
        for series in self._results(bucket, measurement, ask):
            for found in series:
                for row in found["values"]:
                    yield found.get("tags", {}), row


def _sample(machine: str, tags: dict[str, str], row: Sequence[Any]) -> SampleRow:
    t_us, value, held, flag, text, quality, reason = row
    number = value if value is not None else held
    told = flag if flag is not None else text if text is not None else None if number is None else float(number)
    key = SeriesKey(machine, tags["node"], tags["signal"])
    return SampleRow(key, tags["unit"] or None, t_us, told, QUALITY[int(quality)], reason)


def _windows(results: Sequence[Iterable[dict[str, Any]]]) -> dict[str, list[Window]]:
    reasons: dict[tuple[str, int, float], str] = {}
    for code, series in zip((2.0, 1.0), results[1:], strict=False):
        for found in series:
            for t_us, reason in found["values"]:
                if reason is not None:
                    reasons[found["tags"]["signal"], t_us, code] = reason
    windows: dict[str, list[Window]] = {}
    for found in results[0] if results else ():
        signal = found["tags"]["signal"]
        for t_us, mean, low, high, count, worst, flag, text in found["values"]:
            if count:
                last = flag if flag is not None else text
                reason = reasons.get((signal, t_us, worst))
                windows.setdefault(signal, []).append(Window(t_us, mean, low, high, count, last, worst, reason))
    return windows
