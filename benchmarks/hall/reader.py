"""The reader: a process with one bare socket that says how old values are when they reach whoever looks at them.

It reads the plain mirror of one signal of some machines (`cnc/<machine>/axis_x_pos_mm`), what the processors publish of them, and
the ledger and the health of each processor's node.
"""

import time
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from multiprocessing.connection import Connection, wait
from typing import Any

from benchmarks.hall.load import hurry
from benchmarks.hall.machine import GROUP
from benchmarks.hall.packets import PINGREQ, READ_BYTES, Stream, connect, connected, subscribe
from sparkplug.schema import PayloadMessage
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import MIRROR

SIGNAL = "axis_x_pos_mm"
IN_TIME_S = 1.0
_T = b'"t":"'


@dataclass(slots=True)
class Seen:
    """The values that have come: their ages by the time of arrival, and how many of the window came in time."""

    mirror_s: "array[float]" = field(default_factory=lambda: array("d"))
    results_s: "array[float]" = field(default_factory=lambda: array("d"))
    in_time: int = 0
    late: int = 0
    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)
    live: dict[str, float] = field(default_factory=dict)
    twins: dict[str, dict[str, float]] = field(default_factory=dict)


class Reader:
    """See the module. `everyone`: note also when each machine appears in the mirror and each twin device is born."""

    def __init__(self, port: int, machines: Sequence[str], *, everyone: bool = False) -> None:
        self.seen = Seen()
        self.window_s = (0.0, 0.0)
        self._names: dict[str, dict[int, str]] = {}
        self._observed = frozenset(machines)
        self._everyone = everyone
        self._stream = Stream()
        filters = [f"{MIRROR}{machine}/{SIGNAL}" for machine in machines]
        filters += [f"spBv1.0/{GROUP}/DDATA/+/{machine}" for machine in machines]
        filters += [f"spBv1.0/{GROUP}/NBIRTH/+", f"spBv1.0/{GROUP}/NDATA/+"]
        if everyone:
            filters += [f"spBv1.0/{GROUP}/DBIRTH/+/+", f"{MIRROR}+/exec_state"]
        self._sock = connected(port, connect("load-reader", 60))
        self._sock.sendall(subscribe(filters))

    def open(self, window_s: tuple[float, float]) -> None:
        """Forget the ages, and count from now on what is stamped within the window."""
        self.window_s = window_s
        self.seen.mirror_s, self.seen.results_s = array("d"), array("d")
        self.seen.in_time = self.seen.late = 0

    def run(self, pipe: Connection) -> None:
        """Read until the pipe says that it is enough."""
        pinged_s = time.monotonic()
        while True:
            ready = wait([self._sock, pipe], 10.0)
            if self._sock in ready:
                data = self._sock.recv(READ_BYTES)
                if not data:
                    raise SystemExit("the broker has closed the reader's connection")
                self._take(data)
            if pipe in ready:
                asked = pipe.recv()
                if asked is None:
                    return
                what, argument = asked
                if what == "window":
                    self.open(argument)
                else:
                    pipe.send(self.seen)
            if time.monotonic() - pinged_s > 20.0:
                pinged_s = time.monotonic()
                self._sock.sendall(PINGREQ)

    def _take(self, data: bytes) -> None:
        now_s = time.time()
        for topic, payload in self._stream.published(data):
            if topic.startswith(MIRROR):
                self._mirrored(topic, payload, now_s)
            else:
                self._sparkplug(topic.split("/"), payload, now_s)

    def _mirrored(self, topic: str, payload: bytes, now_s: float) -> None:
        if self._everyone and topic.endswith("/exec_state"):
            self.seen.live.setdefault(topic.split("/")[1], now_s)
            return
        at = payload.find(_T) + len(_T)
        stamp_s = datetime.fromisoformat(payload[at : payload.index(b'"', at)].decode()).timestamp()
        age_s = now_s - stamp_s
        begin_s, end_s = self.window_s
        if begin_s <= now_s < end_s + IN_TIME_S:
            self.seen.mirror_s.append(age_s)
        if begin_s <= stamp_s < end_s and b'"quality":"good"' in payload:
            if age_s <= IN_TIME_S:
                self.seen.in_time += 1
            else:
                self.seen.late += 1

    def _sparkplug(self, levels: list[str], payload: bytes, now_s: float) -> None:
        verb, node = levels[2], levels[3]
        if not is_twin_node(node):
            return
        if verb == "DBIRTH":
            self.seen.twins.setdefault(node, {}).setdefault(levels[4], now_s)
            return
        message = PayloadMessage.FromString(payload)
        if verb == "NBIRTH":
            self._names[node] = {metric.alias: metric.name for metric in message.metrics}
        if verb == "DDATA":
            if self.window_s[0] <= now_s < self.window_s[1] + IN_TIME_S and message.metrics:
                self.seen.results_s.append(now_s - max(metric.timestamp for metric in message.metrics) / 1000.0)
            return
        names, values = self._names.get(node, {}), self.seen.nodes.setdefault(node, {})
        for metric in message.metrics:
            field_name = metric.WhichOneof("value")
            if field_name is not None and metric.alias in names:
                values[names[metric.alias]] = getattr(metric, field_name)


def serve(port: int, machines: Sequence[str], everyone: bool, pipe: Connection) -> None:
    """Read until told to stop."""
    hurry()
    reader = Reader(port, machines, everyone=everyone)
    pipe.send("connected")
    reader.run(pipe)
