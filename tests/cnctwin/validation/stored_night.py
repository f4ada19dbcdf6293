"""A night in a real store: what the edge told, and what the twin's own processors said of it, by their own folds."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from processors.actions import Declare, Publish
from processors.discovery import find
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId, Reading
from sparkplug.quality import Quality
from twin.runlog import RunLog

EDGE = NodeId("cnc", "edge-vmc")
BATCH = 5000
UNITS = {"spindle_rpm": "rev/min", "spindle_load_pct": "%", "ambient_temp_c": "°C", "spindle_temp_c": "°C"}
DIGITS = {"spindle_temp_c": 1, "ambient_temp_c": 1, "spindle_load_pct": 1, "spindle_rpm": 0}


def told(log: RunLog, at_s: float, machine: str = "vmc") -> Iterator[HostEvent]:
    """The messages of an edge: a birth, then what has changed, as a control shows it."""
    known: dict[str, Any] = {}
    names = [*log.columns, *log.text]
    rows = zip(*(log.columns[name].tolist() for name in log.columns), *(list(log.text[name]) for name in log.text), strict=True)
    for t_s, row in zip(log.t_s.tolist(), rows, strict=True):
        now = {
            name: round(value, DIGITS.get(name, 3)) if isinstance(value, float) else value
            for name, value in zip(names, row, strict=True)
            if value is not None and value == value
        }
        news = {name: value for name, value in now.items() if known.get(name) != value}
        if news:
            stamp_ms = round(1000.0 * (at_s + t_s))
            readings = tuple(Reading(n, v, stamp_ms, Quality.GOOD, UNITS.get(n), None, False) for n, v in news.items())
            yield HostEvent(EventKind.DATA if known else EventKind.BIRTH, EDGE, machine, stamp_ms, readings)
        known |= news


def twin_told(events: Sequence[HostEvent], names: Sequence[str], tables: Mapping[str, Mapping[str, Any]]) -> Iterator[HostEvent]:
    """Each event, and behind it what the processors say of it."""
    folds = [find(name) for name in names]
    engines = [(fold.node, Engine(fold, fold.configured(tables.get(fold.name)))) for fold in folds]
    for event in events:
        yield event
        for name, engine in engines:
            node = NodeId("cnc", name)
            for action in engine.feed(event, event.timestamp_ms / 1000.0):
                if isinstance(action, Declare):
                    yield _said(EventKind.BIRTH, node, event, action.machine, action.latest)
                elif isinstance(action, Publish):
                    yield _said(EventKind.DATA, node, event, action.machine, action.changes)


def _said(kind: EventKind, node: NodeId, event: HostEvent, machine: str, changes: Sequence[Change]) -> HostEvent:
    readings = tuple(Reading(c.name, c.value, c.timestamp_ms, c.quality, None, c.reason, c.is_historical) for c in changes)
    return HostEvent(kind, node, machine, event.timestamp_ms, readings)


def stored(folder: Path, events: Sequence[HostEvent]) -> Path:
    """All of it in a store; its folder."""
    store = open_store(folder, writable=True)
    try:
        messages = [Message(event.timestamp_ms, event) for event in events]
        for start in range(0, len(messages), BATCH):
            store.append(messages[start : start + BATCH])
    finally:
        store.close()
    return folder
