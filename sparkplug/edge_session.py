"""The session of an edge node, without I/O (Sparkplug 3.0.0, 5.3 to 5.5 and 6.4).

The transport tells it what happened (`connecting`, `connected`, `message`, `lost`, `tick`), the application what it has
(`declare_device`, `publish`, …), always with the time; every call hands back what is to be sent, in order. The life of a session:

    offline ──connecting──► waiting ──connected, primary host online──► born ──lost──► offline
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial

from sparkplug.actions import Action, Connect, Disconnect, HostState, Publish, Subscribe, WalkToNextServer
from sparkplug.certificate import Certificate, definition_metrics
from sparkplug.codec import decode, encode
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError, SparkplugError, TopicError, UnknownMetricError
from sparkplug.layouts.varint import written
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.rebirth import RebirthAnswer
from sparkplug.topics import Topic, Verb, check_id, state_topic
from sparkplug.values import Metric, Payload, Template, Value

BD_SEQ = "bdSeq"
REBIRTH = "Node Control/Rebirth"
REBIRTH_INTERVAL_MS_MIN = 1000
VISIT_MS = 5000
COMMANDS_PENDING_MAX = 1000
_SEQ_FIELDS = tuple(b"\x18" + written(seq) for seq in range(256))  # as the last field of a payload


Aliases = dict[tuple[str | None, str], int]
"""The alias of each metric, by device (None: the node's own) and name. They are 1 to n, so that the next one is n + 1."""


class Phase(Enum):
    """The phase of a session."""

    OFFLINE = "offline"
    WAITING = "waiting"
    BORN = "born"


_BORN = Phase.BORN


@dataclass(frozen=True, slots=True)
class Command:
    """A value that a host application wants written; `name` is None where neither name nor alias is declared."""

    device: str | None
    name: str | None
    value: Value
    timestamp_ms: int | None


class EdgeNodeSession:
    """One edge node on one broker at a time.

    `primary_host` is the id of the host without which nothing is published; it is looked for at each of `servers` brokers. Where
    there is one broker the node waits there, connected and unborn, and owes it no death. Where there are several it leaves one
    that says "offline" at once, until it has been to all of them, and after that looks at each for `VISIT_MS`. `templates` maps
    names to definitions; `aliases` are those of an earlier life, so that metrics keep theirs. `watched_hosts` are ids of
    hosts whose STATE is only noted in `host_states`, for the application to take; None there: the retained STATE was removed.
    """

    def __init__(
        self,
        node: NodeId,
        metrics: Sequence[MetricSpec] = (),
        *,
        now_ms: int = 0,
        primary_host: str | None = None,
        servers: int = 1,
        watched_hosts: Collection[str] = (),
        templates: Mapping[str, Template] | None = None,
        rebirth_interval_ms_min: int = REBIRTH_INTERVAL_MS_MIN,
        aliases: Aliases | None = None,
    ) -> None:
        self.node = NodeId(check_id(node.group, "group id"), check_id(node.node, "edge node id"))
        if node.group == "STATE":
            raise TopicError("group id 'STATE' is taken by the topic of host applications; choose another one")
        self.phase = Phase.OFFLINE
        self.bd_seq: int | None = None
        self.commands: list[Command] = []
        self.commands_dropped = 0
        self.host_states: list[tuple[str, HostState | None]] = []
        self.malformed = 0
        self.aliases: Aliases = {} if aliases is None else dict(aliases)
        self._templates = dict(templates or {})
        for taken in (BD_SEQ, REBIRTH, *self._templates):
            if any(spec.name == taken for spec in metrics):
                raise SparkplugError(f"edge node {node} declares {taken!r}, which its birth holds already; choose another name")
        self._certificate = Certificate(f"edge node {node}", metrics, partial(self._alias, None), now_ms, self._templates)
        self._devices: dict[str, Certificate] = {}
        self._folded: dict[str, str] = {}  # the devices, by their names in one case
        self._data_topics: dict[str | None, str] = {None: str(Topic(Verb.NDATA, node))}
        self._primary_topic = None if primary_host is None else state_topic(primary_host)
        self._server, self._servers = 0, servers
        self._visits = 0  # brokers that were dialled since the primary host was last online
        self._waits_since_ms = 0
        self._watched = {state_topic(host): host for host in watched_hosts}
        self._state_timestamps_ms: dict[int, int] = {}
        self._rebirth = RebirthAnswer(rebirth_interval_ms_min)
        self._seq = 255
        self._clock_ms = 0

    # What the transport tells.

    def connecting(self, bd_seq: int, now_ms: int, server: int = 0) -> Connect:
        """A connection to broker number `server` is about to be opened with this birth/death sequence number."""
        if self.phase is not Phase.OFFLINE:
            raise SparkplugError(f"edge node {self.node} is connected already; one broker at a time")
        self.bd_seq, self._server = bd_seq, server
        self._visits += 1
        return Connect(will=self._death(now_ms))

    def connected(self, now_ms: int) -> list[Action]:
        """The broker has accepted the connection."""
        self.phase, self._waits_since_ms = Phase.WAITING, now_ms
        actions: list[Action] = [Subscribe(str(Topic(Verb.NCMD, self.node)))]
        actions += [self._subscribe(device) for device in self._devices]
        actions += [Subscribe(topic) for topic in self._watched if topic != self._primary_topic]
        if self._primary_topic is not None:
            actions.append(Subscribe(self._primary_topic))
        else:
            actions += self._birth(now_ms)
        return actions

    def lost(self) -> None:
        """The connection is gone, whoever ended it."""
        self.phase = Phase.OFFLINE

    def message(self, topic: str, payload: bytes, now_ms: int) -> list[Action]:
        """A message has come; a malformed one is counted and changes nothing."""
        if self.phase is Phase.OFFLINE:
            return []
        try:
            if topic in self._watched:
                self.host_states.append((self._watched[topic], HostState.decode(payload) if payload else None))
            if topic == self._primary_topic:
                return self._host_state(HostState.decode(payload), now_ms)
            if topic in self._watched:
                return []
            parsed = Topic.parse(topic)
            if parsed.node == self.node and parsed.verb in (Verb.NCMD, Verb.DCMD):
                return self._command(parsed.device, payload, now_ms)
        except (PayloadError, TopicError):
            self.malformed += 1
        return []

    def tick(self, now_ms: int) -> list[Action]:
        """Time has passed: a rebirth that had to wait for its window is sent, and a visit without the primary host ends."""
        if self._servers > 1 and self.phase is Phase.WAITING and abs(now_ms - self._waits_since_ms) >= VISIT_MS:
            return self._walk(now_ms)
        return self._birth(now_ms) if self.phase is Phase.BORN and self._rebirth.due(now_ms) else []

    def close(self, now_ms: int) -> list[Action]:
        """The node ends by its own will: its death, then the DISCONNECT (which with MQTT 5 has the broker send the will too)."""
        actions: list[Action] = []
        if self.phase is not Phase.OFFLINE:
            actions = [self._death(now_ms), Disconnect(with_will=True)]
        self.lost()
        return actions

    # What the application has.

    def declare_device(self, device: str, metrics: Iterable[MetricSpec], now_ms: int) -> list[Action]:
        """Add a device, or declare other metrics of one; values of metrics that stay are kept."""
        check_id(device, "device id")
        alike = self._folded.get(device.casefold(), device)
        if alike != device:
            raise SparkplugError(f"edge node {self.node} has the device {alike!r}; {device!r} has to differ in more than case")
        owner = f"device {device} of {self.node}"
        certificate = Certificate(owner, metrics, partial(self._alias, device), now_ms, self._templates)
        older = self._devices.get(device)
        if older is not None:
            certificate.keep_values(older)
        self._devices[device] = certificate
        self._folded[device.casefold()] = device
        self._data_topics[device] = str(Topic(Verb.DDATA, self.node, device))
        if self.phase is Phase.OFFLINE:
            return []
        actions: list[Action] = [] if older is not None else [self._subscribe(device)]
        return actions + ([self._device_birth(device, now_ms)] if self.phase is Phase.BORN else [])

    def remove_device(self, device: str, now_ms: int) -> list[Action]:
        """The device is gone: its death is published."""
        if self._devices.pop(device, None) is None:
            raise UnknownMetricError(f"edge node {self.node} has no device {device!r}")
        del self._data_topics[device], self._folded[device.casefold()]
        if self.phase is not Phase.BORN:
            return []
        return [Publish(str(Topic(Verb.DDEATH, self.node, device)), encode(Payload(self._stamp(now_ms), seq=self._next_seq())))]

    def publish(self, device: str | None, changes: Sequence[Change], now_ms: int) -> list[Action]:
        """Note the changes and, where the node is born, send them in one message."""
        if self.phase is not _BORN or self._rebirth.is_due or not changes:
            self.note(device, changes)  # between a request for a rebirth and the rebirth no data goes out
            return []
        certificate = self._certificate_of(device)
        stamp_ms = self._stamp(now_ms)
        metrics = certificate.take_plain(changes)
        if metrics is None:
            metrics = certificate.data(changes)
            certificate.note(changes)
        payload = b"\x08" + written(stamp_ms) + metrics + _SEQ_FIELDS[self._next_seq()]
        return [tuple.__new__(Publish, (self._data_topics[device], payload, 0, False))]

    def note(self, device: str | None, changes: Sequence[Change]) -> None:
        """Keep the changes for the next birth without sending them."""
        certificate = self._certificate_of(device)
        certificate.check(changes)
        certificate.note(changes)

    def devices(self) -> tuple[str, ...]:
        """The ids of the declared devices."""
        return tuple(self._devices)

    # How it is done.

    def _certificate_of(self, device: str | None) -> Certificate:
        certificate = self._certificate if device is None else self._devices.get(device)
        if certificate is None:
            raise UnknownMetricError(f"edge node {self.node} has no device {device!r}; declare it first")
        return certificate

    def _alias(self, device: str | None, name: str) -> int:
        """The alias of a metric, unique over the node and its devices, the same at each birth (6.4.7)."""
        return self.aliases.setdefault((device, name), len(self.aliases) + 1)

    def _stamp(self, now_ms: int) -> int:
        """The time stamp of a payload: never earlier than the one before, so that a host can tell old from new (5.7)."""
        if now_ms <= self._clock_ms:
            return self._clock_ms
        self._clock_ms = now_ms
        return now_ms

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % 256
        return self._seq

    def _subscribe(self, device: str) -> Subscribe:
        return Subscribe(str(Topic(Verb.DCMD, self.node, device)))

    def _death(self, now_ms: int) -> Publish:
        metric = Metric(BD_SEQ, self.bd_seq, DataType.INT64, now_ms)
        return Publish(str(Topic(Verb.NDEATH, self.node)), encode(Payload(self._stamp(now_ms), (metric,))), qos=1)

    def _birth(self, now_ms: int) -> list[Action]:
        self.phase = Phase.BORN
        self._seq = 0
        now_ms = self._stamp(max(now_ms, self._clock_ms + 1))  # no two births look alike
        control = (
            Metric(BD_SEQ, self.bd_seq, DataType.INT64, now_ms, self._alias(None, BD_SEQ)),
            Metric(REBIRTH, False, DataType.BOOLEAN, now_ms),
        )
        others = encode(Payload(None, definition_metrics(self._templates, partial(self._alias, None), now_ms) + control))
        payload = b"\x08" + written(now_ms) + self._certificate.birth() + others + _SEQ_FIELDS[0]
        node = Publish(str(Topic(Verb.NBIRTH, self.node)), payload)
        return [node, *(self._device_birth(device, now_ms) for device in self._devices)]

    def _device_birth(self, device: str, now_ms: int) -> Publish:
        payload = b"\x08" + written(self._stamp(now_ms)) + self._devices[device].birth() + _SEQ_FIELDS[self._next_seq()]
        return Publish(str(Topic(Verb.DBIRTH, self.node, device)), payload)

    def _host_state(self, state: HostState, now_ms: int) -> list[Action]:
        if state.timestamp_ms < self._state_timestamps_ms.get(self._server, state.timestamp_ms):
            return []
        self._state_timestamps_ms[self._server] = state.timestamp_ms
        if state.online:
            self._visits = 0
            return self._birth(now_ms) if self.phase is Phase.WAITING else []
        return self._walk(now_ms) if self.phase is Phase.BORN or self._visits < self._servers else []

    def _walk(self, now_ms: int) -> list[Action]:
        """Leave for the next broker; MQTT 3.1.1 wants a death before each DISCONNECT, born or not."""
        actions: list[Action] = [self._death(now_ms), WalkToNextServer()]
        self.lost()
        return actions

    def _command(self, device: str | None, payload: bytes, now_ms: int) -> list[Action]:
        if device is not None and device not in self._devices:
            raise PayloadError(f"command for the device {device!r}, which edge node {self.node} has not")
        certificate = self._certificate if device is None else self._devices[device]

        def spec(name: str | None, alias: int | None) -> MetricSpec | None:
            return certificate.spec(name) if name else certificate.name_of(alias or 0)

        def type_of(name: str | None, alias: int | None) -> DataType | None:
            known = spec(name, alias)
            return None if known is None else known.datatype

        rebirth = False
        for metric in decode(payload, type_of).metrics:
            if device is None and metric.name == REBIRTH:
                rebirth = rebirth or metric.value is True
                continue
            known = spec(metric.name, metric.alias)
            if len(self.commands) < COMMANDS_PENDING_MAX:
                name = None if known is None else known.name
                self.commands.append(Command(device, name, metric.value, metric.timestamp_ms))
            else:
                self.commands_dropped += 1
        if rebirth and self.phase is Phase.BORN and self._rebirth.request(now_ms):
            return self._birth(now_ms)
        return []
