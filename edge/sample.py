"""The samples that an adapter hands on: changes of canonical signals, holes, and how each observation fared.

Observations are counted where they are read, so that at each publication received = emitted + dropped(reason) + buffered.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from edge.signals import signal
from sparkplug.metric import Change
from sparkplug.quality import Quality
from twin.vocabulary.signals import Kind, Signal

UNAVAILABLE = "unavailable"  # the reason of a null that the control does not report
EMPTY = "empty"  # the reason of a null that the control reports as an empty value


class Drop(StrEnum):
    """Why an observation was not published."""

    UNMAPPED = "unmapped"  # no canonical signal stands for it
    UNCHANGED = "unchanged"  # it repeats what is published already
    DEADBAND = "deadband"  # it moved by less than the deadband
    DUPLICATE = "duplicate"  # it was taken before, by its sequence number
    DEBOUNCED = "debounced"  # a flap of the tool number that is no change
    OTHER_DEVICE = "other_device"  # it belongs to another device of the same agent
    EVIDENCE = "evidence"  # it belongs to another signal (a tool change, a list of alarms), and is none of its own
    UNPARSABLE = "unparsable"  # it has no sequence number, no time, or is not what it should be
    CONTROL_LOST = "control_lost"  # the device is dead because the control reports nothing; this was one of its nulls
    STORE_AGE = "store_age"  # it waited for a broker longer than the store keeps it
    STORE_BYTES = "store_bytes"  # the store was full
    STORE_DISK = "store_disk"  # the disk ran full
    UNDECLARED = "undeclared"  # it waited in the store, and the machine does not have that signal any more
    BROKER_OFFLINE = "broker_offline"  # there was nobody to publish it to; the next birth carries the newest value


@dataclass(frozen=True, slots=True)
class EdgeSample:
    """One change of one signal; a null has a reason. `observations` is how many it accounts for (0 for a derived value).

    `is_baseline` marks the state as found when the edge (re)joins: true values, but not events that happened now.
    """

    signal: str
    value: str | int | float | bool | None
    timestamp_ms: int
    quality: Quality = Quality.GOOD
    reason: str | None = None
    sequence: int = 0
    observations: int = 1
    is_baseline: bool = False

    @property
    def change(self) -> Change:
        """The value as it is published."""
        return Change(self.signal, self.value, self.timestamp_ms, self.quality, self.reason)


@dataclass(frozen=True, slots=True)
class Gap:
    """A hole: observations that the control had and that nobody can get any more. `lost` is the most that it can have been."""

    reason: str
    first_sequence: int
    last_sequence: int
    lost: int


@dataclass(frozen=True, slots=True)
class Offer:
    """A signal that the control offers, for the birth certificate: where it comes from, and its declared limits.

    `unit` and `kind` are those of a chosen variable or PLC address, which the vocabulary leaves to the configuration.
    """

    signal: str
    source: str
    native_unit: str = ""
    low: float | None = None
    high: float | None = None
    unit: str = ""
    kind: Kind | None = None

    @property
    def declared(self) -> Signal:
        """Return the canonical signal with what this offer says of it."""
        known = signal(self.signal)
        low = known.low if self.low is None else self.low
        high = known.high if self.high is None else self.high
        return replace(known, unit=known.unit or self.unit, kind=self.kind or known.kind, low=low, high=high)


@dataclass(frozen=True, slots=True)
class ClockReading:
    """The control's clock beside the edge's (`edge_ms`, of the middle of the round trip); it was read to within `resolution_ms`.

    edge_ms: 0 = not known to the parser; it came one way within the round trip, and its arrival is taken
    stamps_samples: whether the stamps of the samples are this clock's; those of controls that give none are the edge's
    """

    control_ms: int
    edge_ms: int
    round_trip_ms: int = 0
    resolution_ms: int = 1
    stamps_samples: bool = True


@dataclass(frozen=True, slots=True)
class SampleSet:
    """The content of one frame. `offers` is None where it says nothing about which signals there are."""

    samples: tuple[EdgeSample, ...] = ()
    gaps: tuple[Gap, ...] = ()
    received: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    offers: tuple[Offer, ...] | None = None
    error: str | None = None  # why the frame was refused, or what the control answered instead
    instance: str | None = None  # which life of the control's server this is
    backlog: int = 0  # observations that the control has and that were not asked for yet
    newest_ms: int | None = None  # the latest time stamp in the frame
    available: bool | None = None  # whether the control is connected to its server; None = the frame does not say
    clock: ClockReading | None = None  # what the control's clock showed, where the frame tells

    def accounted(self) -> bool:
        """Return whether each observation of the frame is a sample or a counted drop."""
        return self.received == observations_of(self.samples) + sum(self.dropped.values())


def observations_of(samples: Iterable[EdgeSample]) -> int:
    """Return how many observations these samples account for."""
    return sum(sample.observations for sample in samples)
