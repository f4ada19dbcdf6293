"""The rate at which a node may send, kept at the door: what is beyond it is dropped before anybody decodes or queues it.

A node has two allowances, one for data and one for births and deaths, each of messages and of bytes. An allowance that is used up
is closed until a second's worth has come together again, so that there is one hole a second in what the node says and not one
behind each message.
"""

from collections.abc import Callable
from typing import NamedTuple

from sparkplug.admission.limits import Limits
from sparkplug.errors import TopicError
from sparkplug.metric import NodeId
from sparkplug.topics import NAMESPACE, Topic, Verb

NODES_MAX = 10_000
TOPICS_MAX = 20_000
TOPIC_MAX = 1024
ENDLESS = 1 << 62
_LIVES = (Verb.NBIRTH, Verb.DBIRTH, Verb.NDEATH, Verb.DDEATH)


class Overrun(NamedTuple):
    """From here on messages of a node are dropped; `is_life`: births or deaths, so that what is known of it is void."""

    node: NodeId
    is_life: bool


class Excess(NamedTuple):
    """So many messages of a node were dropped, of which so many were of devices."""

    node: NodeId
    messages: int
    of_devices: int


class _Allowance:
    """The rest of what a node may send. The thread that reads the socket writes it."""

    __slots__ = ("at_once", "bytes_at_once", "bytes_left", "bytes_per_s", "filled_s", "is_closed", "left", "overrun", "per_s")

    def __init__(self, overrun: Overrun, now_s: float, *, per_s: int, at_once: int, bytes_per_s: int, bytes_at_once: int) -> None:
        self.overrun = overrun
        self.per_s, self.at_once, self.bytes_per_s, self.bytes_at_once = per_s, at_once, bytes_per_s, bytes_at_once
        self.left, self.bytes_left = float(at_once), float(bytes_at_once)
        self.filled_s = now_s
        self.is_closed = False

    def fill(self, now_s: float) -> None:
        """Add what the time since the last call has brought."""
        passed_s = max(now_s - self.filled_s, 0.0)
        self.filled_s = now_s
        self.left = min(max(self.left, 0.0) + passed_s * self.per_s, self.at_once)
        self.bytes_left = min(max(self.bytes_left, 0.0) + passed_s * self.bytes_per_s, self.bytes_at_once)

    @property
    def is_refilled(self) -> bool:
        """True once a second's worth has come together."""
        return self.left >= min(self.per_s, self.at_once) and self.bytes_left >= min(self.bytes_per_s, self.bytes_at_once)


_FREE = _Allowance(
    Overrun(NodeId("", ""), False), 0.0, per_s=ENDLESS, at_once=ENDLESS, bytes_per_s=ENDLESS, bytes_at_once=ENDLESS
)


class Rates:
    """See the module. `admits` belongs to the thread that reads the socket, `excess` to the one that polls."""

    __slots__ = ("_allowances", "_dropped", "_limits", "_nodes", "_told", "_trusted", "overrun")

    def __init__(self, limits: Limits, trusted: Callable[[NodeId], bool]) -> None:
        self._limits, self._trusted = limits, trusted
        self._nodes: dict[NodeId, tuple[_Allowance, _Allowance]] = {}
        self._allowances: dict[str, _Allowance] = {}  # by topic
        self._dropped: dict[NodeId, tuple[int, int]] = {}  # since the start: messages, and those of devices
        self._told: dict[NodeId, tuple[int, int]] = {}
        self.overrun: Overrun | None = None

    def admits(self, topic: str, size: int, now_s: float) -> bool:
        """Return True if a message may come in. Where the first one may not, `overrun` is set for the caller to take."""
        allowance = self._allowances.get(topic) or self._allowance(topic, now_s)
        if not allowance.is_closed:
            allowance.left -= 1
            allowance.bytes_left -= size
            if allowance.left >= 0 and allowance.bytes_left >= 0:
                return True
        return self._refilled(allowance, topic, size, now_s)

    def excess(self) -> list[Excess]:
        """Return what was dropped since this was last called."""
        if not self._dropped:
            return []
        found = []
        for node, (messages, of_devices) in list(self._dropped.items()):
            messages_told, of_devices_told = self._told.get(node, (0, 0))
            if messages > messages_told:
                self._told[node] = messages, of_devices
                found.append(Excess(node, messages - messages_told, of_devices - of_devices_told))
        return found

    def _refilled(self, allowance: _Allowance, topic: str, size: int, now_s: float) -> bool:
        allowance.fill(now_s)
        if allowance.left >= 1 and allowance.bytes_left >= size and (not allowance.is_closed or allowance.is_refilled):
            allowance.left -= 1
            allowance.bytes_left -= size
            allowance.is_closed = False
            return True
        if not allowance.is_closed:
            allowance.is_closed = True
            self.overrun = allowance.overrun
        node = allowance.overrun.node
        messages, of_devices = self._dropped.get(node, (0, 0))
        self._dropped[node] = messages + 1, of_devices + (Topic.parse(topic).device is not None)
        return False

    def _allowance(self, topic: str, now_s: float) -> _Allowance:
        """Return the allowance that a topic uses; of what is no node's an endless one."""
        found = _FREE
        if topic.startswith(NAMESPACE):
            try:
                verb, node, _ = Topic.parse(topic)
            except TopicError:
                return found  # the session counts it
            if not self._trusted(node):
                data, life = self._of_node(node, now_s)
                found = life if verb in _LIVES else data
        if len(topic) <= TOPIC_MAX:
            if len(self._allowances) >= TOPICS_MAX:
                self._allowances.clear()
            self._allowances[topic] = found
        return found

    def _of_node(self, node: NodeId, now_s: float) -> tuple[_Allowance, _Allowance]:
        known = self._nodes.get(node)
        if known is None:
            if len(self._nodes) >= NODES_MAX:
                node = NodeId(node.group[:TOPIC_MAX], "…")  # those that are too many share theirs
                known = self._nodes.get(node)
            if known is None:
                known = self._nodes[node] = self._fresh(node, now_s)
        return known

    def _fresh(self, node: NodeId, now_s: float) -> tuple[_Allowance, _Allowance]:
        limits = self._limits
        data = _Allowance(
            Overrun(node, False),
            now_s,
            per_s=limits.messages_a_second_max,
            at_once=limits.messages_at_once_max,
            bytes_per_s=limits.data_bytes_a_second_max,
            bytes_at_once=limits.data_bytes_at_once_max,
        )
        life = _Allowance(
            Overrun(node, True),
            now_s,
            per_s=limits.births_a_second_max,
            at_once=limits.births_at_once_max,
            bytes_per_s=limits.birth_bytes_a_second_max,
            bytes_at_once=limits.birth_bytes_at_once_max,
        )
        return data, life
