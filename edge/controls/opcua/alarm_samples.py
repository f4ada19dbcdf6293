"""The facts of events as samples: `alarms`, `alarm` and `operator_message`, and how each fact fared.

Nothing of a refresh is published before it has ended: what it repeats piece by piece is one state as found.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import NamedTuple

from edge.alarm_list import ListedAlarm, alarms_text
from edge.controls.opcua.alarm_table import Alarm, AlarmTable, Phase, fold, listed, text_of
from edge.controls.opcua.event import EVENT, EVENTS, REFRESH, Event, Kind
from edge.sample import Drop, EdgeSample, Offer
from edge.sweep import Fact
from sparkplug.quality import Quality

CALENDAR_END_MS = 253_402_300_800_000  # the year 10,000
KEYS = frozenset({EVENT, EVENTS, REFRESH})
_REFRESH = {Kind.REFRESH_START, Kind.REFRESH_END}


@dataclass(frozen=True, slots=True)
class Heard:
    """The events so far: from which node they come, and the alarms that they amount to."""

    source: str = ""
    table: AlarmTable = field(default_factory=AlarmTable)

    @property
    def is_authority(self) -> bool:
        """Return True if the events tell all alarms, or are about to: then no variable has to."""
        return self.table.phase in (Phase.ASKED, Phase.WHOLE)

    def offers(self) -> tuple[Offer, ...]:
        """Return what events offer beside the variables of a map; of a source that refused, the signal with the reason."""
        if not self.source:
            return (Offer("alarms", "events"),) if self.table.why_not else ()
        return tuple(Offer(name, f"events of {self.source}") for name in ("alarm", "alarms", "operator_message"))


class Told(NamedTuple):
    """The outcome of the facts of one frame."""

    heard: Heard
    samples: tuple[EdgeSample, ...]
    dropped: Counter[str]


def told(heard: Heard, facts: Iterable[Fact], frame_ms: int, number: int) -> Told:
    """Take these facts, in the order in which they came; their samples never go back in time."""
    samples: list[EdgeSample] = []
    dropped: Counter[str] = Counter()
    at_ms = 0
    for fact in facts:
        own_ms = frame_ms if fact.t_ms is None else fact.t_ms
        at_ms = max(at_ms, own_ms) if fact.key == EVENT else at_ms
        after, news, drop = _one(heard, fact, own_ms, at_ms)
        if drop is not None:
            dropped[drop] += 1
        samples += [replace(sample, sequence=number) for sample in news]
        heard = after
    return Told(heard, tuple(samples), dropped)


def _one(heard: Heard, fact: Fact, own_ms: int, at_ms: int) -> tuple[Heard, tuple[EdgeSample, ...], Drop | None]:
    table = heard.table
    if fact.key == EVENTS and isinstance(fact.value, str) and fact.value:
        return Heard(fact.value, AlarmTable(Phase.ASKED, table.alarms)), (), Drop.EVIDENCE
    if fact.key in (EVENTS, REFRESH):
        is_refused = fact.key == EVENTS
        phase, kept = (Phase.NONE, ()) if is_refused else (Phase.PARTIAL, table.alarms)
        after = Heard("" if is_refused else heard.source, AlarmTable(phase, kept, why_not=fact.fault or "no reason given"))
        return after, _samples(after, own_ms, is_baseline=True), None
    event = Event.read(fact)
    if event is None:
        return heard, (), Drop.UNPARSABLE
    if event.kind is Kind.MESSAGE:
        message = EdgeSample("operator_message", " ".join(filter(None, (event.code, event.text))), at_ms)
        return (heard, (message,), None) if message.value else (heard, (), Drop.UNMAPPED)
    if event.kind is not Kind.CONDITION and event.kind not in _REFRESH:
        return heard, (), Drop.UNMAPPED
    after = replace(heard, table=fold(table, event, own_ms))
    if event.kind is Kind.REFRESH_END:
        return after, _samples(after, at_ms, is_baseline=True), None
    if after.table.phase not in (Phase.WHOLE, Phase.PARTIAL) or after.table.unconfirmed is not None:
        return after, (), Drop.EVIDENCE
    if after.table == table:
        return after, (), Drop.UNCHANGED
    return after, _samples(after, at_ms, is_baseline=False), None


def _samples(heard: Heard, at_ms: int, *, is_baseline: bool) -> tuple[EdgeSample, ...]:
    """Return both signals; where alarms may be missing and none is known, there is nothing to show but that."""
    table = heard.table
    if table.why_not and not table.alarms:
        alarms = EdgeSample("alarms", None, at_ms, Quality.BAD, table.why_not, is_baseline=is_baseline)
        alarm = replace(alarms, signal="alarm", observations=0)
        return (alarm, alarms) if heard.source else (alarms,)
    alarms = EdgeSample("alarms", alarms_text([_listed(alarm) for alarm in listed(table)]), at_ms, is_baseline=is_baseline)
    return replace(alarms, signal="alarm", value=text_of(table), observations=0), alarms


def _listed(alarm: Alarm) -> ListedAlarm:
    return ListedAlarm(
        alarm.code or None, alarm.text or None, alarm.severity, alarm.active, alarm.acknowledged, since_text(alarm)
    )


def since_text(alarm: Alarm) -> str | None:
    """Return since when it is active, in ISO 8601; None where that is not known, or past the end of the calendar."""
    if alarm.since_ms is None or alarm.since_ms >= CALENDAR_END_MS:
        return None
    return datetime.fromtimestamp(alarm.since_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
