"""Hostile senders: what a broken or malicious edge, or somebody who reaches the page, sends at the plant.

Each is a function that goes on until `stop` is set. They speak MQTT and HTTP by themselves: our own edge would refuse to send
most of this.
"""

import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from threading import Event
from typing import Any
from urllib.parse import urlsplit

import httpx
import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from sparkplug.datatype import DataType
from sparkplug.schema import PayloadMessage
from twin.vocabulary.topics import JOBS_STATE, VALIDATION

GROUP, NODE = "cnc", "edge-hostile"
YEARS_900_MS = 900 * 365 * 86_400_000


@dataclass(frozen=True, slots=True)
class Target:
    """The plant that is attacked: the port of its broker, and its page."""

    port: int
    page_url: str


Attack = Callable[[Target, Event], None]


class HostileNode:
    """An edge node that says whatever it is told, in right sequence."""

    def __init__(self, target: Target, node: str = NODE) -> None:
        self.node, self.seq, self.sent = node, 0, 0
        self.client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id=f"hostile-{node}"[:60])
        self.client.max_queued_messages_set(2_000)
        self.client.connect("127.0.0.1", target.port)
        self.client.loop_start()
        self.born(())

    def born(self, metrics: Sequence[dict[str, Any]]) -> None:
        """Publish an NBIRTH."""
        self.seq = 0
        death = {"name": "bdSeq", "datatype": DataType.INT64, "long_value": 1}
        self._publish(f"spBv1.0/{GROUP}/NBIRTH/{self.node}", [death, *metrics])

    def say(self, verb: str, device: str, metrics: Sequence[dict[str, Any]], *, stamp_ms: int | None = None) -> None:
        """Publish a message of a device."""
        self._publish(f"spBv1.0/{GROUP}/{verb}/{self.node}/{device}", metrics, stamp_ms)

    def _publish(self, topic: str, metrics: Sequence[dict[str, Any]], stamp_ms: int | None = None) -> None:
        now_ms = time.time_ns() // 1_000_000
        message = PayloadMessage(timestamp=now_ms if stamp_ms is None else stamp_ms, seq=self.seq)
        for metric in metrics:
            message.metrics.add(**{"timestamp": now_ms, **metric})
        self.seq = (self.seq + 1) % 256
        self.client.publish(topic, message.SerializeToString())
        self.sent += 1

    def close(self) -> None:
        """Leave without a word."""
        self.client.loop_stop()
        self.client.disconnect()


def number(name: str, value: float = 1.0, **more: Any) -> dict[str, Any]:
    """Return a metric of a birth."""
    return {"name": name, "datatype": DataType.DOUBLE, "double_value": value, **more}


def text(name: str, value: str, **more: Any) -> dict[str, Any]:
    """Return a metric of a birth that is a text."""
    return {"name": name, "datatype": DataType.STRING, "string_value": value, **more}


def _each(target: Target, stop: Event, pause_s: float, say: Callable[[HostileNode, int], None]) -> None:
    node = HostileNode(target)
    count = 0
    while not stop.wait(pause_s):
        say(node, count)
        count += 1
    node.close()


def long_device(target: Target, stop: Event) -> None:
    """A device named 30,000 × `%`, which triples under escaping."""
    _each(target, stop, 0.5, lambda node, _: node.say("DBIRTH", "%" * 30_000, [number("spindle_rpm")]))


def long_metric(target: Target, stop: Event) -> None:
    """A metric name of 70,000 bytes, and one with control characters."""

    def say(node: HostileNode, count: int) -> None:
        name = "x" * 70_000 if count % 2 else "a\x01b\x7f\ufffe"
        node.say("DBIRTH", "hostile", [number(name), number("spindle_rpm")])
        node.say("DDATA", "hostile", [number(name), number("spindle_rpm", float(count))])

    _each(target, stop, 0.1, say)


def stamps(target: Target, stop: Event) -> None:
    """Time stamps of 2^64 − 1, 2^63, 900 years ahead, and 0."""
    wild = (2**64 - 1, 2**63, time.time_ns() // 1_000_000 + YEARS_900_MS, 0)

    def say(node: HostileNode, count: int) -> None:
        stamp = wild[count % len(wild)]
        if count % 40 == 0:
            node.say("DBIRTH", "hostile", [number("spindle_rpm"), number("spindle_load_pct")])
        node.say("DDATA", "hostile", [number("spindle_rpm", count, timestamp=stamp)])
        node.say("DDATA", "hostile", [number("spindle_load_pct", count)], stamp_ms=stamp)

    _each(target, stop, 0.05, say)


def reserved(target: Target, stop: Event) -> None:
    """A machine named `jobs`, whose mirror would lie on the topics of the jobs; and states that break a page."""

    def say(node: HostileNode, _: int) -> None:
        node.say("DBIRTH", "jobs", [text("state", "[]"), text("request", "{}")])
        node.say(
            "DBIRTH", "hostile", [text("exec_state", "constructor"), text("tool_number", "__proto__"), number("spindle_rpm")]
        )
        for topic in (JOBS_STATE, f"{VALIDATION}hostile", "cnctwin/alerts/state"):
            node.client.publish(topic, b'{"jobs": 7, "alerts": "no"}')

    _each(target, stop, 0.5, say)


def births(target: Target, stop: Event) -> None:
    """300 devices with 1,000 metrics each, again and again."""

    def say(node: HostileNode, count: int) -> None:
        metrics = [number(f"m{index}", alias=count % 300 * 1_000 + index) for index in range(1_000)]
        node.say("DBIRTH", f"hostile-{count % 300}", metrics)

    _each(target, stop, 0.1, say)


def devices(target: Target, stop: Event) -> None:
    """A new device with each message, 200 a second."""
    _each(target, stop, 0.005, lambda node, count: node.say("DBIRTH", f"hostile-{count}", [number("spindle_rpm")]))


def flood(target: Target, stop: Event) -> None:
    """1,000 messages a second from one machine, each with twelve signals."""
    node = HostileNode(target)
    names = ("spindle_rpm", "spindle_load_pct", "spindle_temp_c", "feed_mm_min", *(f"axis_{a}_pos_mm" for a in "xyzabcuv"))
    node.say("DBIRTH", "hostile", [number(name, alias=index + 1) for index, name in enumerate(names)])
    began_s = time.monotonic()
    count = 0
    while not stop.is_set():
        while count < (time.monotonic() - began_s) * 1_000:
            count += 1
            node.say(
                "DDATA", "hostile", [{"alias": index + 1, "double_value": count % 97 + index} for index in range(len(names))]
            )
        time.sleep(0.005)
    node.close()


def alarms(target: Target, stop: Event) -> None:
    """An alarm text that is never the same, and a load that goes over its limit and back, 200 times a second."""
    node = HostileNode(target)
    node.say("DBIRTH", "hostile", [number("spindle_load_pct"), number("spindle_rpm", 5_000.0), text("alarm", "none")])
    count = 0
    while not stop.wait(0.005):
        count += 1
        node.say("DDATA", "hostile", [number("spindle_load_pct", 180.0 if count % 2 else 10.0), text("alarm", f"alarm {count}")])
    node.close()


def silent_clients(target: Target, stop: Event) -> None:
    """305 connections to the page that say nothing."""
    address = urlsplit(target.page_url)
    held: list[socket.socket] = []
    while not stop.wait(0.5):
        held = [one for one in held if not _is_closed(one)]
        while len(held) < 305 and not stop.is_set():
            try:
                held.append(socket.create_connection((address.hostname or "", address.port or 80), timeout=1.0))
            except OSError:
                break
    for one in held:
        one.close()


def _is_closed(one: socket.socket) -> bool:
    one.setblocking(False)
    try:
        return one.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def unfinished_logins(target: Target, stop: Event) -> None:
    """Log-ins that announce 7.9 MB and never end, 60 at a time, and wrong tokens."""
    address = urlsplit(target.page_url)
    lines = ("POST /login HTTP/1.1", f"Host: {address.netloc}", "Content-Type: application/json", "Content-Length: 7900000")
    head = ("\r\n".join(lines) + "\r\n\r\n").encode()
    held: list[socket.socket] = []
    while not stop.wait(0.2):
        held = [one for one in held if not _is_closed(one)]
        while len(held) < 60 and not stop.is_set():
            with suppress(OSError):
                one = socket.create_connection((address.hostname or "", address.port or 80), timeout=1.0)
                one.sendall(head + b"x" * 7_000_000)
                held.append(one)
                continue
            break
        with suppress(httpx.HTTPError):
            httpx.get(
                f"{target.page_url.rstrip('/')}/machines", headers={"Authorization": "Bearer wrong-wrong-wrong"}, timeout=2.0
            )
    for one in held:
        one.close()


def malformed(target: Target, stop: Event) -> None:
    """Bytes that are no payload, on each kind of topic; and packets of 200 kB."""

    def say(node: HostileNode, count: int) -> None:
        for verb in ("NBIRTH", "NDATA", "DBIRTH", "DDATA", "DDEATH"):
            device = "/hostile" if verb.startswith("D") else ""
            node.client.publish(
                f"spBv1.0/{GROUP}/{verb}/{NODE}{device}", struct.pack("<Q", count) * (25_000 if count % 10 == 0 else 9)
            )

    _each(target, stop, 0.05, say)


ATTACKS: dict[str, Attack] = {
    one.__name__: one
    for one in (
        long_device,
        long_metric,
        stamps,
        reserved,
        births,
        devices,
        flood,
        alarms,
        malformed,
        silent_clients,
        unfinished_logins,
    )
}
