"""paho's client on a stream of ours, and a TLS handshake that cleans up after itself.

The two methods that are overridden are paho's own seams: its websockets wrap the socket in `_create_socket` too. Its keep-alive
counts from two moments, which are set here when the stream is used past it.
"""

import socket
import ssl
from typing import Any

import paho.mqtt.client as paho

from sparkplug.transport.stream import Stream

CONNECT_TIMEOUT_S = 5.0


class StreamClient(paho.Client):
    """A paho client on a `Stream`."""

    stream: Stream | None = None

    def heard(self, now_s: float) -> None:
        """Bytes have come from the broker (by time.monotonic)."""
        self._last_bytes_received = now_s

    def wrote(self, now_s: float) -> None:
        """Packets have gone to the broker."""
        self._last_msg_out = now_s

    def _ssl_wrap_socket(self, tcp_sock: Any) -> Any:
        """As paho's, but a handshake that fails leaves no open socket behind, and one that hangs ends with CONNECT_TIMEOUT_S."""
        context: ssl.SSLContext = self._ssl_context  # type: ignore[assignment]
        wrapped = context.wrap_socket(tcp_sock, server_hostname=self._host, do_handshake_on_connect=False)
        wrapped.settimeout(CONNECT_TIMEOUT_S)
        try:
            wrapped.do_handshake()
        except BaseException:
            wrapped.close()
            raise
        return wrapped

    def _create_socket(self) -> Any:
        sock: Any = super()._create_socket()
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.stream = Stream(sock)
        return self.stream
