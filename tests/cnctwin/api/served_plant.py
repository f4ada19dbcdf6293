"""A server over a real broker, with a machine on it, and a reader of its streams."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import httpx

from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.edge.host_watch import wait
from tests.wire.mosquitto import Mosquitto

LOAD, STATE = "spindle_load_pct", "exec_state"
PATIENCE_S = 60.0  # the tests run beside others
get, post, streamed = (partial(one, timeout=PATIENCE_S) for one in (httpx.get, httpx.post, httpx.stream))


class Event(NamedTuple):
    """A server-sent event."""

    name: str
    data: dict[str, Any]


class PlantServer(Server):
    """A server, with what it serves from."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(create_app(sources))
        self.sources = sources


@contextmanager
def served(broker: Mosquitto, **parts: Any) -> Iterator[PlantServer]:
    """A server that looks at the broker."""
    live = LivePlant()
    viewer = Viewer(BrokerAddress(*broker.address), "cnc", live)
    viewer.start()
    try:
        with PlantServer(Sources(live, viewer, **parts)) as server:
            yield server
    finally:
        viewer.stop()


@contextmanager
def machine(broker: Mosquitto, name: str = "vmc") -> Iterator[EdgeNode]:
    """An edge with one machine."""
    edge = EdgeNode(
        BrokerAddress(*broker.address), NodeId("cnc", f"edge-{name}"), [MetricSpec("ledger/received", DataType.INT64, value=3)]
    )
    edge.declare_device(
        name, [MetricSpec(LOAD, DataType.DOUBLE, "%", value=0.0), MetricSpec(STATE, DataType.STRING, value="READY")]
    )
    edge.start()
    try:
        wait(lambda: edge.online, "the edge to be born")
        yield edge
    finally:
        edge.stop()


def tell(edge: EdgeNode, value: float, name: str = "vmc") -> int:
    """A new load, now; its time."""
    t_ms = time.time_ns() // 1_000_000
    edge.publish(name, [Change(LOAD, value, t_ms)])
    return t_ms


def wait_until_known(server: Server, edge: EdgeNode, name: str = "vmc") -> None:
    """Until the server has the machine. It joins late, so it hears a value before it asks for the birth."""

    def known() -> bool:
        tell(edge, 0.0, name)
        return any(item["machine"] == name and item["online"] for item in get(f"{server.url}/machines").json())

    wait(known, f"machine {name} to be known")


class Stream:
    """A stream that a thread reads, as `EventSource` would: it comes back when it was ended."""

    def __init__(self, url: str, machine: str | None = "vmc") -> None:
        self.events: list[Event] = []
        self.connections = 0
        self.is_open = False
        self._url = f"{url}/stream" + ("" if machine is None else f"?machine={machine}")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> "Stream":
        self._thread.start()
        wait(lambda: self.events, "the first event")
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()

    def loads(self) -> list[float]:
        """The loads of the rows, in order."""
        return [row[2] for event in list(self.events) if event.name == "rows" for row in event.data["rows"] if row[1] == LOAD]

    def last(self, name: str) -> dict[str, Any]:
        """The last event of a kind."""
        return next((event.data for event in reversed(list(self.events)) if event.name == name), {})

    def _read(self) -> None:
        while not self._stop.is_set():
            try:
                with streamed("GET", self._url) as answer:
                    self.connections += 1
                    self.is_open = True
                    self._take(answer)
            except httpx.HTTPError:
                self._stop.wait(0.1)
            finally:
                self.is_open = False

    def _take(self, answer: httpx.Response) -> None:
        name = ""
        for line in answer.iter_lines():
            if self._stop.is_set():
                return
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: "):
                self.events.append(Event(name, json.loads(line[6:])))
