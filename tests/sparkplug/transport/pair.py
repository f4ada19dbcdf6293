"""Clients on one end of a socket pair, as if they had dialled the other."""

from __future__ import annotations

import socket

from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from sparkplug.actions import Connect
from sparkplug.transport.listener import Listener
from sparkplug.transport.paho_client import StreamClient
from sparkplug.transport.stream import Stream


def nothing(*_: object) -> None:
    pass


def listener_of(**told: object) -> Listener:
    """A listener that does nothing but what is given."""
    calls = dict.fromkeys(("unsent", "connected", "message", "lost", "tick"), nothing)
    return Listener(**{"connecting": lambda _: Connect(None), **calls, **told})  # type: ignore[arg-type]


def client_on(sock: socket.socket, version: int = 4) -> tuple[StreamClient, Stream]:
    """A client that seems to have dialled this socket."""
    protocol = MQTTProtocolVersion(version)
    client = StreamClient(CallbackAPIVersion.VERSION2, "test", protocol=protocol, reconnect_on_failure=False)
    client.max_inflight_messages_set(65_535)
    sock.setblocking(False)
    stream = Stream(sock)
    client.stream = stream
    client._sock = stream
    return client, stream
