"""SINUMERIK servo trace, the XML that Operate saves from its menu Diagnostics (newer versions; older ones are binary).

Below the root, `traceDisplaySetup/signals` describes signals by `key`, `name` (the NCK path, as `…/vaTorqueAtMotor`) and
`description`; `traceData/dataFrame` lists its `dataSignal` by `key`, in the order of the columns, and then `rec` elements with
`time` in s and `f1`, `f2`, …: the value of signal 1, 2, … A value that did not change is absent, so it holds. A value above
2^63 - 2^52 is the pattern of no number (seen in Trace-Tools by E. Rhoden, MIT). Entities are refused, never expanded.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
import pyarrow as pa

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, Faults, Head, Piece, SourceColumn, Times

BLOCK_BYTES = 1024 * 1024
ROWS = 32_768
SIGNALS_MAX = 512
NO_NUMBER = 9.2188684372274053e18
CUT = "end of the file in the middle of the trace (what came before it is kept)"
NO_VALUE = "values that the trace marks as no number"
NOT_A_NUMBER = "values that are no numbers"
NO_TIME = "records without a time"


class _Trace:
    """The state of one pass: the signals of each frame, and the rows of the frame that is being read."""

    def __init__(self, faults: Faults | None) -> None:
        self.described: dict[str, Mapping[str, str]] = {}
        self.frames: list[list[Mapping[str, str]]] = []
        self.faults = faults
        self.pieces: list[Piece] = []
        self.rows: list[tuple[float, ...]] = []
        self.last: list[float] = []
        self.records = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if tag == "rec":
            self.records += 1
            if self.faults is not None:
                self.record(attributes)
        elif tag == "dataFrame":
            self.flush()
            self.frames.append([])
            self.last = []
        elif tag == "dataSignal" and self.frames:
            if len(self.frames[-1]) >= SIGNALS_MAX:
                raise UsageError(f"a frame has more than {SIGNALS_MAX} signals")
            self.frames[-1].append(attributes)
        elif "key" in attributes and ("name" in attributes or "description" in attributes):
            self.described.setdefault(attributes["key"], attributes)

    def record(self, attributes: dict[str, str]) -> None:
        assert self.faults is not None
        if not self.last:
            self.last = [float("nan")] * len(self.frames[-1]) if self.frames else []
        at_s = _number(attributes.pop("time", ""))
        if at_s is None:
            self.faults.count(NO_TIME)
        for name, text in attributes.items():
            if name[:1] != "f" or not name[1:].isdigit() or not 1 <= int(name[1:]) <= len(self.last):
                continue
            value = _number(text)
            if value is None:
                self.faults.count(NOT_A_NUMBER)
            elif abs(value) >= NO_NUMBER:
                self.faults.count(NO_VALUE)
                value = None
            self.last[int(name[1:]) - 1] = float("nan") if value is None else value
        if at_s is not None and self.last:
            self.rows.append((at_s, *self.last))
            if len(self.rows) >= ROWS:
                self.flush()

    def flush(self) -> None:
        """Make a piece of the rows that have come."""
        if self.rows:
            columns = np.array(self.rows, dtype=np.float64).T
            track = len(self.frames) - 1
            names = [column.name for column in _columns(self.frames, self.described) if column.track == track]
            arrays = [pa.array(values, from_pandas=True) for values in columns]
            self.pieces.append(Piece(track, dict(zip(names, arrays, strict=True))))
        self.rows = []


def _number(text: str) -> float | None:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return None if value != value else value  # noqa: PLR0124  not a number


def _refuse(*_: Any) -> None:
    raise UsageError("declares entities, which no trace needs; they are not expanded")


def _passed(path: Path, trace: _Trace) -> Iterator[Piece]:
    """Read the file once, through `trace`. Raises UsageError where it is no XML from the start."""
    parser = expat.ParserCreate()
    parser.EntityDeclHandler = _refuse
    parser.StartElementHandler = trace.start
    try:
        with path.open("rb") as file:
            while block := file.read(BLOCK_BYTES):
                parser.Parse(block, False)
                yield from trace.pieces
                trace.pieces = []
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        if not trace.records:
            raise UsageError(f"{path}: is no XML of a trace: {error}") from None
        if trace.faults is not None:
            trace.faults.count(CUT)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    trace.flush()
    yield from trace.pieces


def _columns(frames: list[list[Mapping[str, str]]], described: Mapping[str, Mapping[str, str]]) -> list[SourceColumn]:
    """Name the columns of each frame: by the end of the NCK path, or by the description, or by the key."""
    found: list[SourceColumn] = []
    for track, signals in enumerate(frames):
        found.append(SourceColumn("time" if track == 0 else f"time #{track + 1}", "s", "", track))
        for number, signal in enumerate(signals, start=1):
            known = {**described.get(signal.get("key", ""), {}), **{k: v for k, v in signal.items() if v}}
            name = known.get("name", "").rpartition("/")[2] or known.get("description") or known.get("key") or f"f{number}"
            if any(column.name == name for column in found):
                name = f"{name}#{number}" if track == 0 else f"{name}#{track + 1}.{number}"
            unit = known.get("unit") or known.get("units") or ""
            description = f"{known.get('description', '')} ({known.get('name', '')})" if "name" in known else ""
            found.append(SourceColumn(name, unit, description.replace("(64 bit)", "").strip(), track))
    return found


def _reads(path: Path, _head: Head, _options: FileOptions) -> Content:
    first = _Trace(None)
    for _ in _passed(path, first):
        pass
    if not first.records or not any(first.frames):
        raise UsageError(f"{path}: has no records (traceData/dataFrame/rec); save the trace again after it has run")
    columns = _columns(first.frames, first.described)
    tracks = tuple(Times("time" if n == 0 else f"time #{n + 1}", "s") for n in range(len(first.frames)))
    faults = Faults()
    return Content(tuple(columns), tracks, lambda: _passed(path, _Trace(faults)), faults)


DIALECT = Dialect(
    name="SINUMERIK trace",
    recognises=lambda head: re.search(r"<(\w+:)?(traceDisplaySetup|traceData|dataFrame)\b", head.text) is not None,
    reads=_reads,
    units={"mm": "mm", "deg": "deg", "torque": "N m", "A": "A", "kW": "kW", "%": "%", "rev/min": "rev/min"},
)
