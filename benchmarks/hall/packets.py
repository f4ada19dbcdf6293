"""MQTT 3.1.1 packets as bytes, as few as the load and the reader of a fleet need, and the stream taken apart again.

A client library would cost more than what is measured: here a packet is made once and sent with one system call.
"""

import socket
import struct
from collections.abc import Sequence

from sparkplug.layouts.varint import written

CONNACK, PUBLISH, PUBACK, SUBSCRIBE, PINGREQ = 0x20, 0x30, 0x40, 0x82, b"\xc0\x00"
READ_BYTES = 1 << 18


def text(words: str | bytes) -> bytes:
    """Return a string with its length before it."""
    raw = words.encode() if isinstance(words, str) else words
    return struct.pack(">H", len(raw)) + raw


def packet(first: int, body: bytes) -> bytes:
    """Return a packet: its first byte, the length of the rest, the rest."""
    return bytes((first,)) + written(len(body)) + body


def publish(topic: str, payload: bytes) -> bytes:
    """Return a PUBLISH of QoS 0.

    >>> publish("a/b", b"hi").hex(" ")
    '30 07 00 03 61 2f 62 68 69'
    """
    return packet(PUBLISH, text(topic) + payload)


def subscribe(filters: Sequence[str]) -> bytes:
    """Return a SUBSCRIBE of QoS 0."""
    return packet(SUBSCRIBE, b"\x00\x01" + b"".join(text(wanted) + b"\x00" for wanted in filters))


def connect(client: str, keep_alive_s: int, will: tuple[str, bytes] | None = None) -> bytes:
    """Return a CONNECT with a clean session, and a will of QoS 1 where one is given."""
    flags, tail = 0x02, b""
    if will is not None:
        flags |= 0x04 | 0x08
        tail = text(will[0]) + text(will[1])
    return packet(0x10, text("MQTT") + bytes((4, flags)) + struct.pack(">H", keep_alive_s) + text(client) + tail)


def connected(port: int, hello: bytes) -> socket.socket:
    """Return a socket on which the broker has accepted the CONNECT `hello`."""
    sock = socket.create_connection(("127.0.0.1", port), timeout=30.0)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.sendall(hello)
    answer = sock.recv(4, socket.MSG_WAITALL)
    if len(answer) != 4 or answer[0] != CONNACK or answer[3]:
        raise SystemExit(f"the broker on port {port} refuses a connection: {answer!r}")
    return sock


class Stream:
    """A stream of bytes from a socket, taken apart into packets."""

    def __init__(self) -> None:
        self._rest = b""

    def published(self, data: bytes) -> list[tuple[str, bytes]]:
        """Return topic and payload of each PUBLISH that is complete by now; other packets are passed over."""
        data = self._rest + data if self._rest else data
        found, at, size = [], 0, len(data)
        while size - at >= 2:
            length, shift, begin = 0, 0, at + 1
            while begin < size:
                digit = data[begin]
                length |= (digit & 0x7F) << shift
                shift, begin = shift + 7, begin + 1
                if digit < 0x80:
                    break
            else:
                break
            end = begin + length
            if end > size:
                break
            first = data[at]
            if first & 0xF0 == PUBLISH:
                after = begin + 2 + (data[begin] << 8 | data[begin + 1])
                payload_at = after + 2 if first & 0x06 else after
                found.append((data[begin + 2 : after].decode(), data[payload_at:end]))
            at = end
        self._rest = data[at:]
        return found
