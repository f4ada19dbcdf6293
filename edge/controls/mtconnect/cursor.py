"""The cursor machine of the MTConnect edge: documents of an agent in, samples out, without I/O.

    PROBE ──devices──► CURRENT ──streams──► SAMPLE ──streams──► SAMPLE …
      ▲                   ▲                   │
      └── new instance ───┼─── out of range ──┘

Each observation is taken once, by its sequence number, so a document that comes twice gives nothing new. What is asked for next
always starts at the header's nextSequence, never at the last element, which in a document grouped by component is rarely the
newest.

Recovery. When the agent has dropped what we want (OUT_OF_RANGE, or a header whose firstSequence is beyond it), or when it is
another instance, the next document asked for is /current. If the same instance still has what we want, we resume there and
nothing is lost. Otherwise the values of /current that we have not seen are taken as the new baseline, the rest of the range is
counted as lost, and sampling resumes at its nextSequence. On an agent with several devices the range holds theirs too, so the
count is an upper bound.

An edge that was killed and started again knows its place (`resume`) but none of the values. What /current shows from before
that place is then its baseline, and sampling resumes at the place; what the agent has dropped of it is a hole like any other.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple
from urllib.parse import quote

from edge.config import EdgeConfig
from edge.controls.mtconnect.alarm import Alarm, all_unavailable, observe, text_of
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.documents import (
    DevicesDocument,
    ErrorDocument,
    Header,
    Observation,
    StreamsDocument,
    parse_document,
)
from edge.controls.mtconnect.mapping import assign
from edge.controls.mtconnect.model import DeviceModel
from edge.errors import ConfigError, DocumentError
from edge.place import EDGE_RESTARTED, Place
from edge.reading import Target, read
from edge.sample import UNAVAILABLE, ClockReading, Drop, EdgeSample, Gap, Offer, SampleSet
from sparkplug.quality import Quality

ATTEMPTS_BEFORE_PROBE = 3
DOCUMENT_MS_MAX = 500  # from its making to the edge, for most documents; those that take longer are outvoted
Config = EdgeConfig[MtconnectConfig]


class Phase(StrEnum):
    """The document that is asked for next."""

    PROBE = "probe"
    CURRENT = "current"
    SAMPLE = "sample"


@dataclass(frozen=True, slots=True)
class Cursor:
    """The parser's position. `hole` is why a baseline is needed, "" where none is; `attempt` counts refused frames in a row.

    left_instance, left_sequence: the place that was given up for another instance, as long as nothing of that one was taken
    """

    phase: Phase = Phase.PROBE
    instance_id: str = ""
    next_sequence: int = 0
    buffer_size: int = 0
    device_name: str = ""
    device_uuid: str = ""
    targets: tuple[Target, ...] = ()
    availability_id: str = ""
    conditions: int = 0
    alarms: tuple[Alarm, ...] = ()
    publishes_alarm: bool = True
    hole: str = ""
    attempt: int = 0
    left_instance: str = ""
    left_sequence: int = 0


class Request(NamedTuple):
    """A request to the agent: a path below its address, and parameters."""

    path: str
    parameters: tuple[tuple[str, str | int], ...] = ()


def start(_config: Config) -> Cursor:
    """The cursor of an edge that has heard nothing yet."""
    return Cursor()


def place(cursor: Cursor) -> Place | None:
    """The place up to which everything is taken; None while nothing is."""
    taken = cursor.phase is Phase.SAMPLE and cursor.next_sequence > 0
    return Place(cursor.instance_id, cursor.next_sequence) if taken else None


def resume(_config: Config, kept: Place) -> Cursor:
    """The cursor of an edge that was here before."""
    return Cursor(instance_id=kept.instance, next_sequence=kept.next_sequence, hole=EDGE_RESTARTED)


def next_request(config: Config, cursor: Cursor, *, streams: bool = True) -> Request:
    """Return what to ask for next. The count never exceeds the agent's buffer, which would be OUT_OF_RANGE."""
    if cursor.phase is Phase.PROBE:
        return Request("/probe")
    device = quote(cursor.device_name or cursor.device_uuid, safe="")
    if cursor.phase is Phase.CURRENT:
        return Request(f"/{device}/current")
    count = min(config.source.count, cursor.buffer_size or config.source.count)
    parameters: tuple[tuple[str, str | int], ...] = (("from", cursor.next_sequence), ("count", count))
    if streams:
        parameters += (("interval", config.source.interval_ms), ("heartbeat", config.source.heartbeat_ms))
    return Request(f"/{device}/sample", parameters)


def parse(config: Config, cursor: Cursor, raw: bytes) -> tuple[Cursor, SampleSet]:
    """One document. Bytes that are none change nothing but the count of attempts."""
    try:
        document = parse_document(raw)
        if isinstance(document, DevicesDocument):
            after, given = _devices(config, cursor, document)
        elif isinstance(document, ErrorDocument):
            after, given = _error(cursor, document)
        else:
            after, given = _streams(cursor, document)
    except (DocumentError, ConfigError) as error:
        return _refused(cursor, str(error))
    return after, given if given.clock is not None else replace(given, clock=_clock(document.header))


def _clock(header: Header) -> ClockReading | None:
    """Return what the agent's clock showed; `edge.clock.offset` puts it beside the time at which the document arrived."""
    if header.created_ms is None:
        return None
    return ClockReading(header.created_ms, 0, DOCUMENT_MS_MAX, header.resolution_ms)


def _refused(cursor: Cursor, error: str) -> tuple[Cursor, SampleSet]:
    attempt = cursor.attempt + 1
    phase = Phase.PROBE if attempt % ATTEMPTS_BEFORE_PROBE == 0 and cursor.phase is Phase.CURRENT else cursor.phase
    return replace(cursor, attempt=attempt, phase=phase), SampleSet(error=error, instance=cursor.instance_id or None)


def choose_device(devices: Iterable[DeviceModel], wanted: str) -> DeviceModel:
    """The device of this name or uuid, or the only one that is not the agent itself; ConfigError where it is not one."""
    machines = [device for device in devices if not device.is_agent]
    fitting = [device for device in machines if wanted in ("", device.name, device.uuid)]
    if len(fitting) == 1:
        return fitting[0]
    names = ", ".join(device.name or device.uuid for device in machines) or "none"
    if not wanted:
        raise ConfigError(f"mtconnect.device = '': the agent has {len(machines)} devices; choose one of {names}")
    raise ConfigError(f"mtconnect.device = {wanted!r}: the agent has no such device; it has {names}")


def _devices(config: Config, cursor: Cursor, document: DevicesDocument) -> tuple[Cursor, SampleSet]:
    if cursor.phase is not Phase.PROBE:
        return cursor, SampleSet(instance=cursor.instance_id)
    device = choose_device(document.devices, config.source.device)
    assignment = assign(device, config.signals, config.source.spindle)
    section = config.signals.get("alarm")
    conditions = sum(item.category == "CONDITION" for item in device.items)
    publishes_alarm = conditions > 0 and (section is None or section.publish)
    offers = assignment.offers + ((Offer("alarm", "conditions"),) if publishes_alarm else ())
    after = replace(
        cursor,
        phase=Phase.CURRENT,
        instance_id=document.header.instance_id,
        buffer_size=document.header.buffer_size or 0,
        device_name=device.name,
        device_uuid=device.uuid,
        targets=assignment.targets,
        availability_id=next((item.id for item in device.items if item.type == "AVAILABILITY"), ""),
        conditions=conditions,
        publishes_alarm=publishes_alarm,
    )
    if cursor.instance_id not in ("", document.header.instance_id):
        after = _new_instance(after, cursor, document.header)
    return after, SampleSet(offers=offers, instance=document.header.instance_id)


def _new_instance(after: Cursor, before: Cursor, header: Header) -> Cursor:
    """The agent is another: its numbers start anew, and what the old one had after our last request is lost.

    Where the one that we left answers after all, and nothing was taken in between, we go on where we were.
    """
    if before.left_instance == header.instance_id:
        back = replace(after, instance_id=header.instance_id, next_sequence=before.left_sequence, hole="overrun")
        return replace(back, left_instance="", left_sequence=0)
    if before.hole.startswith("agent restarted") or not before.next_sequence:
        return replace(after, instance_id=header.instance_id, next_sequence=0)
    why = f"agent restarted: instance {before.instance_id} ended somewhere after sequence {before.next_sequence - 1}"
    after = replace(after, instance_id=header.instance_id, next_sequence=0, hole=why)
    if before.hole == EDGE_RESTARTED:  # its place is known, but not its values
        return after
    return replace(after, left_instance=before.instance_id, left_sequence=before.next_sequence)


def _error(cursor: Cursor, document: ErrorDocument) -> tuple[Cursor, SampleSet]:
    refused, samples = _refused(cursor, f"the agent answers {document}")
    instance = document.header.instance_id
    if instance and cursor.instance_id and instance != cursor.instance_id:
        return _new_instance(replace(refused, phase=Phase.PROBE), cursor, document.header), samples
    codes = {code for code, _ in document.errors}
    if "OUT_OF_RANGE" in codes and cursor.phase is Phase.SAMPLE:
        buffer_size = document.header.buffer_size or cursor.buffer_size
        return replace(refused, phase=Phase.CURRENT, hole="overrun", buffer_size=buffer_size), samples
    if codes & {"NO_DEVICE", "INVALID_XPATH", "INVALID_URI", "INVALID_PATH"}:
        return replace(refused, phase=Phase.PROBE), samples
    return refused, samples


def _streams(cursor: Cursor, document: StreamsDocument) -> tuple[Cursor, SampleSet]:
    header = document.header
    assert header.next_sequence is not None
    if cursor.phase is Phase.PROBE:
        return _refused(cursor, "streams before the device description")
    if header.instance_id != cursor.instance_id:
        refused, samples = _refused(cursor, f"instance {header.instance_id} in place of {cursor.instance_id}")
        return _new_instance(replace(refused, phase=Phase.PROBE), cursor, header), samples
    buffer_size = header.buffer_size or cursor.buffer_size
    if (cursor.attempt, cursor.buffer_size) != (0, buffer_size):
        cursor = replace(cursor, attempt=0, buffer_size=buffer_size)
    if cursor.phase is Phase.CURRENT:
        return _baseline(cursor, document, header.next_sequence)
    sequences = [o.sequence for o in document.observations if o.sequence is not None]
    first = header.first_sequence or 0
    if first > cursor.next_sequence and min(sequences, default=first) >= first:
        # An agent that answers from the start of its buffer instead of refusing: the same hole as OUT_OF_RANGE.
        refused, samples = _refused(cursor, f"sequence {cursor.next_sequence} wanted, the agent's buffer begins at {first}")
        return replace(refused, phase=Phase.CURRENT, hole="overrun"), samples
    return _take(cursor, document, floor=cursor.next_sequence, next_sequence=header.next_sequence)


def _baseline(cursor: Cursor, document: StreamsDocument, next_sequence: int) -> tuple[Cursor, SampleSet]:
    wanted, first, why = cursor.next_sequence, document.header.first_sequence or 0, cursor.hole or "overrun"
    ready = replace(cursor, phase=Phase.SAMPLE, hole="", left_instance="", left_sequence=0)
    if not wanted:
        ready = replace(ready, alarms=())
    if not cursor.hole and not wanted:
        return _take(ready, document, floor=0, next_sequence=next_sequence, is_baseline=True)
    restarted = cursor.hole == EDGE_RESTARTED
    if restarted and first <= wanted <= next_sequence:
        return _rejoin(ready, document)
    if wanted and first <= wanted <= next_sequence:
        # Still there: resume where we were. All that this document shows comes again in the samples, or has come before.
        count = len(document.observations)
        dropped: dict[str, int] = {Drop.DUPLICATE: count} if count else {}
        backlog = next_sequence - wanted
        return ready, SampleSet(received=count, dropped=dropped, instance=cursor.instance_id, backlog=backlog)
    if wanted > next_sequence:
        why, wanted = f"sequence numbers went back from {wanted} to {next_sequence}", 0
        ready = replace(ready, next_sequence=0)
    floor = 0 if restarted else wanted  # a restarted edge has the values from before the hole to learn, too
    after, samples = _take(ready, document, floor=floor, next_sequence=next_sequence, is_baseline=True)
    after, samples = _alarms_anew(after, samples, document)
    low = max(wanted, 1)
    found = {o.sequence for o in document.observations if o.sequence is not None and o.sequence >= low}
    return after, replace(samples, gaps=(Gap(why, low, next_sequence - 1, max(0, next_sequence - low - len(found))),))


def _rejoin(ready: Cursor, document: StreamsDocument) -> tuple[Cursor, SampleSet]:
    """The restarted edge finds its place: what was taken before is the baseline, and what came since comes again as samples."""
    before = tuple(o for o in document.observations if o.sequence is None or o.sequence < ready.next_sequence)
    older = replace(document, observations=before)
    after, samples = _take(ready, older, floor=0, next_sequence=ready.next_sequence, is_baseline=True)
    again = len(document.observations) - len(before)
    dropped = dict(samples.dropped) | ({Drop.DUPLICATE: samples.dropped.get(Drop.DUPLICATE, 0) + again} if again else {})
    return after, replace(samples, received=samples.received + again, dropped=dropped)


def _alarms_anew(cursor: Cursor, samples: SampleSet, document: StreamsDocument) -> tuple[Cursor, SampleSet]:
    """Take the active conditions as /current shows them after a hole: one that ended in it has left no other trace."""
    shown = sorted((o for o in document.observations if o.is_condition and _is_ours(cursor, o)), key=lambda o: o.sequence or 0)
    readable = [o for o in shown if o.sequence is not None and o.timestamp_ms is not None]
    if not readable or not cursor.publishes_alarm:
        return cursor, samples
    alarms: tuple[Alarm, ...] = ()
    for o in readable:
        alarms = observe(alarms, o.data_item_id, o.element, o.native_code, o.value)
    anew = replace(_alarm_sample(alarms, cursor.conditions, readable[-1], is_baseline=True), observations=0)
    return replace(cursor, alarms=alarms), replace(samples, samples=(*samples.samples, anew))


def _take(
    cursor: Cursor, document: StreamsDocument, *, floor: int, next_sequence: int, is_baseline: bool = False
) -> tuple[Cursor, SampleSet]:
    """The observations from `floor` on, each once, in the order of their sequence."""
    targets = {target.data_item_id: target for target in cursor.targets}
    dropped: Counter[str] = Counter()
    taken: list[EdgeSample] = []
    alarms, seen, newest, available = cursor.alarms, set[int](), None, None
    for observation in sorted(document.observations, key=lambda o: o.sequence or 0):
        sequence, time_ms = observation.sequence, observation.timestamp_ms
        if sequence is None or time_ms is None:
            dropped[Drop.UNPARSABLE] += 1
            continue
        if sequence < floor or sequence in seen:
            dropped[Drop.DUPLICATE] += 1
            continue
        seen.add(sequence)
        if not _is_ours(cursor, observation):
            dropped[Drop.OTHER_DEVICE] += 1
            continue
        newest = time_ms if newest is None else max(newest, time_ms)
        target = targets.get(observation.data_item_id)
        if observation.data_item_id == cursor.availability_id:
            available = observation.value != "UNAVAILABLE"
        if observation.is_condition and cursor.publishes_alarm:
            alarms = observe(alarms, observation.data_item_id, observation.element, observation.native_code, observation.value)
            taken.append(_alarm_sample(alarms, cursor.conditions, observation, is_baseline))
        elif target is None or observation.is_condition:
            dropped[Drop.UNMAPPED] += 1
        else:
            taken.append(_sample(target, observation, is_baseline))
    after = replace(cursor, alarms=alarms, next_sequence=max(floor, next_sequence, max(seen, default=-1) + 1))
    backlog = max(0, (document.header.last_sequence or 0) + 1 - after.next_sequence)
    received = len(document.observations)
    return after, SampleSet(
        tuple(taken),
        received=received,
        dropped=dict(dropped),
        instance=cursor.instance_id,
        backlog=backlog,
        newest_ms=newest,
        available=available,
        clock=_clock(document.header),
    )


def _is_ours(cursor: Cursor, observation: Observation) -> bool:
    if observation.device_uuid and cursor.device_uuid:
        return observation.device_uuid == cursor.device_uuid
    return observation.device_name == cursor.device_name


def _sample(target: Target, observation: Observation, is_baseline: bool) -> EdgeSample:
    assert observation.sequence is not None
    assert observation.timestamp_ms is not None
    value, quality, reason = read(target, observation.value)
    if observation.has_entries and observation.value != "UNAVAILABLE":
        value, quality, reason = None, Quality.BAD, "several values in one observation"
    return EdgeSample(
        target.signal, value, observation.timestamp_ms, quality, reason, observation.sequence, is_baseline=is_baseline
    )


def _alarm_sample(alarms: tuple[Alarm, ...], conditions: int, observation: Observation, is_baseline: bool) -> EdgeSample:
    assert observation.sequence is not None
    assert observation.timestamp_ms is not None
    unknown = all_unavailable(alarms, conditions)
    return EdgeSample(
        "alarm",
        None if unknown else text_of(alarms),
        observation.timestamp_ms,
        Quality.BAD if unknown else Quality.GOOD,
        UNAVAILABLE if unknown else None,
        observation.sequence,
        is_baseline=is_baseline,
    )
