"""One attempt to connect: name, TCP and TLS, up to a CONNECT that is ready to be sent. It blocks."""

import ssl
from pathlib import Path
from typing import Any

from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from sparkplug.actions import Connect
from sparkplug.broker import BrokerAddress
from sparkplug.transport.paho_client import CONNECT_TIMEOUT_S, StreamClient
from sparkplug.transport.tls_failure import explained

KEEPALIVE_S = 15
UNACKNOWLEDGED_MAX = 65_535  # all packet ids


class UnreachableError(OSError):
    """The broker was not reached. `is_listening`: somebody was, whom each handshake costs something."""

    def __init__(self, text: str, *, is_listening: bool = False) -> None:
        super().__init__(text)
        self.is_listening = is_listening


def dialled(broker: BrokerAddress, client_id: str, version: MQTTProtocolVersion, connect: Connect) -> StreamClient:
    """Return a client on a connected socket; raises UnreachableError."""
    client = _new_client(broker, client_id, version, connect)
    try:
        if version == MQTTProtocolVersion.MQTTv5:
            properties: Any = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
            properties.SessionExpiryInterval = connect.keep_s
            client.connect(broker.host, broker.port, KEEPALIVE_S, clean_start=not connect.keep_s, properties=properties)
        else:
            client.connect(broker.host, broker.port, KEEPALIVE_S)
    except OSError as error:
        reason = f"no connection to {broker.url}: {explained(error, broker)}"
        raise UnreachableError(reason, is_listening=isinstance(error, ssl.SSLError)) from error
    return client


def _new_client(broker: BrokerAddress, client_id: str, version: MQTTProtocolVersion, connect: Connect) -> StreamClient:
    # paho would answer a refused version by another connection of its own, in the thread that reads.
    is_clean = None if version == MQTTProtocolVersion.MQTTv5 else not connect.keep_s
    options: Any = {"clean_session": is_clean, "reconnect_on_failure": False}
    client = StreamClient(CallbackAPIVersion.VERSION2, client_id, protocol=version, **options)
    client.connect_timeout = CONNECT_TIMEOUT_S
    # paho would hold back what exceeds 20 unacknowledged messages, and lose it, a death among them, at DISCONNECT.
    client.max_inflight_messages_set(UNACKNOWLEDGED_MAX)
    if connect.will is not None:
        client.will_set(*connect.will)
    if broker.username is not None:
        client.username_pw_set(broker.username, broker.password)
    if broker.tls:
        try:
            client.tls_set(_text(broker.ca_file), _text(broker.certificate_file), _text(broker.key_file))
        except OSError as error:
            raise UnreachableError(f"broker {broker.url}: {explained(error, broker)}") from error
    return client


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
