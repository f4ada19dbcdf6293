"""A control that accepts and hangs up at once, for ever: each kind of edge asks it less and less often."""

import socket
import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import pytest

from edge.config import EdgeConfig
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.connection import FocasConnection
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.connection import HeidenhainConnection
from tests.edge.controls.mtconnect.test_connection import server

TRIES = 10


def hang_up(client: socket.socket) -> None:
    client.shutdown(socket.SHUT_RDWR)


def focas(url: str, wait: Callable[[float], object]) -> Any:
    source = FocasConfig(host="127.0.0.1", port=urlsplit(url).port or 0, backend="ethernet", timeout_s=5.0)
    return FocasConnection(EdgeConfig(source=source), wait=wait)


def heidenhain(url: str, wait: Callable[[float], object]) -> Any:
    source = HeidenhainConfig(url=url.replace("http", "lsv2"), timeout_s=5.0)
    return HeidenhainConnection(EdgeConfig(source=source), wait=wait)


def opcua(url: str, wait: Callable[[float], object]) -> Any:
    pytest.importorskip("asyncua")
    from edge.controls.opcua.config import OpcUaConfig
    from edge.controls.opcua.connection import OpcUaConnection

    class Recorded(OpcUaConnection):
        def _backoff_s(self) -> float:
            wait(super()._backoff_s())
            return 0.0

    return Recorded(EdgeConfig(source=OpcUaConfig(url=url.replace("http", "opc.tcp"), security="none", timeout_s=5.0)))


@pytest.mark.parametrize("made", [focas, heidenhain, opcua])
def test_the_pause_grows(made: Callable[[str, Callable[[float], object]], Any]) -> None:
    waited = list[float]()
    enough = threading.Event()

    def wait(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) >= TRIES:
            enough.set()

    with server(hang_up) as url:
        connection = made(url, wait)
        thread = threading.Thread(target=lambda: list(connection.frames()), daemon=True)
        thread.start()
        assert enough.wait(120), (waited, connection.last_error)
        connection.close()
        thread.join(60)
    assert not thread.is_alive()
    assert all(seconds >= 0.125 * 2**turn for turn, seconds in enumerate(waited[:7])), waited
    assert max(waited) <= 30.0
    assert connection.reconnects >= TRIES
