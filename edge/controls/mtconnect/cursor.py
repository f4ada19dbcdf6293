"""The cursor machine of the MTConnect edge: documents of an agent in, samples out, without I/O.

    PROBE ──devices──► CURRENT ──streams──► SAMPLE ──streams──► SAMPLE …
      ▲                   ▲                   │
      └── new instance ───┼─── out of range ──┘
                                              │ another tool, or its asset has changed
                                            ASSET, and on with SAMPLE

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

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple
from urllib.parse import quote

from edge.config import EdgeConfig
from edge.controls.mtconnect.alarm import Alarm
from edge.controls.mtconnect.asset_watch import AssetWatch, watch_of
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.documents import (
    AssetsDocument,
    DevicesDocument,
    ErrorDocument,
    Header,
    StreamsDocument,
    parse_document,
)
from edge.controls.mtconnect.mapping import assign
from edge.controls.mtconnect.model import DeviceModel
from edge.controls.mtconnect.state import Cursor, Phase
from edge.controls.mtconnect.taking import alarm_samples, clock_of, is_ours, observed, take, tool_samples
from edge.controls.mtconnect.tool_asset import SIGNALS as TOOL_SIGNALS
from edge.controls.mtconnect.tool_asset import without_tool
from edge.errors import ConfigError, DocumentError
from edge.place import EDGE_RESTARTED, Place
from edge.sample import Drop, Gap, Offer, SampleSet

ATTEMPTS_BEFORE_PROBE = 3
Config = EdgeConfig[MtconnectConfig]


class Request(NamedTuple):
    """A request to the agent: a path below its address, and parameters."""

    path: str
    parameters: tuple[tuple[str, str | int], ...] = ()


def start(_config: Config) -> Cursor:
    """The cursor of an edge that has heard nothing yet."""
    return Cursor()


def place(cursor: Cursor) -> Place | None:
    """The place up to which everything is taken; None while nothing is."""
    taken = cursor.phase in (Phase.SAMPLE, Phase.ASSET) and cursor.next_sequence > 0
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
    if cursor.phase is Phase.ASSET:
        return Request(f"/asset/{quote(cursor.asset.asset_id, safe='')}")
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
        elif isinstance(document, AssetsDocument):
            after, given = _asset(cursor, document)
        elif isinstance(document, ErrorDocument):
            after, given = _error(cursor, document)
        else:
            after, given = _streams(cursor, document)
    except (DocumentError, ConfigError) as error:
        return _refused(cursor, str(error))
    return after, given if given.clock is not None else replace(given, clock=clock_of(document.header))


def _refused(cursor: Cursor, error: str) -> tuple[Cursor, SampleSet]:
    if cursor.phase is Phase.ASSET:  # it is not worth a second question
        return _on_with_samples(cursor), SampleSet(error=error, instance=cursor.instance_id or None)
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
    assignment = assign(device, config.signals, config.source.spindle, config.chosen)
    conditions = sum(item.category == "CONDITION" for item in device.items)
    watch = watch_of(device, config.source.tool_asset)
    fed = {offer.signal for offer in assignment.offers}
    alarm_signals = tuple(name for name in ("alarm", "alarms") if conditions and _is_published(config, name))
    tool_signals = tuple(name for name in TOOL_SIGNALS if watch.tool_item and name not in fed and _is_published(config, name))
    offers = assignment.offers + tuple(Offer(name, "conditions") for name in alarm_signals)
    offers += tuple(Offer(name, "asset of the tool in the spindle") for name in tool_signals)
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
        alarm_signals=alarm_signals,
        chosen=assignment.chosen,
        tool_signals=tool_signals,
        asset=watch if tool_signals else AssetWatch(),
    )
    if cursor.instance_id not in ("", document.header.instance_id):
        after = _new_instance(after, cursor, document.header)
    return after, SampleSet(offers=offers, instance=document.header.instance_id)


def _is_published(config: Config, name: str) -> bool:
    section = config.signals.get(name)
    return section is None or section.publish


def _asset(cursor: Cursor, document: AssetsDocument) -> tuple[Cursor, SampleSet]:
    """The tool in the spindle; an asset that nobody waits for says nothing."""
    if cursor.phase is not Phase.ASSET:
        return cursor, SampleSet(instance=cursor.instance_id)
    tool = next((tool for tool in document.tools if tool.id == cursor.asset.asset_id), None)
    if tool is None:
        return _no_asset(cursor, "the agent answers with another")
    samples = tuple(tool_samples(cursor, tool.outcomes(), cursor.asset))
    return _on_with_samples(cursor), SampleSet(samples, received=len(samples), instance=cursor.instance_id)


def _no_asset(cursor: Cursor, why: str) -> tuple[Cursor, SampleSet]:
    missing = without_tool(f"the asset of tool {cursor.asset.asset_id} cannot be read: {why}"[:300])
    samples = tuple(tool_samples(cursor, missing, cursor.asset, observations=0))
    return _on_with_samples(cursor), SampleSet(samples, instance=cursor.instance_id)


def _on_with_samples(cursor: Cursor) -> Cursor:
    return replace(cursor, phase=Phase.SAMPLE, asset=cursor.asset.asked())


def _new_instance(after: Cursor, before: Cursor, header: Header) -> Cursor:
    """The agent is another: its numbers start again, and what the old one had after our last request is lost.

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
    if cursor.phase is Phase.ASSET:
        return _no_asset(cursor, f"the agent answers {document}")
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
    return take(cursor, document, floor=cursor.next_sequence, next_sequence=header.next_sequence)


def _baseline(cursor: Cursor, document: StreamsDocument, next_sequence: int) -> tuple[Cursor, SampleSet]:
    wanted, first, why = cursor.next_sequence, document.header.first_sequence or 0, cursor.hole or "overrun"
    ready = replace(cursor, phase=Phase.SAMPLE, hole="", left_instance="", left_sequence=0)
    if not wanted:
        ready = replace(ready, alarms=())
    if not cursor.hole and not wanted:
        return take(ready, document, floor=0, next_sequence=next_sequence, is_baseline=True)
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
    after, samples = take(ready, document, floor=floor, next_sequence=next_sequence, is_baseline=True)
    after, samples = _alarms_anew(after, samples, document)
    low = max(wanted, 1)
    found = {o.sequence for o in document.observations if o.sequence is not None and o.sequence >= low}
    return after, replace(samples, gaps=(Gap(why, low, next_sequence - 1, max(0, next_sequence - low - len(found))),))


def _rejoin(ready: Cursor, document: StreamsDocument) -> tuple[Cursor, SampleSet]:
    """The restarted edge finds its place: what was taken before is the baseline, and what came since comes again as samples."""
    before = tuple(o for o in document.observations if o.sequence is None or o.sequence < ready.next_sequence)
    older = replace(document, observations=before)
    after, samples = take(ready, older, floor=0, next_sequence=ready.next_sequence, is_baseline=True)
    again = len(document.observations) - len(before)
    dropped = dict(samples.dropped) | ({Drop.DUPLICATE: samples.dropped.get(Drop.DUPLICATE, 0) + again} if again else {})
    return after, replace(samples, received=samples.received + again, dropped=dropped)


def _alarms_anew(cursor: Cursor, samples: SampleSet, document: StreamsDocument) -> tuple[Cursor, SampleSet]:
    """Take the active conditions as /current shows them after a hole: one that ended in it has left no other trace."""
    shown = sorted((o for o in document.observations if o.is_condition and is_ours(cursor, o)), key=lambda o: o.sequence or 0)
    readable = [o for o in shown if o.sequence is not None and o.timestamp_ms is not None]
    if not readable or not cursor.alarm_signals:
        return cursor, samples
    alarms: tuple[Alarm, ...] = ()
    for o in readable:
        alarms = observed(alarms, o)
    again = alarm_samples(cursor, alarms, readable[-1], is_baseline=True, observations=0)
    return replace(cursor, alarms=alarms), replace(samples, samples=(*samples.samples, *again))
