"""The thinning of an inbox that cannot be read in time: the nodes with most data waiting lose the older half of theirs.

A delay of a moment is none of that: a process that was busy reads what has come meanwhile. Where the oldest message has been late
for LATE_FOR_S on end, more comes than can be read, whoever sends it.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar, cast

from sparkplug.admission.rates import Overrun
from sparkplug.errors import TopicError
from sparkplug.metric import NodeId
from sparkplug.topics import NAMESPACE, Topic, Verb

LATE_S = 0.5  # of a message in the inbox
LATE_FOR_S = 1.5  # what came while the process was busy is read within it: some ten thousand messages
KEPT_MIN = 50  # messages of a node that are never thinned
AGAIN_S = 0.25
Item = TypeVar("Item")
Message = tuple[Item, bytes, float]
"""A topic, or what else stands in an inbox; a payload; and when it came."""


class Lateness:
    """Tells when an inbox is to be thinned, by the age of its oldest message."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._thinned_s = 0.0

    def is_lasting(self, age_s: float, now_s: float) -> bool:
        """Return True if the inbox is to be thinned now."""
        if age_s < LATE_S:
            self._since_s = None
            return False
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s < LATE_FOR_S or now_s - self._thinned_s < AGAIN_S:
            return False
        self._thinned_s = now_s
        return True


def thinned(
    waiting: Sequence[Message[Item]], trusted: Callable[[NodeId], bool]
) -> tuple[list[Message[Item]], Counter[tuple[NodeId, bool]]]:
    """Return what stays, in its order, and how many messages of each node go: of its devices (True), of itself (False).

    An Overrun stands where the messages of a node go on: the items of the inbox have to allow it.
    """
    found = [_data_of(topic) if isinstance(topic, str) else None for topic, _, _ in waiting]
    counts = Counter(topic.node for topic in found if topic is not None and not trusted(topic.node))
    surplus = _surplus(counts)
    stays: list[Message[Item]] = []
    gone: Counter[tuple[NodeId, bool]] = Counter()
    for message, topic in zip(waiting, found, strict=True):
        left = None if topic is None else surplus.get(topic.node)
        if topic is None or left is None:
            stays.append(message)
        elif left > 0:
            surplus[topic.node] = left - 1
            gone[topic.node, topic.device is not None] += 1
        else:
            stays.extend(((cast("Item", Overrun(topic.node, False)), b"", message[2]), message))
            del surplus[topic.node]
    return stays, gone


def _surplus(counts: Counter[NodeId]) -> dict[NodeId, int]:
    """Return how many messages of each node go: half of what the nodes have that have no fewer than the mean."""
    mean = sum(counts.values()) / max(len(counts), 1)
    return {node: count // 2 for node, count in counts.items() if count >= mean and count // 2 >= KEPT_MIN}


def _data_of(topic: str) -> Topic | None:
    if not topic.startswith(NAMESPACE) or "DATA/" not in topic:
        return None
    try:
        parsed = Topic.parse(topic)
    except TopicError:
        return None
    return parsed if parsed.verb in (Verb.NDATA, Verb.DDATA) else None


def of_devices(gone: Iterable[tuple[tuple[NodeId, bool], int]]) -> dict[NodeId, int]:
    """Return the messages of devices, by node."""
    return {node: count for (node, is_of_device), count in gone if is_of_device}
