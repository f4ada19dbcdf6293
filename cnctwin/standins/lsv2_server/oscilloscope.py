"""The oscilloscope of the simulated iTNC 530: servo signals of three axes, as R_OC, R_OP and R_OD tell them. No I/O.

A packet may leave when its last value has been taken; after a client that is too slow for what the control keeps comes an
overrun. The layout of the telegrams is that which pyLSV2 reads; the signals come from `servo_axes.py`.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

PERIOD_US = 600
INTERVALS_US = (600, 3000, 21_000)
VALUES = 32
LABELS = ("X", "Y", "Z")
SIGNALS_MAX = 16
BUFFER_S = 20.0
"""Seconds of packets that the control keeps for a slow client."""


class Channel(NamedTuple):
    """A channel: its name, unit and factor, and the end of the twin's column that feeds it."""

    name: str
    unit: str
    factor: float
    column: str


CHANNELS = (
    Channel("s actual", "mm", 1e-4, "pos_mm"),
    Channel("s nominal", "mm", 1e-4, "ref_mm"),
    Channel("s diff.", "mm", 1e-4, "diff_mm"),
    Channel("I nominal", "A", 1e-4, "torque_a"),
)


@dataclass(frozen=True)
class ServoTrace:
    """Signals of the axes over some passes of a program, a value each 0.6 ms. raw: (axis, channel) → multiples of its factor."""

    raw: Mapping[tuple[int, int], Sequence[int]]

    @property
    def length(self) -> int:
        """Return the number of ticks until it begins again."""
        return len(next(iter(self.raw.values())))


def signal_descriptions() -> list[bytes]:
    """Return the payloads of S_OC, one for each channel."""
    labels = b"\x00".join(label.encode() for label in (*LABELS, *["-"] * (16 - len(LABELS))))
    described = []
    for number, channel in enumerate(CHANNELS):
        head = struct.pack("!4HH", number, PERIOD_US, 1, 0, PERIOD_US) + b"\x00" * 36
        described.append((head + channel.name.encode("latin-1")).ljust(59, b"\x00") + labels)
    return described


class Selection(NamedTuple):
    """The selection of a client. signals: (axis, channel)."""

    interval_us: int
    signals: tuple[tuple[int, int], ...]


def selection(payload: bytes) -> Selection | None:
    """Read R_OP; None where it asks for what there is not."""
    (interval_us,) = struct.unpack_from("!L", payload)
    chosen = []
    for at in range(4, len(payload), 8):
        number, axis, _ = struct.unpack_from("!HHL", payload, at)
        if number >= len(CHANNELS) or axis >= len(LABELS):
            return None
        chosen.append((axis, number))
    return Selection(interval_us, tuple(chosen)) if chosen and interval_us in INTERVALS_US else None


def details(chosen: Selection) -> bytes:
    """Return the payload of S_OP: unit, factor and offset of each signal."""
    told = b""
    for _, number in chosen.signals:
        channel = CHANNELS[number]
        told += channel.unit.encode("latin-1").ljust(10, b"\x00") + struct.pack("<d", channel.factor) + struct.pack("!l", 0)
    return told


@dataclass
class Sweep:
    """A recording that goes on for one client. began_s: of the machine's time; packet: the one that comes next."""

    chosen: Selection
    began_s: float
    packet: int = 0

    def due_s(self) -> float:
        """Return the machine's time at which the next packet is whole."""
        return self.began_s + (self.packet + 1) * self.packet_s

    @property
    def packet_s(self) -> float:
        """Return the seconds that a packet covers."""
        return VALUES * self.chosen.interval_us / 1e6

    def is_overrun(self, now_s: float) -> bool:
        """Return True where the client came so late that packets are gone."""
        return now_s > self.due_s() + BUFFER_S

    def take(self, trace: ServoTrace) -> bytes:
        """Return the payload of S_OD for the next packet."""
        step = self.chosen.interval_us // PERIOD_US
        first = math.floor(self.began_s * 1e6 / PERIOD_US) + self.packet * VALUES * step
        ticks = [(first + step * number) % trace.length for number in range(VALUES)]
        told = struct.pack("!L", self.packet)
        for axis, number in self.chosen.signals:
            raw = trace.raw[axis, number]
            told += b"\x00\x20\xff\xff\xff\xff" + struct.pack(f"!{VALUES}l", *(raw[tick] for tick in ticks))
        self.packet += 1
        return told
