"""The witness of a kill run: a process with one bare socket that notes what the machines say, and what becomes of notifications.

It knows nothing of bridges and Kafka, and is never killed. Of each data message of an edge node it keeps the machine, the time
stamp of the NBIRTH before it, its number and its own time stamp: what names it in the log (sparkplug/records/record.py).
"""

import json
import time
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing import Pipe, Process
from multiprocessing.connection import Connection, wait

from benchmarks.hall.load import hurry
from benchmarks.hall.machine import GROUP
from benchmarks.hall.packets import PINGREQ, READ_BYTES, Stream, connect, connected, subscribe
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.topics import ALERT_DELIVERY

ANSWER_S_MAX = 60.0


@dataclass(slots=True)
class Noted:
    """The messages of each machine in order, three numbers each: NBIRTH in ms, stamp in ms, number. `fates`: of notifications,
    what the courier has said of them."""

    messages: "dict[str, array[int]]" = field(default_factory=dict)
    fates: dict[str, str] = field(default_factory=dict)

    def of(self, machine: str) -> Iterator[tuple[int, int, int]]:
        """Yield NBIRTH, stamp and number of each message of a machine."""
        numbers = self.messages.get(machine, array("q"))
        yield from zip(numbers[0::3], numbers[1::3], numbers[2::3], strict=True)

    @property
    def count(self) -> int:
        """The number of messages."""
        return sum(len(one) for one in self.messages.values()) // 3


def stamp_of(payload: bytes) -> int:
    """Return the time stamp that a payload begins with.

    >>> stamp_of(bytes.fromhex("08e807"))
    1000
    """
    assert payload[0] == 0x08, "a payload of the load begins with its time stamp"
    value, shift, at = 0, 0, 1
    while True:
        value |= (payload[at] & 0x7F) << shift
        if payload[at] < 0x80:
            return value
        shift, at = shift + 7, at + 1


def number_of(payload: bytes) -> int:
    """Return the sequence number that a payload ends with.

    >>> number_of(bytes.fromhex("1805")), number_of(bytes.fromhex("18c801"))
    (5, 200)
    """
    if payload[-2] == 0x18:
        return payload[-1]
    assert payload[-3] == 0x18, "a payload of the load ends with its number"
    return payload[-2] & 0x7F | payload[-1] << 7


def _serve(port: int, machines: Sequence[str], pipe: Connection) -> None:
    """Note until somebody asks for all of it."""
    hurry()
    sock = connected(port, connect("witness", 60))
    nodes = [edge_node(machine) for machine in machines]
    filters = [f"spBv1.0/{GROUP}/{kind}" for node in nodes for kind in (f"NBIRTH/{node}", f"DDATA/{node}/+")]
    sock.sendall(subscribe([*filters, f"{ALERT_DELIVERY}+"]))
    pipe.send("listening")
    noted, births, stream, pinged_s = Noted(), dict[str, int](), Stream(), time.monotonic()
    while True:
        ready = wait([sock, pipe], 10.0)
        if sock in ready:
            data = sock.recv(READ_BYTES)
            if not data:
                raise SystemExit("the broker has closed the witness's connection")
            for topic, payload in stream.published(data):
                _note(noted, births, topic, payload)
        if time.monotonic() - pinged_s > 20.0:
            sock.sendall(PINGREQ)
            pinged_s = time.monotonic()
        if pipe in ready:
            pipe.recv()
            pipe.send(noted)
            return


def _note(noted: Noted, births: dict[str, int], topic: str, payload: bytes) -> None:
    if topic.startswith(ALERT_DELIVERY):
        if payload:
            noted.fates[topic.removeprefix(ALERT_DELIVERY)] = json.loads(payload)["outcome"]
        return
    _, _, kind, node, *device = topic.split("/")
    if kind == "NBIRTH":
        births[node] = stamp_of(payload)
        return
    messages = noted.messages.get(device[0])
    if messages is None:
        messages = noted.messages[device[0]] = array("q")
    messages.extend((births.get(node, -1), stamp_of(payload), number_of(payload)))


class Witness:
    """The process, from outside."""

    def __init__(self, port: int, machines: Sequence[str]) -> None:
        self._pipe, end = Pipe()
        self._process = Process(target=_serve, args=(port, machines, end), daemon=True)
        self._process.start()
        self._answer()

    def noted(self) -> Noted:
        """Return all that it has noted, and end it."""
        self._pipe.send("tell")
        noted: Noted = self._answer()
        self._process.join(10.0)
        return noted

    def _answer(self) -> Noted:
        if not self._pipe.poll(ANSWER_S_MAX):
            raise SystemExit(f"the witness does not answer within {ANSWER_S_MAX:g} s")
        answer: Noted = self._pipe.recv()
        return answer

    def stop(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
