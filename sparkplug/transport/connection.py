"""A connection to a broker that is kept alive until it is closed.

Other threads put actions into a bounded outbox; the loop's lock keeps paho to one thread at a time. Each connection is a new paho
client, so that nothing of an earlier session is ever sent again.

    dialling ──connected──► open ──DISCONNECT──► leaving ──all sent──► lingering ──► over ──pause──► dialling
"""

import logging
import ssl
import threading
import time
from collections import deque
from collections.abc import Sequence
from random import Random
from typing import Any

from paho.mqtt.enums import MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Acknowledge, Action, Barrier, Connect, Disconnect, Publish, Subscribe
from sparkplug.broker import BrokerAddress
from sparkplug.errors import BrokerAddressError
from sparkplug.transport.data_path import DataPath
from sparkplug.transport.dialling import UnreachableError, dialled
from sparkplug.transport.itinerary import PAUSE_S_MAX, Itinerary
from sparkplug.transport.listener import Listener
from sparkplug.transport.loop import TICK_S, Loop
from sparkplug.transport.paho_client import CONNECT_TIMEOUT_S, StreamClient
from sparkplug.transport.paho_path import PahoPath
from sparkplug.transport.rival import Rival
from sparkplug.transport.sendable import PACKET_BYTES_MAX, Sendable
from sparkplug.transport.stream import Stream
from sparkplug.transport.tls_failure import explained

OUTBOX_MAX = 20_000
OUTBOX_BYTES_MAX = 64 * 1024 * 1024
GATHERED_MAX = 200  # actions that wait for the next turn
SEND_BYTES_MAX = 128 * 1024  # that gather for one call
READS_MAX = 32  # of one connection in a turn, so that it keeps no other waiting
LINGER_S_MAX = 0.5
_log = logging.getLogger(__name__)


class MqttConnection:
    """Keeps one connection to one of `brokers` alive until it is closed.

    `loop` serves it; without one it has a loop of its own. `data_path` False leaves messages to paho as well.
    """

    def __init__(
        self,
        brokers: Sequence[BrokerAddress],
        client_id: str,
        listener: Listener,
        *,
        mqtt_version: int = 4,
        chance: Random | None = None,
        loop: Loop | None = None,
        data_path: bool = True,
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
        self.session_present = False  # the broker has kept the session, and what it could not deliver
        self.unsent = 0  # messages that were given to us for a connection that ended before it took them
        self.sendable = Sendable(client_id)
        self.loop = loop or Loop(f"mqtt {client_id}")
        self._itinerary = Itinerary(brokers, chance or Random())  # noqa: S311 — spreads reconnects, keeps no secret
        self._client_id = client_id
        self._listener = listener
        self._version = MQTTProtocolVersion.MQTTv5 if mqtt_version == 5 else MQTTProtocolVersion.MQTTv311
        self._has_data_path = data_path
        self._client: StreamClient | None = None
        self._stream: Stream | None = None
        self._path: PahoPath | None = None
        self._accepted = self._reached = self._reading = False
        self._rival = Rival(client_id)
        self._writes_later = False  # the socket takes no more for now
        self._is_finished = False  # nothing more is sent on this socket
        self._is_unread = False  # there was more to read than in one turn
        self._outbox: deque[Action] = deque()
        self._taken_bytes = self._sent_bytes = 0  # payloads that came into the outbox, and that left it
        self._dial_s: float | None = None  # when the next attempt is due; None while there is one or a connection
        self._until_s: float | None = None  # when leaving or lingering has lasted long enough
        self._stopping = False
        self._gone = threading.Event()
        self._gone.set()  # there is nothing to wait for before `start`

    # What other threads may call.

    def start(self) -> None:
        """Begin to connect; returns at once."""
        self._gone.clear()
        self.loop.add(self)
        self._dial()

    def send(self, actions: Sequence[Action]) -> None:
        """Send these in order. They are dropped with the connection if it ends first.

        What the thread sends that turns the loop goes out when the loop next turns, or when much has gathered.
        """
        if not actions:
            return
        self._taken_bytes += sum([len(action[1]) for action in actions if isinstance(action, Publish)])
        self._outbox.extend(actions)
        self.loop.push(self, now=len(self._outbox) >= GATHERED_MAX)

    @property
    def full(self) -> bool:
        """True if no more should be put into the outbox: the broker takes less than it is given."""
        return len(self._outbox) >= OUTBOX_MAX or self._taken_bytes - self._sent_bytes >= OUTBOX_BYTES_MAX

    @property
    def backlog(self) -> int:
        """The number of actions that wait to be sent."""
        return len(self._outbox)

    def close(self, farewell: Sequence[Action], timeout_s: float) -> None:
        """Send the last messages, which end with a Disconnect, and stop."""
        if self._gone.is_set():
            return
        deadline_s = time.monotonic() + timeout_s
        self._outbox.extend(farewell)
        self._stopping = True
        self.loop.due.add(self)
        with self.loop.lock:
            if self._dial_s is not None:
                self._leave_the_loop()
        while not self._gone.is_set() and (left_s := deadline_s - time.monotonic()) > 0.0:
            if not self.loop.turn(min(left_s, TICK_S)):
                self._gone.wait(min(left_s, TICK_S))
        with self.loop.lock:
            if not self._gone.is_set():
                self._over()
        self.loop.join(max(deadline_s - time.monotonic(), TICK_S))

    # One attempt, in a thread of its own: a broker that does not answer keeps nobody else waiting.

    def _dial(self) -> None:
        self._dial_s = None
        try:
            threading.Thread(target=self._attempt, name=f"dial {self._client_id}", daemon=True).start()
        except RuntimeError as error:  # the system gives no more threads for now
            self._note(str(error))
            self._dial_s = time.monotonic() + PAUSE_S_MAX

    def _attempt(self) -> None:
        self._reached = False
        client: StreamClient | None = None
        try:
            while self._outbox:
                self.unsent += isinstance(self._outbox.popleft(), Publish)
            connect = self._listener.connecting(self._itinerary.server)
            client = self._dialled(self._itinerary.broker, connect)
            self._reached = True
        except (OSError, ValueError) as error:
            self._note(str(error))
        except Exception as error:
            self._note_bug(error)
        with self.loop.lock:
            if client is None or client.stream is None:
                self._over()
            elif self._gone.is_set():
                client.stream.abort()
            else:
                self._begin(client, client.stream)
        self.loop.nudge()

    def _dialled(self, broker: BrokerAddress, connect: Connect) -> StreamClient:
        try:
            return dialled(broker, self._client_id, self._version, connect)
        except UnreachableError as error:
            self._reached = error.is_listening
            self._listener.unsent()
            raise

    # What the loop calls, and holds its lock meanwhile.

    def ready(self, *, readable: bool, writable: bool) -> None:
        """Read or write what the socket has or takes."""
        client, stream, path = self._client, self._stream, self._path
        if client is None or stream is None or path is None:
            return
        try:
            if readable:
                self._read(client, stream, path)
            if writable:
                self._write()
            self._settle()
        except Exception as error:
            self._fail(error)

    def flush(self) -> None:
        """Write what is to be sent. Called by any thread that sends; it ends no connection."""
        if not self._writes_later:
            self._write()
        stream = self._stream
        if self._reading or (stream is not None and (stream.has_ended or self._until_s is not None)):
            self.loop.due.add(self)

    def serve(self) -> None:
        """Write what is to be sent, and see whether the connection goes on."""
        is_unread, self._is_unread = self._is_unread, False
        self.ready(readable=is_unread, writable=not self._writes_later)

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        if self._client is None:
            if self._dial_s is not None and now_s >= self._dial_s:
                self._dial()
        elif self._until_s is not None:
            if now_s >= self._until_s:
                self._over()
        else:
            try:
                self._client.loop_misc()
                self._listener.tick()
            except Exception as error:
                self._fail(error)
            else:
                self.serve()

    # The connection, from CONNECT to its end.

    def _begin(self, client: StreamClient, stream: Stream) -> None:
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        self._path = (DataPath if self._has_data_path else PahoPath)(client, stream, self._listener, self._refused, self.sendable)
        self._client, self._stream = client, stream
        self._accepted = self._writes_later = self._is_finished = self._is_unread = False
        self.loop.watch(stream.fileno(), self, for_writing=False)
        self.serve()

    def _read(self, client: StreamClient, stream: Stream, path: PahoPath) -> None:
        """Handle all that has come."""
        self._reading = True
        try:
            for _ in range(READS_MAX):
                data = stream.receive()
                if data and self._until_s is None:  # what comes after our DISCONNECT is thrown away
                    client.heard(time.monotonic())
                    path.received(data)
                if not stream.may_hold_more(data) or client.socket() is None:
                    return
        finally:
            self._reading = False
        self._is_unread = True
        self.loop.due.add(self)

    def _write(self) -> None:
        """Write actions as long as the socket takes them."""
        client, stream, path = self._client, self._stream, self._path
        if client is None or stream is None or path is None or self._reading:
            return
        goes_on = True
        while goes_on:
            goes_on = self._drain(client, stream, path)
            if stream.size and stream.flush():
                client.wrote(time.monotonic())
            goes_on = goes_on and not stream.size
        writes_later = stream.size > 0 and not stream.has_ended
        if writes_later != self._writes_later:
            self._writes_later = writes_later
            self.loop.watch(stream.fileno(), self, for_writing=writes_later)

    def _drain(self, client: StreamClient, stream: Stream, path: PahoPath) -> bool:
        """Compose packets for what is in the outbox; True where more of it can follow when these are sent."""
        if client.want_write():
            client.loop_write()
        outbox = self._outbox
        while self._accepted and outbox:
            self._sent_bytes += path.publish_unconfirmed(outbox, SEND_BYTES_MAX)
            if stream.size >= SEND_BYTES_MAX:
                return True
            if not outbox:
                break
            action = outbox.popleft()
            if isinstance(action, Publish):
                if not path.publish(action):
                    outbox.appendleft(action)
                    return False
                self._sent_bytes += len(action.payload)
            elif isinstance(action, Barrier):
                if not path.barrier(action.topic, action.token):
                    outbox.appendleft(action)
                    return False
            elif isinstance(action, Acknowledge):
                path.acknowledge(action.packet_ids)
            elif isinstance(action, Subscribe):
                client.subscribe(action.topic_filter, action.qos)
            else:
                self._leave(client, with_will=not isinstance(action, Disconnect) or action.with_will)
                if not isinstance(action, Disconnect):
                    self._itinerary.walk()
        if not outbox:
            self._sent_bytes = self._taken_bytes
        return False

    def _leave(self, client: StreamClient, *, with_will: bool) -> None:
        self._accepted = False
        self._outbox.clear()
        if self._version == MQTTProtocolVersion.MQTTv5 and with_will:
            client.disconnect(reasoncode=ReasonCode(PacketTypes.DISCONNECT, identifier=4))
        else:
            client.disconnect()
        # A broker that takes nothing more must not keep us here: then the connection just ends, and the will is sent.
        self._until_s = time.monotonic() + CONNECT_TIMEOUT_S

    def _settle(self) -> None:
        """See whether the connection has ended, or should."""
        client, stream, path = self._client, self._stream, self._path
        if client is None or stream is None or path is None:
            return
        if stream.has_ended and client.socket() is not None:
            path.ended()
        if self._until_s is not None and not stream.has_ended:
            if not self._is_finished and not stream.size:
                stream.finish()
                self._is_finished = True
                self._until_s = time.monotonic() + LINGER_S_MAX
        elif client.socket() is None or (self._stopping and not self._outbox and not stream.size):
            self._over()

    def _over(self) -> None:
        """The connection has ended, or the attempt."""
        stream = self._stream
        if stream is not None:
            self.unsent += stream.unsent
            self.loop.unwatch(stream.fileno())
            stream.abort()
        self._client = self._stream = self._path = self._until_s = None
        self._accepted = False
        try:
            self._listener.lost()
        except Exception as error:
            self._note_bug(error)
        if self._stopping:
            self._leave_the_loop()
            return
        now_s = time.monotonic()
        self._dial_s = now_s + self._itinerary.ended(now_s, somebody_listens=self._reached)
        self.loop.at(self._dial_s)

    def _leave_the_loop(self) -> None:
        self._dial_s = None
        self.loop.remove(self)
        self._gone.set()

    def _fail(self, error: Exception) -> None:
        """End the connection for an error that is not its own: a bug in a listener must not silence the node for good."""
        if isinstance(error, OSError):
            self._note(str(error))
        else:
            self._note_bug(error)
        self._over()

    # What paho calls.

    def _on_connect(self, _client: Any, _userdata: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._note(f"{self._itinerary.broker.url} refused the connection: {reason}")
            return
        self.connects += 1
        self.session_present = flags.session_present
        self.last_error = ""
        self._accepted = True
        self._rival.began(time.monotonic())
        self.sendable.packet_bytes_max = getattr(properties, "MaximumPacketSize", PACKET_BYTES_MAX)
        self._itinerary.accepted(time.monotonic())
        self._listener.connected()

    def _on_disconnect(self, _client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        broker, failure = self._itinerary.broker, None if self._stream is None else self._stream.failure
        if reason.is_failure and isinstance(failure, ssl.SSLError):
            self._note(f"the connection to {broker.url} ended: {explained(failure, broker)}")
        elif reason.is_failure and not self.last_error:
            self._note(f"the connection to {broker.url} ended: {self._rival.ended(time.monotonic(), reason)}")

    def _refused(self, reason: str) -> None:
        self._note(f"{self._itinerary.broker.url} refuses the barrier that shows what has arrived: {reason}")

    def _note(self, error: str) -> None:
        if error != self.last_error:
            _log.warning("%s: %s", self._client_id, error)
        self.last_error = error

    def _note_bug(self, error: Exception) -> None:
        _log.error("%s: the session failed", self._client_id, exc_info=error)
        self._note(str(error) or repr(error))
