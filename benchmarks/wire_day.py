#!/usr/bin/env python3
"""The wire of a recorded day, as digests: where two checkouts print the same, their wire is byte-identical.

    .venv/bin/python benchmarks/wire_day.py okuma.txt --devices okuma_devices.xml [--device NAME] [--rows N] [--json]

The recording goes through the edge's own parser, mapping and pipeline, is encoded as an edge node encodes it, decoded as a host
decodes it, and folded by every processor with its default configuration. What each publishes is encoded again and heard by the
others, as on a broker that keeps the order. Time is that of the recording, so that a run gives the same bytes each time.
"""

import argparse
import hashlib
import json
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from random import Random

from cnctwin.importing.shdr import recorded_rows
from edge.running.birth import device_metrics
from edge.sample import EdgeSample, Offer
from processors.actions import Action, Declare, PlainOutput, Publish, Remove
from processors.config import Configuration
from processors.discovery import AnyProcessor, discover
from processors.running.engine import Engine
from sparkplug.actions import Publish as Sent
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.host_session import HostEvent, HostSession
from sparkplug.metric import Change, MetricSpec, NodeId

GROUP = "cnc"
SILENCE_S = 1.0
"""After each row that is followed by a pause: time goes on, and folds that ask for ticks get them."""


class Digest:
    """The bytes of one sender: topic and payload of each message, in order."""

    def __init__(self) -> None:
        self.messages, self.bytes, self._sha = 0, 0, hashlib.sha256()

    def take(self, topic: str, payload: bytes) -> None:
        """Add a message."""
        self.messages += 1
        self.bytes += len(payload)
        self._sha.update(topic.encode() + b"\0" + len(payload).to_bytes(8, "big") + payload)

    def as_json(self) -> dict[str, str | int]:
        """The digest, with how much it is of."""
        return {"messages": self.messages, "bytes": self.bytes, "sha256": self._sha.hexdigest()}


class Sender:
    """An edge node on a broker that is always there."""

    def __init__(self, node: NodeId, at_ms: int) -> None:
        self.digest, self._session = Digest(), EdgeNodeSession(node, now_ms=at_ms)
        self._session.connecting(0, at_ms)
        self.born = [action for action in self._session.connected(at_ms) if isinstance(action, Sent)]
        for message in self.born:
            self.digest.take(message.topic, message.payload)

    def declare(self, device: str, metrics: Iterable[MetricSpec], at_ms: int) -> list[Sent]:
        """The birth of a device."""
        return self._counted(self._session.declare_device(device, list(metrics), at_ms))

    def publish(self, device: str, changes: Iterable[Change], at_ms: int) -> list[Sent]:
        """A message of a device."""
        return self._counted(self._session.publish(device, list(changes), at_ms))

    def remove(self, device: str, at_ms: int) -> list[Sent]:
        """The death of a device."""
        return self._counted(self._session.remove_device(device, at_ms))

    def _counted(self, actions: Iterable[object]) -> list[Sent]:
        sent = [action for action in actions if isinstance(action, Sent)]
        for message in sent:
            self.digest.take(message.topic, message.payload)
        return sent


class Processing:
    """One processor: its engine, its node, and what it has published beside Sparkplug."""

    def __init__(self, processor: AnyProcessor, at_ms: int) -> None:
        self.processor, self.plain = processor, Digest()
        self.engine = Engine(processor, Configuration(processor.config, {}, name=processor.name))
        self.sender = Sender(NodeId(GROUP, processor.node), at_ms)
        self._specs = [spec.metric() for spec in processor.outputs]
        self._declared: set[str] = set()

    def send(self, actions: Iterable[Action], at_ms: int) -> list[Sent]:
        """Carry out what the engine asks for, as its worker does; return the messages sent."""
        sent: list[Sent] = []
        for action in actions:
            if isinstance(action, Publish) and action.machine in self._declared:
                sent += self.sender.publish(action.machine, action.changes, at_ms)
            elif isinstance(action, PlainOutput):
                self.plain.take(action.topic, action.payload)
            elif isinstance(action, Declare):
                latest = {change.name: change for change in action.latest}
                self._declared.add(action.machine)
                sent += self.sender.declare(action.machine, [_valued(spec, latest) for spec in self._specs], at_ms)
            elif isinstance(action, Remove) and action.machine in self._declared:
                self._declared.discard(action.machine)
                sent += self.sender.remove(action.machine, at_ms)
        return sent

    def snapshots(self) -> dict[str, str | int]:
        """The states at the end, as they would be kept on the broker."""
        digest = Digest()
        for unit in sorted(self.engine.units):
            digest.take(unit, self.engine.snapshot(unit))
        return digest.as_json()


def _valued(spec: MetricSpec, latest: dict[str, Change]) -> MetricSpec:
    if (change := latest.get(spec.name)) is None:
        return spec
    return replace(spec, value=change.value, timestamp_ms=change.timestamp_ms, quality=change.quality, reason=change.reason)


class Plant:
    """An edge, all processors, and the order in which a broker delivers."""

    def __init__(self, at_ms: int) -> None:
        self._processing = [Processing(processor, at_ms) for processor in discover().values()]
        self._host = HostSession("wire", chance=Random(0))
        self._host.connected(at_ms)
        self._edge = Sender(NodeId(GROUP, "edge-day"), at_ms)
        for sender in (self._edge, *(one.sender for one in self._processing)):
            self._deliver(sender.born, at_ms)

    def born(self, metrics: Iterable[MetricSpec], at_ms: int) -> None:
        """The machine's birth."""
        self._deliver(self._edge.declare("day", metrics, at_ms), at_ms)

    def row(self, row: Iterable[EdgeSample], at_ms: int) -> None:
        """Publish a row of changes of one time."""
        changes = [Change(s.signal, s.value, s.timestamp_ms, s.quality, s.reason) for s in row]
        self._deliver(self._edge.publish("day", changes, at_ms), at_ms)

    def silence(self, at_ms: int) -> None:
        """A moment at which nothing comes."""
        for one in self._processing:
            actions = [*one.engine.silence(at_ms / 1000), *one.engine.beat(at_ms)]
            self._deliver(one.send(actions, at_ms), at_ms)

    def _deliver(self, messages: Iterable[Sent], at_ms: int) -> None:
        """Every processor hears every message; what they publish of it comes behind what is on its way."""
        waiting = deque(messages)
        while waiting:
            message = waiting.popleft()
            for event in self._host.message(message.topic, message.payload, at_ms):
                if isinstance(event, HostEvent):
                    for one in self._processing:
                        if event.node.node != one.processor.node:
                            waiting.extend(one.send(one.engine.feed(event, at_ms / 1000), at_ms))

    def digests(self) -> dict[str, dict[str, dict[str, str | int]]]:
        """Return the digests of each sender: its Sparkplug messages, plain messages and states."""
        found = {"edge": {"sparkplug": self._edge.digest.as_json()}}
        for one in self._processing:
            parts = {"sparkplug": one.sender.digest.as_json(), "plain": one.plain.as_json(), "snapshots": one.snapshots()}
            found[one.processor.name] = parts
        return found


def day(
    recording: Path, devices: Path | None, device: str | None, rows_max: int | None
) -> dict[str, dict[str, dict[str, str | int]]]:
    """The digests of a recording."""
    rows = [row for row in islice(recorded_rows(recording, devices, device), rows_max) if any(s.timestamp_ms for s in row)]
    if not rows:
        raise SystemExit(f"{recording}: no signal is in it; is {devices} the Devices.xml that belongs to it?")
    at_ms = max(sample.timestamp_ms for sample in rows[0])
    offers = tuple(Offer(name, "recorded") for name in dict.fromkeys(s.signal for row in rows for s in row))
    told = {sample.signal: sample for sample in rows[0]}
    plant = Plant(at_ms)
    plant.born(device_metrics(offers, told, at_ms), at_ms)
    for row in rows[1:]:
        before_ms, at_ms = at_ms, max(at_ms, *(sample.timestamp_ms for sample in row))
        if at_ms - before_ms > 2000 * SILENCE_S:
            plant.silence(at_ms - round(1000 * SILENCE_S))
        plant.row(row, at_ms)
    plant.silence(at_ms + 60_000)
    return plant.digests()


def main() -> None:
    """Print the digests."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--devices", type=Path)
    parser.add_argument("--device")
    parser.add_argument("--rows", type=int, help="only the first rows")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = day(options.recording, options.devices, options.device, options.rows)
    if options.json:
        print(json.dumps(found, indent=1))
        return
    for sender, parts in found.items():
        for part, one in parts.items():
            if one["messages"]:
                print(f"{sender:<22}{part:<11}{one['messages']:>8} messages {one['bytes']:>10} bytes  {str(one['sha256'])[:32]}")


if __name__ == "__main__":
    main()
