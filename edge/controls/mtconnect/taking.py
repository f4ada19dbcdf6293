"""From the observations of a document to samples: each once, in the order of their sequence. Pure.

The agent stamps some observations by its own clock: those of assets, and UNAVAILABLE where it lost the adapter. Where a recording
is played to an agent they are years after the machine's, so the machine's time, by which an asset is dated, leaves them out.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from edge.controls.mtconnect.alarm import Alarm, all_unavailable, list_of, observe, text_of
from edge.controls.mtconnect.asset_watch import AssetWatch
from edge.controls.mtconnect.documents import UNAVAILABLE as UNAVAILABLE_WORD
from edge.controls.mtconnect.documents import Header, Observation, StreamsDocument
from edge.controls.mtconnect.state import Cursor, Phase
from edge.controls.mtconnect.tool_asset import without_tool
from edge.reading import Outcome, Target, read
from edge.sample import UNAVAILABLE, ClockReading, Drop, EdgeSample, SampleSet
from sparkplug.quality import Quality

OF_THE_AGENT = ("AssetAdded", "AssetChanged", "AssetRemoved", "AssetCount", "AssetCountDataSet", "Unavailable")
DOCUMENT_MS_MAX = 500  # from its making to the edge, for most documents; those that take longer are outvoted


def take(
    cursor: Cursor, document: StreamsDocument, *, floor: int, next_sequence: int, is_baseline: bool = False
) -> tuple[Cursor, SampleSet]:
    """The observations from `floor` on, each once, in the order of their sequence."""
    targets = {target.data_item_id: target for target in cursor.targets}
    dropped: Counter[str] = Counter()
    taken: list[EdgeSample] = []
    alarms, asset, seen, newest, available = cursor.alarms, cursor.asset, set[int](), None, None
    machine_ms = asset.machine_ms
    for observation in sorted(document.observations, key=lambda o: o.sequence or 0):
        sequence, time_ms = observation.sequence, observation.timestamp_ms
        if sequence is None or time_ms is None:
            dropped[Drop.UNPARSABLE] += 1
            continue
        if sequence < floor or sequence in seen:
            dropped[Drop.DUPLICATE] += 1
            continue
        seen.add(sequence)
        if not is_ours(cursor, observation):
            dropped[Drop.OTHER_DEVICE] += 1
            continue
        if observation.value != UNAVAILABLE_WORD and observation.element not in OF_THE_AGENT:
            newest = machine_ms = time_ms if newest is None else max(newest, time_ms)
        if observation.data_item_id == cursor.availability_id:
            available = observation.value != UNAVAILABLE_WORD
        if observation.is_condition and cursor.alarm_signals:
            alarms = observed(alarms, observation)
            taken += alarm_samples(cursor, alarms, observation, is_baseline)
            continue
        target = targets.get(observation.data_item_id)
        samples = [] if target is None or observation.is_condition else [_sample(target, observation, is_baseline)]
        samples += _chosen(cursor, observation, is_baseline, is_counted=bool(samples))
        if not samples:
            dropped[Drop.UNMAPPED] += 1
        taken += samples
        before, asset = asset, asset.after(observation.data_item_id, observation.value, machine_ms or time_ms, sequence)
        if before.asset_id != asset.asset_id or (observation.data_item_id == asset.tool_item and not asset.asset_id):
            taken += _no_tool(cursor, asset, observation, is_baseline)
    if next_sequence >= cursor.next_sequence:  # an older document shows an older clock
        asset = asset.due(newest or asset.asked_ms if document.header.created_ms is None else document.header.created_ms)
    if asset.tool_item and newest is not None:  # what is asked for now is as of now
        asset = replace(asset, machine_ms=newest, at_ms=max(asset.at_ms, newest) if asset.is_wanted else asset.at_ms)
    phase = Phase.ASSET if asset.is_wanted and cursor.phase is Phase.SAMPLE else cursor.phase
    after = replace(
        cursor, phase=phase, asset=asset, alarms=alarms, next_sequence=max(floor, next_sequence, max(seen, default=-1) + 1)
    )
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
        clock=clock_of(document.header),
    )


def is_ours(cursor: Cursor, observation: Observation) -> bool:
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


def _chosen(cursor: Cursor, observation: Observation, is_baseline: bool, *, is_counted: bool) -> list[EdgeSample]:
    """Return what [variables] and [plc] read of this observation. Of several values of one, the first accounts for it."""
    found = list[EdgeSample]()
    for item in cursor.chosen:
        if item.data_item_id != observation.data_item_id or observation.is_condition:
            continue
        text: str | None = observation.value
        if item.key and text != UNAVAILABLE_WORD:
            text = dict(observation.entries).get(item.key)  # a data set tells only the entries that have changed
            if text is None:
                continue
            observation_of = observation._replace(value=text, has_entries=False)
        else:
            observation_of = observation
        sample = _sample(item.target, observation_of, is_baseline)
        found.append(replace(sample, observations=0) if is_counted or found else sample)
    return found


def _no_tool(cursor: Cursor, asset: AssetWatch, observation: Observation, is_baseline: bool) -> list[EdgeSample]:
    """The signals of the tool, while there is none or its asset has not been read yet."""
    why = UNAVAILABLE if observation.value == UNAVAILABLE_WORD else "no tool in the spindle"
    if asset.asset_id:
        why = f"the asset of tool {asset.asset_id} has not been read yet"
    return tool_samples(cursor, without_tool(why), asset, is_baseline=is_baseline, observations=0)


def tool_samples(
    cursor: Cursor,
    outcomes: Iterable[tuple[str, Outcome]],
    asset: AssetWatch,
    *,
    is_baseline: bool = False,
    observations: int = 1,
) -> list[EdgeSample]:
    """The signals of the tool in the spindle, as of the observation that named it or said that its asset has changed."""
    return [
        EdgeSample(name, value, asset.at_ms, quality, reason, asset.sequence, observations, is_baseline)
        for name, (value, quality, reason) in outcomes
        if name in cursor.tool_signals
    ]


def observed(alarms: tuple[Alarm, ...], observation: Observation) -> tuple[Alarm, ...]:
    """The activations after the observation of a condition."""
    o = observation
    return observe(alarms, o.data_item_id, o.element, o.native_code, o.value, severity=o.native_severity, time_ms=o.timestamp_ms)


def alarm_samples(
    cursor: Cursor, alarms: tuple[Alarm, ...], observation: Observation, is_baseline: bool, *, observations: int = 1
) -> list[EdgeSample]:
    """The active conditions, as a text and as a list; the first of the two accounts for the observation."""
    assert observation.sequence is not None
    assert observation.timestamp_ms is not None
    is_unknown = all_unavailable(alarms, cursor.conditions)
    quality, why = (Quality.BAD, UNAVAILABLE) if is_unknown else (Quality.GOOD, None)
    return [
        EdgeSample(
            name,
            None if is_unknown else (text_of if name == "alarm" else list_of)(alarms),
            observation.timestamp_ms,
            quality,
            why,
            observation.sequence,
            observations if name == cursor.alarm_signals[0] else 0,
            is_baseline,
        )
        for name in cursor.alarm_signals
    ]


def clock_of(header: Header) -> ClockReading | None:
    """Return what the agent's clock showed; `edge.clock.offset` puts it beside the time at which the document arrived."""
    if header.created_ms is None:
        return None
    return ClockReading(header.created_ms, 0, DOCUMENT_MS_MAX, header.resolution_ms)
