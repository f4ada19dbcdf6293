"""A sample as a server keeps it, and how messages become such rows."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cnctwin.memory.store.contract import DERIVED, RAW, Message
from sparkplug.host_session import EventKind
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.vocabulary.twin_signals import TWIN_PREFIX

TEXT_BYTES_MAX = 32_000
"""The longest text or reason; InfluxDB takes 64 KiB."""
_TOLD = frozenset({EventKind.BIRTH, EventKind.DATA, EventKind.DEATH})
CODE = {Quality.GOOD: 0.0, Quality.STALE: 1.0, Quality.BAD: 2.0}
"""The field `quality`: the worst of a window is its greatest."""
QUALITY = (Quality.GOOD, Quality.STALE, Quality.BAD)

Plain = bool | float | str | None


class SeriesKey(NamedTuple):
    """The source of a sample; `unit` is not part of who it is, and may change."""

    machine: str
    node: str
    signal: str

    @property
    def measurement(self) -> str:
        """Raw or derived."""
        return DERIVED if self.signal.startswith(TWIN_PREFIX) else RAW


class SampleRow(NamedTuple):
    """One sample: a number is a float here, for that is what the servers keep."""

    key: SeriesKey
    unit: str | None
    t_us: int
    value: Plain
    quality: Quality
    reason: str | None


def plain(value: Value) -> Plain:
    """The value as a server can keep it; ValueError for what none of them can.

    >>> plain(3), plain(True), plain("M6")
    (3.0, True, 'M6')
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        if len(value.encode()) > TEXT_BYTES_MAX:
            raise ValueError(f"a text of more than {TEXT_BYTES_MAX} bytes")
        return value
    if isinstance(value, int | float):
        number = float(value) if isinstance(value, float) or abs(value) < 2**63 else math.inf
        if not math.isfinite(number):
            raise ValueError(f"{value} is no number that can be kept")
        return number
    raise ValueError(f"a {type(value).__name__}")


def told(message: Message) -> Iterator[tuple[SeriesKey, Reading]]:
    """The readings of a message that are samples: those of devices, in births, data and deaths."""
    event = message.event
    if event.device is None or event.kind not in _TOLD:
        return
    node = str(event.node)
    for reading in event.readings:
        yield SeriesKey(event.device, node, reading.name), reading
