"""A model of an MQTT broker, with the limits that Mosquitto keeps: what they end, drop or refuse, it ends, drops or refuses.

    topics       at most 65,535 bytes of UTF-8, no control characters, 200 levels, no wildcards in a PUBLISH: else the client goes
    packets      at most PACKET_BYTES_MAX: else the client goes
    sessions     clean ones only; a second client of a name takes the session over, and the will of the first is sent
    wills        sent where a connection ends without DISCONNECT, once the broker has noticed
    QoS 0        dropped for a subscriber that takes nothing while more than QUEUED_MAX wait for it
    QoS 1        never dropped on a connection, perhaps delivered twice; lost with the connection, as sessions are clean
    order        kept from one client to another; what comes from several clients is in any order
    retained     in memory, and on the disk as of the last autosave: a broker that is killed comes back with that

Each connection is two queues, one in each direction, with a delay that the seed draws; order in them is that of TCP.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from paho.mqtt.client import topic_matches_sub

from sparkplug.actions import Publish
from tests.plant.simulation.kernel import Kernel

TOPIC_BYTES_MAX = 65_535
TOPIC_LEVELS_MAX = 200
PACKET_BYTES_MAX = 4_194_304
QUEUED_MAX = 2_000
HOSTILE = "evil-"  # the beginning of the client ids of hostile edges
LATENCY_S = (0.0002, 0.004)
NOT_ALLOWED = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")
CONNACK, MESSAGE, PUBACK, ENDED = "connack", "message", "puback", "ended"
Receive = Callable[[str, Any], None]


@dataclass(slots=True, eq=False)
class Link:
    """A connection on its way through the network. `stalled_until_s`: nothing passes before."""

    client: str
    receive: Receive
    latency_s: float
    stalled_until_s: float = 0.0
    up_s: float = 0.0
    down_s: float = 0.0
    waiting: int = 0  # on the way down
    is_cut: bool = False  # nothing passes any more
    is_known: bool = False  # the broker has a session on it


@dataclass(slots=True, eq=False)
class Session:
    """A client, as the broker sees it."""

    link: Link
    will: Publish | None
    filters: dict[str, int] = field(default_factory=dict)


class Broker:
    """See the module. `observers` hear each message that the broker has taken: client, topic, payload, retain."""

    def __init__(self, kernel: Kernel, latency_s: float = 0.001) -> None:
        self.kernel = kernel
        self.is_up = True
        self.latency_s = latency_s
        self.retained: dict[str, tuple[bytes, int]] = {}
        self.observers: list[Callable[[str, str, bytes, bool], None]] = []
        self.duplicates = 0.0  # the share of QoS 1 messages that come twice
        self.dropped = self.refused = 0
        self.unreachable_until_s: dict[str, float] = {}
        self.links: list[Link] = []
        self._sessions: dict[str, Session] = {}
        self._saved: dict[str, tuple[bytes, int]] = {}
        self._readers: dict[str, list[tuple[Session, int]]] = {}  # of each topic, with the QoS that each is granted

    # What a client does. Each reaches the broker after the delay of its link.

    def dial(self, client: str, will: Publish | None, receive: Receive) -> Link | None:
        """Open a connection; None where nobody answers."""
        if not self.is_up or self.kernel.now_s < self.unreachable_until_s.get(client, 0.0):
            return None
        link = Link(client, receive, self.latency_s * self.kernel.chance.uniform(0.3, 2.0))
        self.links.append(link)
        self._up(link, lambda: self._connect(link, will))
        return link

    def publish(self, link: Link, message: Publish, token: int | None = None) -> None:
        """Send a PUBLISH; `token` comes back with its PUBACK."""
        self._up(link, lambda: self._published(link, message, token))

    def subscribe(self, link: Link, topic_filter: str, qos: int) -> None:
        """Send a SUBSCRIBE."""
        self._up(link, lambda: self._subscribed(link, topic_filter, qos))

    def disconnect(self, link: Link, *, with_will: bool) -> None:
        """Send a DISCONNECT."""
        self._up(link, lambda: self._left(link, with_will=with_will))

    # What happens to connections.

    def cut(self, link: Link, client_after_s: float | None, broker_after_s: float) -> None:
        """Lose a connection with all that is on its way; each side notices after a while (None: the client never does)."""
        if link.is_cut:
            return
        link.is_cut = True
        self.links.remove(link)
        now_s = self.kernel.now_s
        if client_after_s is not None:
            self.kernel.at(now_s + client_after_s, lambda: link.receive(ENDED, None))
        self.kernel.at(now_s + broker_after_s, lambda: self._noticed(link))

    def reset(self, link: Link) -> None:
        """The client's process has died: the system closes its socket; what it has sent still comes."""
        self._up(link, lambda: self._end(link))

    def kill(self) -> set[str]:
        """End at once: no will is sent, and what is retained is that of the last autosave when it comes back. Return the topics
        on which something else is retained then."""
        self.is_up = False
        for link in list(self.links):
            self.cut(link, self.kernel.chance.uniform(0.0, 0.2), 0.0)
        self._sessions.clear()
        self._readers.clear()
        before, self.retained = self.retained, dict(self._saved)
        return {topic for topic, _ in before.items() ^ self.retained.items()}

    def begin(self) -> None:
        """Take connections again."""
        self.is_up = True

    def save(self) -> None:
        """Autosave."""
        self._saved = dict(self.retained)

    @property
    def clients(self) -> list[str]:
        """Return who is connected."""
        return list(self._sessions)

    # How it is done.

    def _up(self, link: Link, arrive: Callable[[], None]) -> None:
        if link.is_cut:
            return
        now_s = self.kernel.now_s
        link.up_s = max(link.up_s, now_s + link.latency_s, link.stalled_until_s)
        self.kernel.at(link.up_s, lambda: None if link.is_cut else arrive())

    def _down(self, link: Link, what: str, value: Any) -> None:
        if link.is_cut:
            return
        now_s = self.kernel.now_s
        link.down_s = max(link.down_s, now_s + link.latency_s, link.stalled_until_s)
        link.waiting += 1

        def arrive() -> None:
            link.waiting -= 1
            if not link.is_cut:
                link.receive(what, value)

        self.kernel.at(link.down_s, arrive)

    def _connect(self, link: Link, will: Publish | None) -> None:
        older = self._sessions.get(link.client)
        if older is not None:
            self.kernel.note("taken over", link.client)
            self._end(older.link)
        link.is_known = True
        self._sessions[link.client] = Session(link, will)
        self.kernel.note("connect", link.client)
        self._down(link, CONNACK, None)

    def _session(self, link: Link) -> Session | None:
        found = self._sessions.get(link.client)
        return found if found is not None and found.link is link else None

    def _published(self, link: Link, message: Publish, token: int | None) -> None:
        if self._session(link) is None:
            return
        fault = fault_of(message)
        if fault:
            self.refused += 1
            self.kernel.note("refused", link.client, fault)
            if not link.client.startswith(HOSTILE):
                self.kernel.violated("the broker ends no connection of ours", f"{link.client}: {fault}")
            self._end(link)
            return
        self._spread(link.client, message)
        if token is not None:
            self._down(link, PUBACK, token)

    def _spread(self, client: str, message: Publish) -> None:
        topic, payload, qos, retain = message
        self.kernel.note("publish", client, topic, payload)
        for observer in self.observers:
            observer(client, topic, payload, retain)
        if retain and payload:
            self.retained[topic] = (payload, qos)
        elif retain:
            self.retained.pop(topic, None)
        readers = self._readers.get(topic)
        if readers is None:
            found = [(one, _qos(one, topic)) for one in self._sessions.values()]
            readers = self._readers[topic] = [(one, most) for one, most in found if most is not None]
        for session, most in readers:
            granted = min(qos, most)
            if granted == 0 and session.link.waiting > QUEUED_MAX:
                self.dropped += 1
                continue
            self._down(session.link, MESSAGE, (topic, payload))
            if granted and self.duplicates and self.kernel.chance.random() < self.duplicates:
                self._down(session.link, MESSAGE, (topic, payload))

    def _subscribed(self, link: Link, topic_filter: str, qos: int) -> None:
        session = self._session(link)
        if session is None:
            return
        session.filters[topic_filter] = qos
        self._readers.clear()
        found = [(topic, payload) for topic, (payload, _) in self.retained.items() if _matches(topic_filter, topic)]
        self.kernel.chance.shuffle(found)
        for one in found:
            self._down(link, MESSAGE, one)

    def _left(self, link: Link, *, with_will: bool) -> None:
        session = self._session(link)
        if session is not None and not with_will:
            session.will = None
        self._end(link)

    def _noticed(self, link: Link) -> None:
        if (session := self._session(link)) is not None:
            self._forget(link, session)

    def _end(self, link: Link) -> None:
        """The broker closes a connection."""
        session = self._session(link)
        self._down(link, ENDED, None)
        link.up_s = float("inf")
        if link in self.links:
            self.links.remove(link)
        if session is not None:
            self._forget(link, session)

    def _forget(self, link: Link, session: Session) -> None:
        del self._sessions[link.client]
        self._readers.clear()
        self.kernel.note("disconnect", link.client)
        if session.will is not None and self.is_up:
            self._spread(link.client, session.will)


def fault_of(message: Publish) -> str:
    """Return why Mosquitto would end the connection of who publishes this; "" where it would not."""
    topic, payload, *_ = message
    if not topic or len(topic.encode("utf-8", "surrogatepass")) > TOPIC_BYTES_MAX:
        return "topic too long or empty"
    if NOT_ALLOWED.search(topic) or "+" in topic or "#" in topic:
        return "character in the topic"
    if topic.count("/") >= TOPIC_LEVELS_MAX:
        return "levels of the topic"
    if len(payload) + len(topic) + 10 > PACKET_BYTES_MAX:
        return "packet too large"
    return ""


_matches = lru_cache(maxsize=200_000)(topic_matches_sub)


def _qos(session: Session, topic: str) -> int | None:
    """Return the QoS that a session is granted on a topic; None where it has not subscribed to it."""
    granted = [qos for topic_filter, qos in session.filters.items() if _matches(topic_filter, topic)]
    return max(granted, default=None)
