"""The events of a machine, out of signals over time: `{"t", "until", "kind", "text", "detail"?}`, oldest first.

An event lasts until its signal says something else; `until` is None where that is still so at the end. Of what was so before the
stretch began nothing is known: an event begins with the first sample in it.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from cnctwin.api.live.documents import DocumentError, read_object
from cnctwin.api.live.trace import Sample
from processors.alarms import alarm_signals
from processors.description import DescriptionMessage, Role
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

TEXTS = {
    "exec_state": "execution",
    "program": "program",
    "alarm": "alarm",
    twin_signals.STOP_REASON: "stop",
}
FLAGS = {"tool_change_active": ("tool_change", "tool change")}
NOTHING = frozenset({"", "none", "NORMAL", "UNAVAILABLE"})
EVENTS_MAX = 5000
Event = dict[str, Any]


def event_signals(known: Iterable[str]) -> tuple[str, ...]:
    """Those of a machine's signals that tell events."""
    telling = {*TEXTS, *FLAGS, *alarm_signals(), twin_signals.PART_RECORD, "tool_number"}
    return tuple(sorted(name for name in known if name in telling))


def events_of(samples: Mapping[str, Sequence[Sample]]) -> list[Event]:
    """The events in these signals.

    >>> ran = [Sample(0, "ACTIVE", 192, None), Sample(60_000, "READY", 192, None)]
    >>> [(one["t"], one["until"], one["text"]) for one in events_of({"exec_state": ran})]
    [(0, 60000, 'ACTIVE'), (60000, None, 'READY')]
    """
    events: list[Event] = []
    for signal, held in samples.items():
        if signal in TEXTS:
            events += _stretches(TEXTS[signal], held, str)
        elif signal in FLAGS:
            kind, text = FLAGS[signal]
            events += _stretches(kind, held, lambda value, text=text: text if value is True else "")
        elif signal == twin_signals.PART_RECORD:
            events += _parts(held)
        elif signal == twin_signals.CONTROL_ALARM and "alarm" in samples:
            continue  # the control's own text is told already
        elif signal == "tool_number":
            if "tool_change_active" not in samples:
                events += [_event(one, "tool_change", f"tool {one.value}") for one in _changes(held) if one.value is not None]
        else:
            name = signal.removeprefix(twin_signals.TWIN_PREFIX).removeprefix("rule_").replace("_", " ")
            events += _stretches("alarm", held, lambda value, name=name: name if value is True else "")
    events += _holes(samples.get("exec_state", ()))
    return sorted(events, key=lambda one: (one["t"], one["kind"]))


def part_records(held: Iterable[Sample]) -> list[dict[str, Any]]:
    """The as-built records among the values of their signal, newest first; what is no record is passed over."""
    found = {}
    for sample in held:
        record = _parsed(sample.value)
        if record is not None:
            found[json.dumps(record, sort_keys=True)] = {**record, "t": sample.t_ms}
    return list(reversed(found.values()))


def description_text(role: Role, message: DescriptionMessage | None) -> str:
    """Return a change of a machine's description in words.

    >>> description_text(Role.LIVE, DescriptionMessage(version="3f2a", toml="", step="promoted", by="anna", why="it fits"))
    'description 3f2a live: promoted by anna: it fits'
    """
    if message is None:
        return f"no {role} description any more"
    how = " ".join(filter(None, (message.step, f"by {message.by}" if message.by else "")))
    return ": ".join(filter(None, (f"description {message.version} {role}", how, message.why)))


def _stretches(kind: str, held: Sequence[Sample], text_of: Any) -> Iterator[Event]:
    """One event for each stretch in which the signal tells the same."""
    current: Event | None = None
    for sample in held:
        if sample.quality == Quality.STALE:
            continue  # what was so may be so still
        text = "" if sample.value is None or sample.quality != Quality.GOOD else text_of(sample.value)
        text = "" if text in NOTHING else text
        if current is not None:
            if text == current["text"]:
                continue
            current["until"] = sample.t_ms
            yield current
            current = None
        if text:
            current = _event(sample, kind, text)
    if current is not None:
        yield current


def _holes(held: Sequence[Sample]) -> Iterator[Event]:
    """Yield the stretches in which the machine was not heard: its control's state was marked stale."""
    current: Event | None = None
    for sample in held:
        if sample.quality == Quality.STALE:
            current = current or _event(sample, "hole", sample.reason or "not heard")
        elif current is not None:
            current["until"] = sample.t_ms
            yield current
            current = None
    if current is not None:
        yield current


def _changes(held: Sequence[Sample]) -> Iterator[Sample]:
    """The samples that differ from the one before; the first one is no change."""
    known = [sample for sample in held if sample.quality == Quality.GOOD]
    for before, sample in pairwise(known):
        if sample.value != before.value:
            yield sample


def _parts(held: Sequence[Sample]) -> Iterator[Event]:
    for record in reversed(part_records(held)):
        text = f"part made: {record.get('program') or 'unknown program'}"
        yield {"t": record["t"], "until": None, "kind": "part", "text": text, "detail": record}


def _event(sample: Sample, kind: str, text: str) -> Event:
    return {"t": sample.t_ms, "until": None, "kind": kind, "text": text}


def _parsed(value: object) -> dict[str, Any] | None:
    if not isinstance(value, str):
        return None
    try:
        return read_object(value.encode("utf-8", "replace"))
    except DocumentError:
        return None
