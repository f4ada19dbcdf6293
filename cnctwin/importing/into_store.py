"""A recording into a store, as if an edge had said it on the day: a birth, then a message for each row, received at its own time.

The way is that of `cnctwin/importing/shdr.py`: agent, parser, mapping, tool-change machine. A row that is stamped before
the one ahead of it (a control's clock steps back) is received with it, since what is received is in order.
"""

import time
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from cnctwin.errors import UsageError
from cnctwin.importing.shdr import recorded_rows
from cnctwin.memory.store.contract import Message, Pinned, Store
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from edge.running.birth import DATATYPES
from edge.sample import EdgeSample
from edge.signals import signal
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.signals import DERIVED

BATCH = 2000
NOT_YET = "not known yet"


class Imported(NamedTuple):
    """The account of an import into the store."""

    machine: str
    messages: int
    samples: int
    stored: int
    repeated: int
    refused: int
    from_ms: int
    to_ms: int
    seconds: float


def import_recording(
    store: Store, recording: Path, devices: Path | None, machine: str | None, device: str | None = None
) -> Imported:
    """Append a recording to a store under the name `machine`, or that of the file. Raises UsageError, StoreError."""
    began_s = time.perf_counter()
    name = machine or device or recording.stem
    messages, samples, stored, repeated, refused, first_ms, last_ms = 0, 0, 0, 0, 0, 0, 0
    try:
        rows = list(recorded_rows(recording, devices, device))
    except ReplayError as error:
        raise UsageError(str(error)) from None
    told = recorded_messages(rows, name)
    while batch := list(islice(told, BATCH)):
        appended = store.append(batch)
        stored, repeated, refused = stored + appended.stored, repeated + appended.repeated, refused + appended.refused
        messages, samples = messages + len(batch), samples + sum(len(event.readings) for _, event in batch)
        first_ms, last_ms = first_ms or batch[0].received_ms, batch[-1].received_ms
    if not messages:
        raise UsageError(f"{recording}: no signal is in it; is {devices} the Devices.xml that belongs to it?")
    # A recording is mostly older than what a store keeps; whoever puts it in wants it kept.
    store.pin(Pinned(name, first_ms, last_ms + 1, f"imported from {recording.name}"))
    seconds = time.perf_counter() - began_s
    return Imported(name, messages, samples, stored, repeated, refused, first_ms, last_ms, seconds)


def recorded_messages(rows: Sequence[Sequence[EdgeSample]], machine: str, group: str = "cnc") -> Iterator[Message]:
    """The messages of an edge, of rows as `recorded_rows` gives them.

    The birth declares every signal that the recording has, with the values of its first row that has a time.
    """
    node = NodeId(group, edge_node(machine))
    names = dict.fromkeys([sample.signal for row in rows for sample in row] + ["tool_number", *DERIVED])
    received_ms = 0
    for row in rows:
        stamp_ms = max(sample.timestamp_ms for sample in row)
        if not stamp_ms:
            continue  # what an agent says before it was told anything
        is_birth = received_ms == 0
        received_ms = max(received_ms, stamp_ms)
        readings = tuple(_readings(row, stamp_ms))
        if is_birth:
            said = {reading.name for reading in readings}
            unsaid = (Reading(one, None, stamp_ms, Quality.BAD, _unit(one), NOT_YET, False) for one in names if one not in said)
            readings = (*readings, *unsaid)
        kind = EventKind.BIRTH if is_birth else EventKind.DATA
        yield Message(received_ms, HostEvent(kind, node, machine, received_ms, readings))


def _readings(row: Iterable[EdgeSample], stamp_ms: int) -> Iterator[Reading]:
    for sample in row:
        value = sample.value
        if DATATYPES[signal(sample.signal).kind] is DataType.DOUBLE and isinstance(value, int):
            value = float(value)
        yield Reading(sample.signal, value, sample.timestamp_ms, sample.quality, _unit(sample.signal), _reason(sample), False)


def _reason(sample: EdgeSample) -> str | None:
    return sample.reason or (NOT_YET if sample.value is None else None)


def _unit(name: str) -> str | None:
    return signal(name).unit or None
