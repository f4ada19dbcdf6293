"""Questions to a VictoriaMetrics: samples by its export, windows by MetricsQL over `query_range`.

Its windows end where ours begin: at t they hold (t - w, t], so that of [k w, (k + 1) w) is asked for at (k + 1) w - 1 ms. Windows
that a question cuts are folded here from their samples. `nocache=1` keeps it from moving begin, end and the newest points.
"""

import json
import re
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from cnctwin.memory.store.contract import DERIVED, RAW, Query, Sample, Series, StoreError
from cnctwin.memory.store.influx.address import Address
from cnctwin.memory.store.influx.columns import Answered, Window, folded, newest_series
from cnctwin.memory.store.influx.line_protocol import EMPTY
from cnctwin.memory.store.influx.plain_http import PlainHttp
from cnctwin.memory.store.influx.sample_row import QUALITY, SampleRow, SeriesKey
from twin.vocabulary.twin_signals import TWIN_PREFIX

_FIELDS = ("value", "held", "flag", "text", "quality", "reason")
_EVER = "1"
"""For 0 the last minutes are meant."""
_WINDOWS_AT_ONCE = 20_000
_LOOKBACKS = ("1h", "1d", "40d", "400d")
_Place = tuple[str, str, str, str]  # signal, node, unit, nth


@dataclass(slots=True)
class _Moment:
    """The values of the series of one sample."""

    number: float | None = None
    label: str | None = None
    flag: str | None = None
    quality: float | None = None
    reason: str | None = None

    def take(self, name: str, labels: dict[str, str], value: float) -> None:
        """Take what the series of one field says."""
        if name in {"value", "held"}:
            self.number = float(value)
        elif name == "quality":
            self.quality = float(value)
        elif name == "flag":
            self.flag = labels["flag"]
        elif name == "text":
            self.label = labels["text"]
        else:
            self.reason = labels["reason"]

    def row(self, machine: str, place: _Place, t_ms: int) -> SampleRow:
        """The sample."""
        signal, node, unit, nth = place
        value: bool | float | str | None = self.number
        if self.flag is not None:
            value = self.flag == "true"
        elif self.label is not None:
            value = _told(self.label)
        reason = None if self.reason is None else _told(self.reason)
        key = SeriesKey(machine, node, signal)
        return SampleRow(key, unit or None, t_ms * 1000 + int(nth or 0), value, QUALITY[int(self.quality or 0)], reason)


@dataclass(slots=True)
class _Part:
    """The windows of one signal as they are gathered; a window is known by its beginning, ms since 1970."""

    figures: dict[str, dict[int, float]] = field(default_factory=dict)
    last: dict[int, tuple[float, bool | str]] = field(default_factory=dict)
    reasons: dict[tuple[int, float], tuple[float, str]] = field(default_factory=dict)

    def take(self, labels: dict[str, str], told: dict[int, float]) -> None:
        """One series of the answer; of texts and reasons the values are times, of which the latest counts."""
        figure = labels["figure"]
        if figure in {"text", "flag"}:
            said = _told(labels["text"]) if figure == "text" else labels["flag"] == "true"
            for begin_ms, at_s in told.items():
                if begin_ms not in self.last or at_s >= self.last[begin_ms][0]:
                    self.last[begin_ms] = (at_s, said)
        elif figure.startswith("reason"):
            code = float(figure[-1])
            for begin_ms, at_s in told.items():
                if (begin_ms, code) not in self.reasons or at_s >= self.reasons[begin_ms, code][0]:
                    self.reasons[begin_ms, code] = (at_s, _told(labels["reason"]))
        else:
            self.figures[figure] = told

    def windows(self) -> Iterator[Window]:
        """Yield each window that holds a sample."""
        sums, goods, lows, highs, worsts = (self.figures.get(name, {}) for name in ("sum", "good", "low", "high", "worst"))
        for begin_ms, count in self.figures.get("count", {}).items():
            good, worst, last = goods.get(begin_ms), worsts.get(begin_ms, 0.0), self.last.get(begin_ms)
            reason = self.reasons.get((begin_ms, worst))
            yield Window(
                begin_ms * 1000,
                sums[begin_ms] / good if good else None,
                lows.get(begin_ms),
                highs.get(begin_ms),
                round(count),
                last[1] if last else None,
                worst,
                reason[1] if reason else None,
            )


class VictoriaReader:
    """Reads what `line_protocol.victoria_line` says. Any thread. wall_s: the time now, seconds since 1970."""

    def __init__(self, address: Address, *, wall_s: Callable[[], float] = time.time) -> None:
        self._http = PlainHttp(address, timeout_s=max(address.timeout_s, 30.0))
        self._base, self._wall_s = address.base, wall_s

    def close(self) -> None:
        """Nothing stays open."""

    def machines(self) -> list[str]:
        """All machines, by name."""
        match = f'{{__name__=~"({RAW}|{DERIVED})_quality"}}'
        told = self._http.get_json("/api/v1/label/machine/values", {"match[]": match, "start": _EVER})
        return sorted(told.get("data") or [])

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name; their first and last samples are looked for in the last 400 days."""
        ends: dict[_Place, list[int]] = defaultdict(list)
        match = f'{{__name__=~"({RAW}|{DERIVED})_quality",machine={_quoted(machine)}}}[{_LOOKBACKS[-1]}]'
        for which in ("tfirst", "tlast"):
            for labels, t_s in self._instant(f"{which}_over_time({match})"):
                ends[_place(labels)].append(round(t_s * 1000) * 1000)
        return newest_series(
            Series(machine, node, signal, unit or None, min(told), max(told)) for (signal, node, unit, _), told in ends.items()
        )

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal, of the last 400 days."""
        match = f'{{__name__=~"({RAW}|{DERIVED})_quality",machine={_quoted(machine)}}}'
        known = self._http.get_json("/api/v1/series", {"match[]": match, "start": _EVER})["data"]
        missing, found = {labels["signal"] for labels in known}, dict[str, Sample]()
        for lookback in _LOOKBACKS:
            if missing:
                found |= self._last(machine, missing, lookback)
                missing -= set(found)
        return found

    def _last(self, machine: str, signals: set[str], lookback: str) -> dict[str, Sample]:
        match = f"{_match(machine, sorted(signals), (RAW, DERIVED))}[{lookback}]"
        told: dict[tuple[_Place, str], dict[str, tuple[dict[str, str], float]]] = defaultdict(dict)
        for which in ("tlast", "last"):
            for labels, value in self._instant(f"{which}_over_time({match}) keep_metric_names"):
                name = labels.pop("__name__")
                series = name + json.dumps(labels, sort_keys=True)
                told[_place(labels), series][which] = ({**labels, "__name__": name}, value)
        moments: dict[tuple[_Place, int], _Moment] = defaultdict(_Moment)
        for (place, _), both in told.items():
            if len(both) == 2:
                labels, value = both["last"]
                moments[place, round(both["tlast"][1] * 1000)].take(_field(labels["__name__"]), labels, value)
        found: dict[str, Sample] = {}
        for (place, t_ms), moment in sorted(moments.items(), key=lambda item: (item[0][1], item[0][0][3])):
            if moment.quality is not None:
                row = moment.row(machine, place, t_ms)
                found[place[0]] = Sample(place[0], row.t_us, row.value, row.quality, row.reason, row.unit)
        return found

    def samples(self, machine: str, measurement: str, from_ms: int, to_ms: int) -> list[SampleRow]:
        """All samples of a machine in a stretch."""
        return list(self._samples(machine, None, (measurement,), from_ms, to_ms))

    def answer(self, query: Query) -> Answered:
        """Return the answer to a question."""
        answered = Answered({}, {}, self._units(query))
        if query.every_ms is None:
            self._fill(answered.rows, query, query.from_ms, query.to_ms)
            return answered
        every_ms = query.every_ms
        first_ms = -(-query.from_ms // every_ms) * every_ms
        last_ms = query.to_ms // every_ms * every_ms
        cut = [(query.from_ms, query.to_ms)]
        if first_ms < last_ms:
            cut = [(query.from_ms, first_ms), (last_ms, query.to_ms)]
            for start in range(first_ms, last_ms, every_ms * _WINDOWS_AT_ONCE):
                self._windows(answered, query, start, min(start + every_ms * _WINDOWS_AT_ONCE, last_ms), every_ms)
        rows: dict[str, list[SampleRow]] = {}
        for from_ms, to_ms in cut:
            if from_ms < to_ms:
                self._fill(rows, query, from_ms, to_ms)
        for signal, held in rows.items():
            answered.windows.setdefault(signal, []).extend(folded(held, every_ms))
        return answered

    def _fill(self, rows: dict[str, list[SampleRow]], query: Query, from_ms: int, to_ms: int) -> None:
        for row in self._samples(query.machine, query.signals, (RAW, DERIVED), from_ms, to_ms):
            rows.setdefault(row.key.signal, []).append(row)

    def _units(self, query: Query) -> dict[str, str | None]:
        match = _match(query.machine, query.signals, (RAW, DERIVED), "quality")
        known = self._http.get_json("/api/v1/series", {"match[]": match, "start": _EVER})["data"]
        by_signal: dict[str, set[str | None]] = defaultdict(set)
        for labels in known:
            by_signal[labels["signal"]].add(labels.get("unit"))
        units = {signal: min(told, key=str) for signal, told in by_signal.items() if len(told) == 1}
        if several := [signal for signal in by_signal if signal not in units]:
            units |= {signal: sample.unit for signal, sample in self._last(query.machine, set(several), _LOOKBACKS[-1]).items()}
        return units

    def _samples(
        self, machine: str, signals: Sequence[str] | None, measurements: Sequence[str], from_ms: int, to_ms: int
    ) -> Iterator[SampleRow]:
        asked = {
            "match[]": _match(machine, signals, measurements),
            "start": f"{from_ms / 1000:.3f}",
            "end": f"{(to_ms - 1) / 1000:.3f}",
        }
        moments: dict[tuple[_Place, int], _Moment] = defaultdict(_Moment)
        for line in self._http.get("/api/v1/export", asked).splitlines():
            told = json.loads(line)
            labels = told["metric"]
            place, name = _place(labels), _field(labels["__name__"])
            for t_ms, value in zip(told["timestamps"], told["values"], strict=True):
                moments[place, t_ms].take(name, labels, value)
        for (place, t_ms), moment in moments.items():
            if moment.quality is not None:
                yield moment.row(machine, place, t_ms)

    def _windows(self, answered: Answered, query: Query, from_ms: int, to_ms: int, every_ms: int) -> None:
        asked = {
            "query": _figures(query, every_ms),
            "start": f"{(from_ms + every_ms - 1) / 1000:.3f}",
            "end": f"{(to_ms - 1) / 1000:.3f}",
            "step": f"{every_ms}ms",
            "nocache": "1",
        }
        parts: dict[str, _Part] = defaultdict(_Part)
        for series in self._results("/api/v1/query_range", asked):
            labels = series["metric"]
            told = {round(t_s * 1000) + 1 - every_ms: float(text) for t_s, text in series["values"]}
            parts[labels["signal"]].take(labels, told)
        for signal, part in parts.items():
            answered.windows.setdefault(signal, []).extend(part.windows())

    def _instant(self, query: str) -> Iterator[tuple[dict[str, str], float]]:
        asked = {"query": query, "time": f"{self._wall_s() + 300:.3f}", "nocache": "1"}
        for series in self._results("/api/v1/query", asked):
            yield series["metric"], float(series["value"][1])

    def _results(self, path: str, asked: dict[str, str]) -> list[dict[str, Any]]:
        try:
            results: list[dict[str, Any]] = self._http.get_json(path, asked, method="POST")["data"]["result"]
        except (KeyError, TypeError):
            raise StoreError(f"{self._base}{path}: the answer is not that of a VictoriaMetrics; is that one?") from None
        return results


def _figures(query: Query, every_ms: int) -> str:
    """All that is asked of each window, in one question; a label tells which is which."""

    def of(name: str) -> str:
        return f"{_match(query.machine, query.signals, (RAW, DERIVED), name)}[{every_ms}ms]"

    told = {
        "sum": f"sum(sum_over_time({of('value')})) by (signal)",
        "good": f"sum(count_over_time({of('value')})) by (signal)",
        "low": f"min(min_over_time({of('value')})) by (signal)",
        "high": f"max(max_over_time({of('value')})) by (signal)",
        "count": f"sum(count_over_time({of('quality')})) by (signal)",
        "worst": f"max(max_over_time({of('quality')})) by (signal)",
        "text": f"max(tlast_over_time({of('text')})) by (signal, text)",
        "flag": f"max(tlast_over_time({of('flag')})) by (signal, flag)",
        **{
            f"reason {c}": f"max(tlast_over_time({of('reason')}) if last_over_time({of('reason')}) == {c}) by (signal, reason)"
            for c in (1, 2)
        },
    }
    return "union(" + ", ".join(f'label_set({text}, "figure", "{name}")' for name, text in told.items()) + ")"


def _match(machine: str, signals: Sequence[str] | None, measurements: Sequence[str], name: str = "") -> str:
    names = f"({'|'.join(measurements)})_({name or '|'.join(_FIELDS)})"
    if signals is not None:
        kept = {DERIVED if signal.startswith(TWIN_PREFIX) else RAW for signal in signals}
        names = f"({'|'.join(sorted(kept & set(measurements)))})_({name or '|'.join(_FIELDS)})"
    chosen = "" if signals is None else f",signal=~{_quoted('|'.join(re.escape(signal) for signal in signals))}"
    return f'{{__name__=~"{names}",machine={_quoted(machine)}{chosen}}}'


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _place(labels: dict[str, str]) -> _Place:
    return (labels["signal"], labels["node"], labels.get("unit", ""), labels.get("nth", ""))


def _field(name: str) -> str:
    return name.rsplit("_", 1)[1]


def _told(label: str) -> str:
    return "" if label == EMPTY else label
