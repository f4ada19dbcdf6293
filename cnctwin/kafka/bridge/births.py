"""The births of a plant on a compacted topic, as they came: what a bridge that was killed reads the messages by that wait for it.

By topic: a node's NBIRTH, and the DBIRTHs that followed it. A new NBIRTH takes back the DBIRTHs before it, and a death its birth.
"""

from collections.abc import Callable, Mapping

from sparkplug.metric import NodeId
from sparkplug.topics import Topic, Verb

Keep = Callable[[str, bytes | None], bool]


class Births:
    """See the module. `keep` writes a birth by its topic, None takes it back; False where there is no room for it now."""

    def __init__(self, keep: Keep) -> None:
        self._write = keep
        self._waiting: dict[str, bytes | None] = {}
        self._devices: dict[NodeId, set[str]] = {}

    def restored(self, kept: Mapping[str, bytes]) -> list[tuple[str, bytes]]:
        """Return the births that were kept, NBIRTHs first, and know them from now on."""
        found = [(Topic.parse(topic), payload) for topic, payload in kept.items()]
        nodes = {topic.node for topic, _ in found if topic.verb is Verb.NBIRTH}
        for topic, _ in found:
            if topic.device is not None:
                self._devices.setdefault(topic.node, set()).add(topic.device)
        births = [(topic, payload) for topic, payload in found if topic.node in nodes]
        return [(str(topic), payload) for topic, payload in sorted(births, key=lambda one: one[0].device is not None)]

    def take(self, topic: Topic, payload: bytes) -> None:
        """Keep a birth, or take it back with a death."""
        verb, node, device = topic
        if verb is Verb.NBIRTH or verb is Verb.NDEATH:
            for known in self._devices.pop(node, ()):
                self._keep(str(Topic(Verb.DBIRTH, node, known)), None)
            self._keep(str(Topic(Verb.NBIRTH, node)), payload if verb is Verb.NBIRTH else None)
        elif device is not None:
            self._keep(str(Topic(Verb.DBIRTH, node, device)), payload if verb is Verb.DBIRTH else None)
            if verb is Verb.DBIRTH:
                self._devices.setdefault(node, set()).add(device)

    def catch_up(self) -> None:
        """Write what found no room."""
        while self._waiting:
            topic, payload = next(iter(self._waiting.items()))
            if not self._write(topic, payload):
                return
            del self._waiting[topic]

    def _keep(self, topic: str, payload: bytes | None) -> None:
        if self._waiting or not self._write(topic, payload):
            self._waiting.pop(topic, None)
            self._waiting[topic] = payload
