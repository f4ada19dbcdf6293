"""The frames of an OPC UA server as samples: deliveries of a subscription in the order of their own time stamps.

The connection names each value by the signal that it stands for (`edge.controls.opcua.point`), or `tool:<n>:<field>` where the
tool in the spindle has to be found from where each tool is; events keep their own keys (`edge.controls.opcua.event`). Everything
else happens here: words, units, plausibility.
"""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import NamedTuple

from edge.chosen import Chosen
from edge.controls.opcua.alarm_samples import KEYS, Heard, told
from edge.controls.opcua.config import Config, is_published, points_of
from edge.controls.opcua.point import TOOL, UNIT, Point
from edge.controls.opcua.spindle_tool import Tools, in_spindle
from edge.controls.opcua.spindle_tool import told as tool_told
from edge.controls.opcua.tool_life import TOOL_LIFE, Limits, counted_up, life_samples, noted
from edge.errors import ConfigError
from edge.place import Place
from edge.reading import Target, bad, read_value
from edge.sample import EMPTY, Drop, EdgeSample, Offer, SampleSet, observations_of
from edge.signals import signal
from edge.sweep import Fact, Sweep, SweepPosition, take
from edge.units import conversion
from sparkplug.quality import Quality

MEANINGS_MAX = 4096
ALARM = "alarm"
NOT_MONITORED = "limit 0: not monitored at the control"


@dataclass(frozen=True, slots=True)
class Meaning:
    """The meaning of one key's values; `fault`: why there is none."""

    target: Target
    words: tuple[tuple[str, str], ...] = ()
    prefix: str = ""
    source: str = ""
    native_unit: str = ""
    unit: str = ""
    counts_down_from: str = ""
    fault: str = ""

    @property
    def offer(self) -> Offer:
        """Return what the birth certificate says of it."""
        one = self.target
        return Offer(one.signal, self.source, self.native_unit, one.low, one.high, self.unit, one.kind)


@dataclass(frozen=True, slots=True)
class Cursor:
    """The parser's position; the meanings of this life's keys; the tools, and the one published last ("?" = none yet).

    units: those that the server states of what the configuration chose, by signal
    tool_ms: since when it is that one
    heard: events and the alarms from them; alarm_variable: the last value of the variable that tells an alarm where no event does
    limits: the last values of signals from which others count down; life: signals of a tool's life that were published
    """

    position: SweepPosition = field(default_factory=SweepPosition)
    meanings: tuple[Meaning, ...] = ()
    unmapped: tuple[str, ...] = ()
    units: tuple[tuple[str, str], ...] = ()
    tools: Tools = ()
    tool: str = "?"
    tool_ms: int = 0
    heard: Heard = field(default_factory=Heard)
    alarm_variable: Fact | None = None
    limits: Limits = ()
    life: tuple[str, ...] = ()


class _Both(NamedTuple):
    """The samples of a frame: of variables, and of events."""

    values: tuple[EdgeSample, ...]
    events: tuple[EdgeSample, ...]


def start(_config: Config) -> Cursor:
    """The cursor of an edge that has heard nothing yet."""
    return Cursor()


def place(cursor: Cursor) -> Place | None:
    """The time up to which everything is taken; None while nothing is."""
    return cursor.position.place()


def resume(_config: Config, kept: Place) -> Cursor:
    """The cursor of an edge that was here before."""
    return Cursor(position=SweepPosition.resumed(kept))


def parse(config: Config, cursor: Cursor, raw: bytes) -> tuple[Cursor, SampleSet]:
    """One frame."""
    taken = take(cursor.position, raw)
    sweep = taken.sweep
    if sweep is None:
        return replace(cursor, position=taken.position), taken.about
    is_new = sweep.life != cursor.position.life
    before = Cursor() if is_new else cursor
    spoken_facts = [fact for fact in sweep.facts if fact.key in KEYS]
    values = tuple(fact for fact in sweep.facts if fact.key not in KEYS)
    after = _learned(config, replace(before, position=taken.position), values)
    spoken = told(after.heard, spoken_facts, sweep.t_ms, sweep.number)
    after, found, dropped = _samples(config, after, replace(sweep, facts=values), taken.is_baseline)
    of_all = Counter(dropped) + spoken.dropped
    gave_up = after.heard.is_authority and not spoken.heard.is_authority
    after = replace(after, heard=spoken.heard)
    both = _Both(found, _published(config, spoken.samples, of_all))
    after, samples = _one_alarm(config, after, sweep, both=both, dropped=of_all, gave_up=gave_up)
    if not taken.is_baseline:
        samples = tuple(sorted(samples, key=lambda sample: sample.timestamp_ms))
    offers = _offers(config, after) if is_new or _offered(after) != _offered(before) else None
    return after, replace(taken.about, samples=samples, dropped=dict(+of_all), offers=offers)


def _offered(cursor: Cursor) -> tuple[object, ...]:
    """Return what the offers depend on."""
    return cursor.meanings, cursor.life, bool(cursor.tools), cursor.heard.offers(), cursor.heard.is_authority


def _published(config: Config, events: tuple[EdgeSample, ...], dropped: Counter[str]) -> tuple[EdgeSample, ...]:
    """Return the samples of events that the configuration does not keep back."""
    hidden = tuple(sample for sample in events if not is_published(config, sample.signal))
    dropped[Drop.UNMAPPED] += observations_of(hidden)
    return tuple(sample for sample in events if sample not in hidden)


def _one_alarm(
    config: Config, cursor: Cursor, sweep: Sweep, *, both: _Both, dropped: Counter[str], gave_up: bool
) -> tuple[Cursor, tuple[EdgeSample, ...]]:
    """Let one source tell the signal `alarm`: the events where they tell all alarms, else the variable where the map has one.

    gave_up: the events have just turned out not to tell all
    """
    newest = next((fact for fact in reversed(sweep.facts) if fact.key == ALARM), None)
    after = replace(cursor, alarm_variable=newest or cursor.alarm_variable)
    variable = _alarm_variable(config, after)
    if variable is None:
        superseded = tuple(sample for sample in both.values if sample.signal == ALARM)
        dropped[Drop.EVIDENCE] += observations_of(superseded)
        return after, (*(sample for sample in both.values if sample not in superseded), *both.events)
    shown = tuple(sample for sample in both.events if sample.signal != ALARM)
    kept = cursor.alarm_variable if gave_up and newest is None else None
    again = () if kept is None else (replace(_sample(variable, kept, sweep), observations=0),)
    return after, (*both.values, *again, *shown)


def _alarm_variable(config: Config, cursor: Cursor) -> Meaning | None:
    """Return the variable that tells the signal `alarm`; None where the events do, or where there is none."""
    section = config.signals.get(ALARM)
    if cursor.heard.is_authority and not (section and section.data_item):
        return None
    return next((meaning for meaning in cursor.meanings if meaning.target.signal == ALARM), None)


def _learned(config: Config, cursor: Cursor, facts: Iterable[Fact]) -> Cursor:
    """Return what keys mean that have not come before in this life."""
    known = {meaning.target.data_item_id for meaning in cursor.meanings} | set(cursor.unmapped)
    fresh = [
        key for key in dict.fromkeys(fact.key for fact in facts) if key not in known and not _is_tool(key) and key != TOOL_LIFE
    ]
    if not fresh or len(known) + len(fresh) > MEANINGS_MAX:
        return cursor
    stated = {fact.key.removeprefix(UNIT): str(fact.value) for fact in facts if fact.key.startswith(UNIT)}
    units = dict(cursor.units) | stated
    points, found = points_of(config), list[Meaning]()
    unmapped: list[str] = []
    for key in fresh:
        meaning = _meaning(config, points, key, units.get(key, ""))
        if meaning is None:
            unmapped.append(key)
        else:
            found.append(meaning)
    meanings, left = (*cursor.meanings, *found), (*cursor.unmapped, *unmapped)
    return replace(cursor, meanings=meanings, unmapped=left, units=tuple(units.items()))


def _meaning(config: Config, points: Iterable[Point], key: str, unit: str) -> Meaning | None:
    """Return what a key's values are; `unit`: what the server states of a chosen one, which is known with its first value."""
    point = next((point for point in points if point.signal != TOOL and _stands_for(point.signal, key)), None)
    if point is None:
        return None
    try:
        known, section = signal(key), config.signals.get(key)
        native = (section.native_unit if section else "") or point.native_unit
        way = conversion(native, known.unit)
    except ConfigError:  # a name that is not canonical, of an axis with a long name for instance
        return None
    if section is not None and not section.publish:
        return None
    chosen = next((one for one in config.chosen if one.signal == key), None)
    if chosen is not None:
        return _chosen(chosen, point, key, unit)
    low = section.low if section and section.low is not None else known.low
    high = section.high if section and section.high is not None else known.high
    scale = point.scale * (section.scale if section else 1.0)
    is_left = bool(point.counts_down_from)  # what is left of a life may be below zero
    target = Target(key, key, way.factor * scale, way.offset, None if is_left else low, None if is_left else high)
    words = tuple(point.words.items())
    return Meaning(target, words, point.prefix, point.label, native, counts_down_from=point.counts_down_from)


def _chosen(chosen: Chosen, point: Point, key: str, unit: str) -> Meaning:
    try:
        return Meaning(chosen.target(key, unit), source=point.label, native_unit=unit, unit=chosen.unit)
    except ConfigError as error:
        return Meaning(chosen.target(key), source=point.label, native_unit=unit, unit=chosen.unit, fault=str(error))


def _stands_for(template: str, key: str) -> bool:
    return re.fullmatch(re.escape(template).replace(re.escape("{name}"), r"[a-z]\d{0,2}"), key) is not None


def _offers(config: Config, cursor: Cursor) -> tuple[Offer, ...]:
    offers = {meaning.target.signal: meaning.offer for meaning in cursor.meanings}
    if cursor.tools:
        offers["tool_number"] = Offer("tool_number", "ToolType/Location")
    offers |= {name: Offer(name, "ToolType/ToolLife") for name in cursor.life}
    for offer in cursor.heard.offers():
        is_ours = offer.signal not in offers or (offer.signal == ALARM and _alarm_variable(config, cursor) is None)
        if is_ours and is_published(config, offer.signal):
            offers[offer.signal] = offer
    return tuple(offers.values())


def _samples(
    config: Config, cursor: Cursor, sweep: Sweep, is_baseline: bool
) -> tuple[Cursor, tuple[EdgeSample, ...], dict[str, int]]:
    """The facts in the order of their time stamps. What is found on joining is one state: its tools are looked at once."""
    meanings = {meaning.target.data_item_id: meaning for meaning in cursor.meanings}
    limiting = {meaning.counts_down_from for meaning in cursor.meanings}
    dropped: Counter[str] = Counter()
    samples: list[EdgeSample] = []
    ordered = sorted(sweep.facts, key=lambda fact: sweep.t_ms if fact.t_ms is None else fact.t_ms)
    moments = [ordered] if is_baseline else [list(group) for _, group in groupby(ordered, key=lambda fact: fact.t_ms)]
    for moment in moments:
        placed = [fact for fact in moment if _is_tool(fact.key)]
        if placed:
            cursor, sample = _tool(config, cursor, placed, sweep)
            dropped[Drop.UNCHANGED] += len(placed) - (0 if sample is None else 1)
            samples += [] if sample is None else [sample]
        for fact in moment:
            if fact.key == TOOL_LIFE:
                stamp_ms = max(fact.t_ms or cursor.tool_ms or sweep.t_ms, cursor.tool_ms)  # not before the tool came
                found = life_samples(fact, cursor.life, stamp_ms)
                found = tuple(sample for sample in found if is_published(config, sample.signal))
                cursor = replace(cursor, life=tuple(sorted({*cursor.life, *(sample.signal for sample in found)})))
                dropped[Drop.UNMAPPED] += 1 - observations_of(found)
                samples += found
                continue
            meaning = meanings.get(fact.key)
            if meaning is not None:
                sample = counted_up(_sample(meaning, fact, sweep), meaning.counts_down_from, cursor.limits)
                cursor = replace(cursor, limits=noted(cursor.limits, sample)) if sample.signal in limiting else cursor
                samples.append(sample)
            elif not _is_tool(fact.key):
                dropped[Drop.UNMAPPED] += 1
    marked = tuple(replace(sample, is_baseline=is_baseline) for sample in samples)
    return cursor, marked, dict(+dropped)


def _sample(meaning: Meaning, fact: Fact, sweep: Sweep) -> EdgeSample:
    at_ms = sweep.t_ms if fact.t_ms is None else fact.t_ms
    why = fact.fault or meaning.fault
    value, quality, reason = bad(why) if why else read_value(meaning.target, _worded(meaning, fact))
    if reason == EMPTY and fact.value == 0 and meaning.target.signal.startswith("tool_life_limit"):
        reason = NOT_MONITORED
    return EdgeSample(meaning.target.signal, value, at_ms, quality, reason, sweep.number)


def _worded(meaning: Meaning, fact: Fact) -> str | int | float | bool | None:
    value = fact.value
    if isinstance(value, float) and value.is_integer() and meaning.words:
        value = int(value)
    if value is not None:
        value = dict(meaning.words).get(str(value), value)
    if isinstance(value, str) and meaning.prefix:
        value = value.strip().removeprefix(meaning.prefix)
    return value


def _is_tool(key: str) -> bool:
    return key.startswith(TOOL + ":")


def _tool(config: Config, cursor: Cursor, placed: Iterable[Fact], sweep: Sweep) -> tuple[Cursor, EdgeSample | None]:
    """The tool in the spindle after these values of tools; None where it is the same as before."""
    tools, at_ms = cursor.tools, sweep.t_ms
    for fact in placed:
        index, field = _tool_key(fact.key)
        tools = tool_told(tools, index, field, None if fact.fault else fact.value)
        at_ms = sweep.t_ms if fact.t_ms is None else fact.t_ms
    number, is_known = in_spindle(tools, config.source.spindle_place)
    shown = str(number) if number is not None else ("" if is_known else "unknown")
    after = replace(cursor, tools=tools, tool=shown)
    if shown == cursor.tool:
        return after, None
    after = replace(after, tool_ms=at_ms)
    if not is_known:
        why = f"no one tool is at the place {config.source.spindle_place!r}"
        return after, EdgeSample("tool_number", None, at_ms, Quality.BAD, why, sweep.number)
    return after, EdgeSample("tool_number", number, at_ms, Quality.GOOD, EMPTY if number is None else None, sweep.number)


def _tool_key(key: str) -> tuple[int, str]:
    _, _, rest = key.partition(":")
    index, _, field = rest.partition(":")
    return (int(index) if index.isascii() and index.isdigit() and len(index) < 6 else -1), field
