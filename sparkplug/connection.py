"""The thin transport: paho-mqtt, driven by one thread of ours.

Other threads put actions into a bounded outbox; one lock keeps paho to one thread at a time. Each connection is a new paho
client, so that nothing of an earlier session is ever sent again.
"""

import logging
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Action, Barrier, Connect, Disconnect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.errors import BrokerAddressError
from sparkplug.paho_client import CONNECT_TIMEOUT_S, ReadingAheadClient, ready
from sparkplug.tls_failure import explained

OUTBOX_MAX = 20_000
KEEPALIVE_S = 15
UNACKNOWLEDGED_MAX = 65_535  # all packet ids
BACKOFF_S_MIN = 0.2
BACKOFF_S_MAX = 15.0
ABSENT_S_MAX = 0.5  # where nobody listens: knocking costs nobody anything, and live values are wanted soon after its return
STABLE_S = 5.0
TICK_S = 0.2
DRIVEN_S = 0.05
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Listener:
    """Who is told what happens; every call comes from the connection's thread."""

    connecting: Callable[[int], Connect]  # the number of the broker in the list
    unsent: Callable[[], None]  # the broker was not reached: that CONNECT was never sent
    connected: Callable[[], None]
    message: Callable[[str, bytes], None]
    lost: Callable[[], None]
    tick: Callable[[], None]
    confirmed: Callable[[int], None] = lambda _: None  # the broker has taken all that was sent before this barrier


class MqttConnection:
    """Keeps one connection to one of `brokers` alive until it is closed."""

    def __init__(
        self,
        brokers: Sequence[BrokerAddress],
        client_id: str,
        listener: Listener,
        *,
        mqtt_version: int = 4,
        chance: Random | None = None,
    ) -> None:
        if mqtt_version not in (4, 5):
            raise ValueError(f"MQTT version {mqtt_version} is neither 4 (3.1.1) nor 5")
        if not brokers:
            raise ValueError("a connection needs at least one broker")
        for broker in brokers:
            for path in (broker.ca_file, broker.certificate_file, broker.key_file):
                if path is not None and not path.is_file():
                    raise BrokerAddressError(f"broker {broker.url}: there is no file {path}")
        self.last_error = ""
        self.connects = 0
        self.unsent = 0  # messages that were given to us for a connection that ended before it took them
        self._brokers = tuple(brokers)
        self._client_id = client_id
        self._listener = listener
        self._version = MQTTProtocolVersion.MQTTv5 if mqtt_version == 5 else MQTTProtocolVersion.MQTTv311
        self._chance = chance or Random()  # noqa: S311 — spreads reconnects, keeps no secret
        self._server = 0
        self._client: ReadingAheadClient | None = None
        self._accepted = self._reached = False
        self._outbox: deque[Action] = deque()
        self._barriers: dict[int, int] = {}  # packet id → token, of this connection
        self._stopping = threading.Event()
        self._asleep = self._reading = False
        self._ticked_s = 0.0
        self._ended = self._driving = False
        self._driven_s = 0.0
        self._idle = threading.Event()
        # Held by whoever calls paho: this connection's thread but for its waits, or a sender during one.
        self._touching = threading.RLock()
        self._wake_reader, self._wake_writer = socket.socketpair()
        self._wake_reader.setblocking(False)
        self._wake_writer.setblocking(False)
        self._thread = threading.Thread(target=self._run, name=f"mqtt {client_id}", daemon=True)

    # What other threads may call.

    def start(self) -> None:
        """Begin to connect; returns at once."""
        self._thread.start()

    def send(self, actions: Sequence[Action]) -> None:
        """Send these in order. They are dropped with the connection if it ends first.

        Where the connection's thread just waits, the caller writes to the socket itself: that saves waking a thread for each
        message. Where it does not, it finds them in the outbox before it waits again.
        """
        if not actions:
            return
        self._outbox.extend(actions)
        if not self._touching.acquire(blocking=False):
            return
        try:
            client = self._client
            if client is not None and threading.current_thread() is not self._thread:
                self._drain(client)
        finally:
            self._touching.release()
        if self._outbox and self._asleep:
            self._wake()

    def drive(self, timeout_s: float) -> bool:
        """Wait for packets in the caller's thread and handle them; False where there is no connection to drive.

        A thread that would only wait for messages may as well fetch them: that saves waking two threads for each. The
        connection's own thread keeps out of the way meanwhile, and takes over when nobody has driven for DRIVEN_S.
        """
        client = self._client
        if client is None or not self._accepted or self._ended:
            return False
        self._driving = True
        try:
            if not self._step(client, timeout_s):
                self._end(client)
        except Exception as error:
            # As in `_run`: the caller only waited for messages, and is not to fall with the connection.
            if not isinstance(error, OSError):
                _log.exception("%s: the session failed", self._client_id)
            self._note(str(error) or repr(error))
            self._end(client)
        finally:
            self._driven_s = time.monotonic()
            self._driving = False
        return True

    def _end(self, client: ReadingAheadClient) -> None:
        """A driver saw the end of this connection. The own thread may have seen it before, and have begun the next one."""
        if self._client is client:
            self._ended = True
            self._idle.set()

    @property
    def full(self) -> bool:
        """Whether the outbox holds so much that no more should be put into it: the broker takes less than we give."""
        return len(self._outbox) >= OUTBOX_MAX

    @property
    def backlog(self) -> int:
        """How many actions wait to be sent."""
        return len(self._outbox)

    def close(self, farewell: Sequence[Action], timeout_s: float) -> None:
        """Send the last messages, which end with a Disconnect, and stop."""
        self._outbox.extend(farewell)
        self._stopping.set()
        self._idle.set()
        self._wake()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        if not self._thread.is_alive():
            self._wake_reader.close()
            self._wake_writer.close()

    # The thread.

    def _run(self) -> None:
        pause_s = BACKOFF_S_MIN
        while not self._stopping.is_set():
            began_s = time.monotonic()
            try:
                self._serve(self._brokers[self._server])
            except (OSError, ValueError) as error:
                self._note(str(error))
            except Exception as error:
                # A bug in a listener must not silence the node for good: say it and connect anew.
                _log.exception("%s: the session failed", self._client_id)
                self._note(repr(error))
            # Only a connection that lasted was a good one: two nodes with one id throw each other out again and again.
            longest_s = BACKOFF_S_MAX if self._reached else ABSENT_S_MAX
            pause_s = BACKOFF_S_MIN if time.monotonic() - began_s > STABLE_S else min(2 * pause_s, longest_s)
            self._stopping.wait(pause_s * self._chance.uniform(0.8, 1.2))

    def _serve(self, broker: BrokerAddress) -> None:
        """One connection, from CONNECT to its end."""
        while self._outbox:
            self.unsent += isinstance(self._outbox.popleft(), Publish)
        connect = self._listener.connecting(self._server)
        client = self._new_client(broker, connect)
        if not self._stopping.is_set():
            self._idle.clear()
        self._ended = False
        self._client, self._accepted, self._reached = client, False, False
        self._barriers.clear()
        try:
            self._open(client, broker)
            self._reached = True
            while not self._ended:
                if self._driving or time.monotonic() - self._driven_s < DRIVEN_S:
                    self._idle.wait(DRIVEN_S)
                elif not self._step(client, TICK_S):
                    break
        finally:
            self._client = None
            self._listener.lost()
            if client.socket() is not None:
                client.on_disconnect = None
                self._abort(client)

    def _new_client(self, broker: BrokerAddress, connect: Connect) -> ReadingAheadClient:
        clean = None if self._version == MQTTProtocolVersion.MQTTv5 else True
        client = ReadingAheadClient(CallbackAPIVersion.VERSION2, self._client_id, clean_session=clean, protocol=self._version)
        client.connect_timeout = CONNECT_TIMEOUT_S
        # paho would hold back what exceeds 20 unacknowledged messages, and lose it, a death among them, at DISCONNECT.
        client.max_inflight_messages_set(UNACKNOWLEDGED_MAX)
        if connect.will is not None:
            client.will_set(*connect.will)
        client.on_connect = self._on_connect
        client.on_message = self._on_message
        client.on_disconnect = self._on_disconnect
        if broker.username is not None:
            client.username_pw_set(broker.username, broker.password)
        if broker.tls:
            ca_file, certificate, key = broker.ca_file, broker.certificate_file, broker.key_file
            try:
                client.tls_set(_text(ca_file), _text(certificate), _text(key))
            except OSError as error:
                self._listener.unsent()
                raise OSError(f"broker {broker.url}: {explained(error, broker)}") from error
        return client

    def _open(self, client: ReadingAheadClient, broker: BrokerAddress) -> None:
        try:
            if self._version == MQTTProtocolVersion.MQTTv5:
                properties: Any = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
                properties.SessionExpiryInterval = 0
                client.connect(broker.host, broker.port, KEEPALIVE_S, clean_start=True, properties=properties)
            else:
                client.connect(broker.host, broker.port, KEEPALIVE_S)
        except OSError as error:
            self._reached = isinstance(error, ssl.SSLError)  # somebody listens, whom each handshake costs something
            self._listener.unsent()
            raise OSError(f"no connection to {broker.url}: {explained(error, broker)}") from error

    def _step(self, client: ReadingAheadClient, wait_s_max: float) -> bool:
        """Wait for something to do and do it; False when the connection is over."""
        sock: Any = client.socket()
        if sock is None:
            return False
        self._asleep = True
        try:
            # Whatever was put into the outbox before `_asleep` was set is seen here; what comes later wakes us.
            wait_s = 0.0 if sock.pending() or (self._outbox and self._accepted and not client.want_write()) else wait_s_max
            descriptor = sock.fileno()
            readable = ready([sock, self._wake_reader], [sock] if client.want_write() else [], wait_s)
        except ValueError:
            return False  # another thread's write has found the connection broken and closed it
        finally:
            self._asleep = False
        with self._touching:
            if self._wake_reader.fileno() in readable:
                self._quiet()
            if (sock.pending() or descriptor in readable) and not self._read(client, sock):
                return False
            if client.want_write():
                client.loop_write()
            self._drain(client)
            now_s = time.monotonic()
            if now_s - self._ticked_s >= TICK_S:
                self._ticked_s = now_s
                client.loop_misc()
                self._listener.tick()
            return client.socket() is not None and not (self._stopping.is_set() and not self._outbox and not client.want_write())

    def _read(self, client: ReadingAheadClient, sock: Any) -> bool:
        """Handle all packets that have come."""
        self._reading = True
        try:
            while True:
                if client.loop_read() != MQTTErrorCode.MQTT_ERR_SUCCESS or client.socket() is None:
                    return False
                if not sock.pending():
                    return True
        finally:
            self._reading = False

    def _drain(self, client: ReadingAheadClient) -> None:
        """Hand actions to paho as long as the socket takes them."""
        if not self._accepted:
            return
        while self._outbox and not client.want_write() and client.socket() is not None:
            self._do(client, self._outbox.popleft())

    def _do(self, client: ReadingAheadClient, action: Action) -> None:
        if isinstance(action, Publish):
            client.publish(action.topic, action.payload, action.qos, action.retain)
        elif isinstance(action, Barrier):
            client.on_publish = self._on_publish  # only while a barrier is out: it would be called for each QoS 0 message too
            told = client.publish(action.topic, str(action.token), 1)
            if told.rc == MQTTErrorCode.MQTT_ERR_SUCCESS:  # else an older barrier, 65,535 packets ago, still has that id
                self._barriers[told.mid] = action.token
        elif isinstance(action, Subscribe):
            client.subscribe(action.topic_filter, action.qos)
        else:
            self._disconnect(client, with_will=not isinstance(action, Disconnect) or action.with_will)
            if not isinstance(action, Disconnect):
                self._server = (self._server + 1) % len(self._brokers)

    def _disconnect(self, client: ReadingAheadClient, *, with_will: bool) -> None:
        self._outbox.clear()
        if self._version == MQTTProtocolVersion.MQTTv5 and with_will:
            client.disconnect(reasoncode=ReasonCode(PacketTypes.DISCONNECT, identifier=4))
        else:
            client.disconnect()
        # A broker that takes nothing more must not keep us here: then the connection just ends, and the will is sent.
        deadline_s = time.monotonic() + CONNECT_TIMEOUT_S
        sock: Any = client.socket()
        while client.want_write() and client.socket() is not None and time.monotonic() < deadline_s:
            ready([], [sock], TICK_S)
            client.loop_write()

    @staticmethod
    def _abort(client: ReadingAheadClient) -> None:
        """Close without DISCONNECT, so that the broker sends the will."""
        sock: Any = client.socket()
        sock.abort()

    def _on_connect(self, _client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._note(f"{self._brokers[self._server].url} refused the connection: {reason}")
            return
        self.connects += 1
        self.last_error = ""
        self._accepted = True
        self._listener.connected()

    def _on_message(self, _client: Any, _userdata: Any, message: paho.MQTTMessage) -> None:
        self._listener.message(message.topic, bytes(message.payload))

    def _on_publish(self, client: Any, _userdata: Any, packet_id: int, reason: Any, _properties: Any) -> None:
        # What was read is an acknowledgement; a QoS 0 message that was written may have the id of a barrier, after 65,535 others.
        token = self._barriers.pop(packet_id, None) if self._reading else None
        if token is None:
            return
        if not self._barriers:
            client.on_publish = None
        if reason.is_failure:
            self._note(f"{self._brokers[self._server].url} refuses the barrier that shows what has arrived: {reason}")
        else:
            self._listener.confirmed(token)

    def _on_disconnect(self, client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        broker, failure = self._brokers[self._server], client.failure
        if reason.is_failure and isinstance(failure, ssl.SSLError):
            self._note(f"the connection to {broker.url} ended: {explained(failure, broker)}")
        elif reason.is_failure and not self.last_error:
            self._note(f"the connection to {broker.url} ended: {reason}")

    def _note(self, error: str) -> None:
        if error != self.last_error:
            _log.warning("%s: %s", self._client_id, error)
        self.last_error = error

    def _wake(self) -> None:
        with suppress(OSError):  # the pipe is full or closed: the thread is awake or gone
            self._wake_writer.send(b"w")

    def _quiet(self) -> None:
        with suppress(BlockingIOError):
            while self._wake_reader.recv(4096):
                pass


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)


def now_ms() -> int:
    """Milliseconds since 1970, UTC: the clock of Sparkplug time stamps."""
    return time.time_ns() // 1_000_000
