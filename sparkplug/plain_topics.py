"""The plain topics on which a host has published: a topic is looked at once."""

from sparkplug.actions import Publish
from sparkplug.topics import NAMESPACE
from sparkplug.transport.sendable import Sendable

TOPICS_MAX = 20_000
BYTES_MAX = 1000  # every broker takes a message of that size
_NAMESPACE_LEVEL = f"{NAMESPACE}/"


class PlainTopics:
    """See the module. `sendable` knows what the present broker takes."""

    def __init__(self, sendable: Sendable) -> None:
        self._sendable = sendable
        self._known: set[str] = set()

    def sent(self, messages: list[Publish]) -> list[Publish]:
        """Return the messages that can be sent. Raises ValueError for what a host writes by commands only."""
        known = self._known
        return [one for one in messages if (one[0] in known and len(one[1]) <= BYTES_MAX) or self._may_publish(one)]

    def _may_publish(self, message: Publish) -> bool:
        """Look at a topic that is new, or at a long message."""
        topic = message.topic
        if topic.startswith(_NAMESPACE_LEVEL):
            raise ValueError(f"{topic!r} lies in the Sparkplug namespace; a host writes there by commands only")
        if len(self._known) >= TOPICS_MAX:
            self._known.clear()
        can_be_sent = self._sendable.takes(message)
        if can_be_sent:
            self._known.add(topic)
        else:
            self._known.discard(topic)
        return can_be_sent
