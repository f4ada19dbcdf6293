"""The sensor beside a control, as the loop uses it: an accelerometer, or none.

A sensor's stamps are the edge's own, so what the spindle does shows by both clocks: `peak` compares them (`edge.clock.signals`).
"""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Protocol

from edge.accelerometer.fold import Delivery
from edge.accelerometer.section import AccelerometerSection
from edge.accelerometer.sensor import Accelerometer
from edge.clock import signals as clock_signals
from edge.clock.bounds import Bound
from edge.sample import EdgeSample, Offer
from sparkplug.metric import MetricSpec

SPEED_POLL_S = 0.35  # how far apart speeds of the spindle are at least
ENVELOPE_MAX = 3000  # ten a second


class Sensor(Protocol):
    """A sensor as the loop uses it."""

    def start(self) -> None: ...
    def close(self) -> None: ...
    def taken(self) -> Sequence[Delivery]: ...
    def offers(self) -> tuple[Offer, ...]: ...
    def metrics(self) -> tuple[MetricSpec, ...]: ...
    def health(self) -> Mapping[str, int | str]: ...
    def peak(self, samples: Sequence[EdgeSample], at_s: float, around_s: float) -> Bound | None: ...


class NoSensor:
    """The sensor of an edge that has none: it says nothing."""

    def start(self) -> None:
        """Nothing to start."""

    def close(self) -> None:
        """Nothing to close."""

    def taken(self) -> Sequence[Delivery]:
        """Nothing came."""
        return ()

    def offers(self) -> tuple[Offer, ...]:
        """No signals."""
        return ()

    def metrics(self) -> tuple[MetricSpec, ...]:
        """No metrics."""
        return ()

    def health(self) -> Mapping[str, int | str]:
        """No health."""
        return {}

    def peak(self, samples: Sequence[EdgeSample], at_s: float, around_s: float) -> Bound | None:
        """Nothing to compare."""
        return None


class SpindleSensor(Accelerometer):
    """The accelerometer of one machine, and what its envelope shows of the control's clock."""

    def __init__(self, section: AccelerometerSection) -> None:
        super().__init__(section)
        self._envelope: deque[tuple[float, float]] = deque(maxlen=ENVELOPE_MAX)
        self._compared = clock_signals.State()

    def taken(self) -> list[Delivery]:
        """All that waits; its envelope is kept for the next comparison."""
        deliveries = super().taken()
        for delivery in deliveries:
            self._envelope.extend(delivery.envelope)
        return deliveries

    def peak(self, samples: Sequence[EdgeSample], at_s: float, around_s: float) -> Bound | None:
        """Compare the control's spindle with the envelope, near an offset that is roughly known."""
        news = clock_signals.News(clock_signals.speed_of(samples), tuple(self._envelope))
        self._envelope.clear()
        self._compared, peak = clock_signals.step(self._compared, news, at_s=at_s, around_s=around_s, poll_s=SPEED_POLL_S)
        return peak


def sensor_of(section: AccelerometerSection) -> Sensor:
    """Return the configured sensor; one that says nothing where there is no url."""
    return SpindleSensor(section) if section.url else NoSensor()
