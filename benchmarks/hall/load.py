"""The load: a process that is many machines, each with a TCP connection, a session and a will of its own.

The machines of a process take turns in slots of 5 ms; a message is two concatenations and one `send`. A message's stamps are the
moment at which it is made. How late each slot was is kept: figures of a run whose load was late are figures of the load.
"""

import contextlib
import os
import selectors
import socket
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.hall.machine import KEEP_ALIVE_S, POOL, Bodies, Machine, flags
from benchmarks.hall.packets import PINGREQ, READ_BYTES, Stream, connected
from sparkplug.layouts.varint import written

SLOT_S = 0.005
ROUND_S = 120.0
"""Each machine repeats a round: a tool change at the beginning, a stop in the middle."""
CHANGE_S, STOP_S, OUTAGE_S = 5.0, 6.0, 3.0
ABRUPT = struct.pack("ii", 1, 0)  # SO_LINGER: the connection is reset, and the broker says the will


@dataclass(slots=True)
class Order:
    """The task of one process of the load. `steady`: machines, by number, that have no outage."""

    port: int
    machines: Sequence[int]
    hz: float
    outage_every_s: float = 0.0
    steady: frozenset[int] = frozenset()
    is_idle: bool = False


@dataclass(slots=True)
class Tally:
    """The messages sent while a window was open. `whole`: data messages in which all 11 values change, by machine."""

    sent: int = 0
    outages: int = 0
    rebirths: int = 0
    late_ms: list[float] = field(default_factory=list)
    whole: dict[str, int] = field(default_factory=dict)


class Connected:
    """One machine on its connection."""

    __slots__ = ("at", "machine", "mode", "number", "offline_until_s", "sock", "stream", "tick")

    def __init__(self, number: int, machine: Machine, tick: int) -> None:
        self.number, self.machine, self.tick, self.at = number, machine, tick, (number * 37) % POOL
        self.mode = "cut"
        self.sock: socket.socket | None = None
        self.stream = Stream()
        self.offline_until_s = 0.0


class Load:
    """See the module."""

    def __init__(self, order: Order) -> None:
        self.order, self.bodies, self.tally = order, Bodies.made(), Tally()
        self.window_ms = (0, 0)
        self.begun_s = 0.0
        self._round = max(8, round(ROUND_S * order.hz))
        self._second = max(1, round(order.hz))
        now_ms = time.time_ns() // 1_000_000
        self.machines = [Connected(number, Machine(number, now_ms), self._first_tick(number)) for number in order.machines]
        self._slots: list[list[Connected]] = [[] for _ in range(max(1, round(1.0 / order.hz / SLOT_S)))]
        for index, one in enumerate(self.machines):
            self._slots[index % len(self._slots)].append(one)
        self._slot_s = 1.0 / order.hz / len(self._slots)
        self._selector = selectors.DefaultSelector()
        self._events: dict[int, tuple[str, dict[str, Any]]] = {
            0: ("change", {"tool_change_active": True}),
            round(CHANGE_S * order.hz): ("cut", {"tool_change_active": False}),
            self._round // 2: ("stand", {"exec_state": "STOPPED"}),
            self._round // 2 + round(STOP_S * order.hz): ("cut", {"exec_state": "ACTIVE"}),
        }
        self._outage_s, self._victim = time.monotonic() + order.outage_every_s, 0
        self._pinged_s = time.monotonic()

    def _first_tick(self, number: int) -> int:
        """Spread the tool changes and the stops of the machines evenly; none begins in the middle of one."""
        return (number * 7919) % self._round if self.order.hz else 0

    def connect(self) -> None:
        """Open all connections; nothing is born yet."""
        for one in self.machines:
            self._open(one)

    def _open(self, one: Connected) -> None:
        one.sock = connected(self.order.port, one.machine.hello(time.time_ns() // 1_000_000))
        one.stream = Stream()
        self._selector.register(one.sock, selectors.EVENT_READ, one)

    def bear(self) -> None:
        """Send the births of all machines."""
        self.begun_s = time.time()
        for one in self.machines:
            self._send(one, one.machine.births(time.time_ns() // 1_000_000))

    def _send(self, one: Connected, data: bytes) -> None:
        if data and one.sock is not None:
            one.sock.sendall(data)

    def run(self, pipe: Connection) -> None:
        """Send until the pipe says that it is enough."""
        slots, slot_s, idle = self._slots, self._slot_s, self.order.is_idle
        due_s, number = time.monotonic() + slot_s, 0
        while True:
            pause_s = due_s - time.monotonic()
            if pause_s > 0:
                time.sleep(pause_s)
            now_ns = time.time_ns()
            now_ms = now_ns // 1_000_000
            is_open = self.window_ms[0] <= now_ms < self.window_ms[1]
            if is_open:
                self.tally.late_ms.append((time.monotonic() - due_s) * 1000.0)
            if not idle:
                stamp = written(now_ms)
                for one in slots[number % len(slots)]:
                    if one.sock is not None:
                        self._turn(one, stamp, now_ms, is_open)
            number += 1
            due_s += slot_s
            if number % 4 == 0:
                self._listen(now_ms)
                self._outages(now_ms)
            if number % 20 == 0 and pipe.poll():
                asked = pipe.recv()
                if asked is None:
                    return
                self._asked(asked, pipe)

    def _asked(self, asked: Any, pipe: Connection) -> None:
        """Answer the parent: a window opens, or its figures are wanted."""
        what, argument = asked
        if what == "window":
            self.window_ms, self.tally = argument, Tally()
        else:
            pipe.send((self.tally, self.begun_s))

    def _turn(self, one: Connected, stamp: bytes, now_ms: int, is_open: bool) -> None:
        machine = one.machine
        phase = one.tick % self._round
        one.tick += 1
        one.at = (one.at + 1) % POOL
        event = self._events.get(phase)
        extra = b"" if event is None else self._change(one, event, now_ms)
        mode = one.mode
        if mode == "stand" and not extra and phase % self._second:
            return
        made = (
            self.bodies.cut[one.at]
            if mode == "cut"
            else self.bodies.change[one.at]
            if mode == "change"
            else self.bodies.stand[one.at]
        )
        one.sock.sendall(machine.data(made + extra, stamp))  # type: ignore[union-attr]
        if is_open:
            self.tally.sent += 1
            if mode != "stand":
                self.tally.whole[machine.name] = self.tally.whole.get(machine.name, 0) + 1

    def _change(self, one: Connected, event: tuple[str, dict[str, Any]], now_ms: int) -> bytes:
        """Return the flags that change now: those of a tool change or of a stop."""
        one.mode, values = event
        if values.get("tool_change_active") is False:
            one.machine.tool = one.machine.tool % 40 + 1
            values = values | {"tool_number": one.machine.tool}
        one.machine.note(now_ms, **values)
        return flags(**values)

    def _listen(self, now_ms: int) -> None:
        """Answer commands, and stay alive."""
        for key, _ in self._selector.select(0):
            one: Connected = key.data
            assert one.sock is not None
            data = one.sock.recv(READ_BYTES)
            if not data:
                raise SystemExit(f"the broker has closed the connection of {one.machine.name}")
            for topic, payload in one.stream.published(data):
                births = one.machine.answer(topic, payload, now_ms)
                self.tally.rebirths += bool(births)
                self._send(one, births)
        now_s = time.monotonic()
        if now_s - self._pinged_s > KEEP_ALIVE_S / 3:
            self._pinged_s = now_s
            for one in self.machines:
                self._send(one, PINGREQ)
        if int(now_s * 10) % 10 == 0:
            for one in self.machines:
                if births := one.machine.tick(now_ms):
                    self.tally.rebirths += 1
                    self._send(one, births)

    def _outages(self, now_ms: int) -> None:
        """Tear a connection, and connect again those that were torn some seconds ago."""
        now_s = time.monotonic()
        if not self.order.outage_every_s or now_s < self._outage_s - OUTAGE_S:
            return
        for one in self.machines:
            if one.sock is None and now_s >= one.offline_until_s:
                self._open(one)
                self._send(one, one.machine.births(now_ms))
        if now_s < self._outage_s:
            return
        self._outage_s = now_s + self.order.outage_every_s
        self._victim += 1
        torn = self.machines[self._victim * 31 % len(self.machines)]
        if torn.sock is None or torn.number in self.order.steady:
            return
        self._selector.unregister(torn.sock)
        torn.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABRUPT)
        torn.sock.close()
        torn.sock, torn.offline_until_s = None, now_s + OUTAGE_S
        self.tally.outages += 1


def hurry() -> None:
    """Take precedence over what is measured, where that is allowed: who measures must not be late."""
    with contextlib.suppress(OSError):
        os.setsid()  # Linux gives each session its share of the processors, and niceness counts within one
    prefer(os.getpid())


def prefer(pid: int) -> None:
    """Give a process and its session precedence over others of this computer, where that is allowed."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, -10)
    with contextlib.suppress(OSError):
        Path(f"/proc/{pid}/autogroup").write_text("-10")


def serve(order: Order, pipe: Connection) -> None:
    """Be these machines: connect, wait for the word, then send until told to stop."""
    hurry()
    load = Load(order)
    load.connect()
    pipe.send("connected")
    if pipe.recv() is None:
        return
    load.bear()
    load.run(pipe)
