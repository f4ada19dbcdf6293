"""A device or a node as one node tells of it: its metrics, each with its last reading and its trace."""

from dataclasses import dataclass, field

from cnctwin.api.fleet import is_key_signal
from cnctwin.api.live.trace import Trace
from sparkplug.metric import Reading


class Signal:
    """One metric of one owner: its last reading, its trace, and what the birth says of it."""

    __slots__ = ("is_key", "live_ms", "meaning", "provenance", "reading", "trace", "whole_ms")

    def __init__(self, reading: Reading, provenance: str, meaning: str | None) -> None:
        self.reading = reading
        self.provenance = provenance
        self.meaning = meaning
        self.trace = Trace()
        self.is_key = is_key_signal(reading.name)
        self.live_ms = reading.timestamp_ms  # of the last value that was told, and not only marked stale
        self.whole_ms = reading.timestamp_ms  # nothing is missing in the trace since then


@dataclass(slots=True)
class Owner:
    """The metrics of a device, or of a node itself, as one node tells them."""

    online: bool = False
    is_control: bool = False  # it tells measured values, not only the twin's
    signals: dict[str, Signal] = field(default_factory=dict)
