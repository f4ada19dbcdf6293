"""The message by which a host application has a node or device write values."""

from collections.abc import Iterable

from sparkplug.actions import Publish
from sparkplug.codec import encode
from sparkplug.errors import UnknownMetricError
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.topics import Topic, Verb
from sparkplug.values import Metric, Payload


def command(node: NodeId, picture: NodePicture | None, device: str | None, changes: Iterable[Change], now_ms: int) -> Publish:
    """Return the command; raises UnknownMetricError where the birth does not declare a metric."""
    owner = None if picture is None else picture.owner(device)
    if picture is None or owner is None:
        raise UnknownMetricError(f"{_name(node, device)} was never born; nothing to command")
    alias_of = owner.aliases(picture.aliases)
    metrics = []
    for change in changes:
        binding = owner.bindings.get(change.name)
        if binding is None:
            raise UnknownMetricError(f"{_name(node, device)} has not declared {change.name!r}; nothing to command")
        alias = alias_of.get(change.name)
        name = change.name if alias is None else None
        metrics.append(Metric(name, change.value, binding.datatype, change.timestamp_ms, alias))
    verb = Verb.NCMD if device is None else Verb.DCMD
    return Publish(str(Topic(verb, node, device)), encode(Payload(now_ms, tuple(metrics))))


def _name(node: NodeId, device: str | None) -> str:
    return str(node) if device is None else f"{node}/{device}"
