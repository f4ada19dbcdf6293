"""An MQTT client that does what it is told, allowed or not: what our own clients would never send."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from sparkplug.broker import BrokerAddress

PATIENCE_S = 60.0
DENIED = 0x87
Will = tuple[str, bytes, bool]  # topic, payload, retained


class WireClient:
    """Connected when it is entered.

    `received`: topic and payload of all that has come; `refused`: the packet ids of the publishes that the broker said no to,
    which only MQTT 5 tells.
    """

    def __init__(
        self, address: BrokerAddress, client_id: str = "", will: Will | None = None, patience_s: float = PATIENCE_S
    ) -> None:
        self.received: list[tuple[str, bytes]] = []
        self.refused: set[int] = set()
        self.lost = threading.Event()
        self._connected, self._address = threading.Event(), address
        self._patience_s = patience_s
        self._acknowledged: set[int] = set()
        self._subscribed, self._reads = threading.Semaphore(0), threading.Event()
        self._reads.set()
        version = MQTTProtocolVersion.MQTTv5 if address.mqtt_version == 5 else MQTTProtocolVersion.MQTTv311
        client = self._client = paho.Client(
            CallbackAPIVersion.VERSION2, client_id or f"wire-{id(self)}", protocol=version, reconnect_on_failure=False
        )
        client.max_inflight_messages_set(10_000)
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_message, client.on_publish = self._on_message, self._on_publish
        client.on_subscribe = lambda *_: self._subscribed.release()
        if will is not None:
            client.will_set(will[0], will[1], 1, will[2])
        if address.username is not None:
            client.username_pw_set(address.username, address.password)
        if address.tls:
            client.tls_set(
                *(None if p is None else str(p) for p in (address.ca_file, address.certificate_file, address.key_file))
            )

    def __enter__(self) -> WireClient:
        self._client.connect(self._address.host, self._address.port)
        self._client.loop_start()
        if not self._connected.wait(self._patience_s):
            self._client.loop_stop()
            raise AssertionError("the broker did not accept the connection")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reads.set()
        self._client.disconnect()
        self._client.loop_stop()

    def subscribe(self, *filters: str) -> None:
        """Subscribe, and wait until the broker has answered."""
        for wanted in filters:
            self._client.subscribe(wanted, 1)
            assert self._subscribed.acquire(timeout=PATIENCE_S), f"no answer to the subscription {wanted}"

    def publish(self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False) -> int:
        """Publish; the packet id."""
        return self._client.publish(topic, payload, qos, retain).mid

    def settle(self, *packet_ids: int) -> None:
        """Wait until the broker has answered these publishes."""
        self.until(lambda: self._acknowledged.issuperset(packet_ids), "the acknowledgements")

    def until(self, true: Callable[[], Any], what: str) -> None:
        """Wait for something."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not true():
            assert time.monotonic() < deadline_s, f"{what} did not come within {PATIENCE_S:g} s"
            time.sleep(0.005)

    def hear(self, topic: str, payload: bytes) -> None:
        """Wait for this message: the broker takes one packet after another, so what was sent before has come by then."""
        self.until(lambda: (topic, payload) in self.received, f"{topic} {payload!r}")

    def cut(self) -> None:
        """End the connection without a word, so that the broker publishes the will."""
        sock: Any = self._client.socket()
        sock.shutdown(socket.SHUT_RDWR)
        self._client.loop_stop()
        sock.close()

    def pause(self) -> None:
        """Read nothing any more, as a program does that hangs."""
        self._reads.clear()

    def resume(self) -> None:
        """Go on reading."""
        self._reads.set()

    def _on_connect(self, _client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if not reason.is_failure:
            self._connected.set()

    def _on_disconnect(self, *_: Any) -> None:
        self.lost.set()

    def _on_message(self, _client: Any, _userdata: Any, message: paho.MQTTMessage) -> None:
        self._reads.wait()
        self.received.append((message.topic, bytes(message.payload)))

    def _on_publish(self, _client: Any, _userdata: Any, packet_id: int, reason: Any, _properties: Any) -> None:
        if reason.value == DENIED:
            self.refused.add(packet_id)
        self._acknowledged.add(packet_id)
