"""An edge node of the simulated world, with its connection and the truth of what it published."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sparkplug.actions import Publish
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.metric import MetricSpec, NodeId
from sparkplug.quality import Quality
from sparkplug.schema import PayloadMessage
from tests.sparkplug.edge_watch import EdgeWatch


class Known(NamedTuple):
    """What is true, or believed, of one metric."""

    value: Any
    timestamp_ms: int
    quality: Quality


class Flying(NamedTuple):
    """A message on its way to the host."""

    publish: Publish
    node: NodeId
    verb: str
    bd_seq: int | None


Table = dict[str, Known]


@dataclass
class Edge:
    """One edge node with its connection, its will at the broker, and the truth of what it published."""

    node: NodeId
    metrics: tuple[MetricSpec, ...]
    primary_host: str | None
    session: EdgeNodeSession
    watch: EdgeWatch = field(default_factory=EdgeWatch)
    bd_seq: int | None = None
    will: Publish | None = None
    subscriptions: set[str] = field(default_factory=set)
    inbox: list[tuple[str, bytes]] = field(default_factory=list)
    state_ms: int = 0
    truth: dict[str | None, Table] = field(default_factory=dict)
    specs: dict[str | None, tuple[MetricSpec, ...]] = field(default_factory=dict)

    @property
    def connected(self) -> bool:
        """Return whether the broker and the node hold a connection."""
        return self.will is not None


def flying_of(publish: Publish, node: NodeId) -> Flying:
    """A message of a node, with what a broker could see of it."""
    verb = publish.topic.split("/")[2]
    bd_seq = None
    if verb in ("NBIRTH", "NDEATH"):
        message = PayloadMessage.FromString(publish.payload)
        bd_seq = next(int(metric.long_value) for metric in message.metrics if metric.name == "bdSeq")
    return Flying(publish, node, verb, bd_seq)
