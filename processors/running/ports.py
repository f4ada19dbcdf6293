"""The outside as the runtime needs it: a host application to read from, an edge node to write to, memory to keep things in."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from processors.actions import Pin
from sparkplug.actions import Publish
from sparkplug.admission.refusal import Quarantined
from sparkplug.host_session import HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId


class HostPort(Protocol):
    """`sparkplug.host.HostApplication`, or a stand-in."""

    dropped: int

    def start(self) -> None: ...
    def stop(self) -> None: ...
    def poll(self, timeout_s: float, gather_s: float = 0.0) -> list[HostEvent]: ...
    def births(self) -> list[HostEvent]: ...
    def take_thinned(self) -> Mapping[NodeId, int]: ...
    def publish_plain(self, topic: str, payload: bytes, *, qos: int = 0, retain: bool = False) -> bool: ...
    def publish_all(self, messages: Sequence[Publish]) -> bool: ...
    def subscribe_plain(self, topic_filter: str) -> None: ...
    def want_birth(self, node: NodeId) -> None: ...
    def send_command(self, node: NodeId, device: str | None, changes: Sequence[Change]) -> bool: ...
    @property
    def online(self) -> bool: ...
    @property
    def reconnects(self) -> int: ...
    @property
    def queue_depth(self) -> int: ...
    @property
    def backlog(self) -> int: ...
    @property
    def quarantine(self) -> Sequence[Quarantined]: ...


class EdgePort(Protocol):
    """`sparkplug.edge_node.EdgeNode`, or a stand-in."""

    def start(self) -> None: ...
    def stop(self, timeout_s: float = 5.0) -> None: ...
    def declare_device(self, device: str, metrics: Iterable[MetricSpec]) -> None: ...
    def remove_device(self, device: str) -> None: ...
    def publish(self, device: str | None, changes: Sequence[Change]) -> bool: ...
    @property
    def online(self) -> bool: ...
    @property
    def backlog(self) -> int: ...


class Receipt(NamedTuple):
    """A value to be written to a device that declares the metric: which of its rows are kept."""

    node: NodeId
    device: str
    name: str
    value: str


class Recorder(Protocol):
    """Keeps what a processor hears. It never blocks for long: what it cannot take it counts as dropped."""

    def keep(self, event: HostEvent, received_ms: int) -> None:
        """Keep an event, of a device or of a node, as it came; or a plain message of `keeps_plain`."""

    def pin(self, pin: Pin) -> None:
        """Keep a stretch of a machine from being swept."""

    @property
    def keeps_plain(self) -> tuple[str, ...]:
        """The filters of the plain messages that it wants."""

    def receipts(self) -> Iterable[Receipt]:
        """Return what has been kept since the last call, for those who wait for it."""

    def begin_again(self) -> None:
        """Go on after a failure, as well as that goes; whatever was lost is counted as dropped."""

    def health(self) -> Mapping[str, int | float | str]:
        """Return the recorder's state by name: published as `health/<name>` of the processor's node."""
