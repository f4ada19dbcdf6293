"""What a host application would show, put together by hand."""

from collections.abc import Mapping

from sparkplug.metric import NodeId, Reading
from sparkplug.node_picture import NodePicture, Owner
from sparkplug.quality import Quality
from sparkplug.values import Value


def owner(values: Mapping[str, Value | Reading], *, online: bool = True) -> Owner:
    """Metrics with these values, good and without a unit where nothing else is said."""
    readings = {
        name: value if isinstance(value, Reading) else Reading(name, value, 1_000, Quality.GOOD, None, None, False)
        for name, value in values.items()
    }
    return Owner(online=online, readings=readings)


def balance(
    received: int, emitted: int, dropped: Mapping[str, int] | None = None, buffered: int = 0
) -> dict[str, Value | Reading]:
    """The metrics of a ledger."""
    reasons = dropped or {}
    sums = {"received": received, "emitted": emitted, "buffered": buffered, "dropped": sum(reasons.values())}
    return {f"ledger/{n}": v for n, v in sums.items()} | {f"ledger/dropped/{n}": v for n, v in reasons.items()}


class Pictures:
    """The nodes of a plant, each with its own metrics and its devices."""

    def __init__(self) -> None:
        self._pictures: dict[NodeId, NodePicture] = {}

    def add(self, node: str, own: Owner, devices: Mapping[str, Owner] | None = None) -> "Pictures":
        """One more node."""
        identity = NodeId("cnc", node)
        self._pictures[identity] = NodePicture(identity, own=own, devices=dict(devices or {}))
        return self

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes, and one that was only heard of."""
        return (*self._pictures, NodeId("cnc", "unborn"))

    def picture(self, node: NodeId) -> NodePicture | None:
        """Return what is known of one."""
        return self._pictures.get(node)
