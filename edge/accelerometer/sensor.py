"""An accelerometer beside the control: raw blocks in, vibration at the edge out, in a thread of its own.

    accelerometer = Accelerometer(config.accelerometer)
    accelerometer.start()
    for delivery in accelerometer.taken(): ...        # in the loop of the machine, whenever it comes by; never blocks
    accelerometer.close()

The thread reads, filters and puts what came of it into a queue of `WAITING_MAX`. Where the loop does not keep up, new blocks are
dropped unread, counted, and told as a hole. A sender that is faster than its own sample rate is read at `SPEED_MAX` times that
rate, and has to wait; so a sensor that hangs, floods or sends nonsense costs the control's own stream no more than that.
"""

import contextlib
import logging
import queue
import random
import threading
import time
from collections.abc import Callable

from edge.accelerometer import fold
from edge.accelerometer.fold import BLOCK_METRICS, Delivery
from edge.accelerometer.frame import Block
from edge.accelerometer.section import AccelerometerSection, Publish
from edge.accelerometer.source import SILENCE_S_MAX, Source
from edge.sample import Offer
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec

_log = logging.getLogger(__name__)
WAITING_MAX = 64
SPEED_MAX = 2.0
AHEAD_S_MAX = 2.0  # of data that come in a burst, as after a stall of the network
HEALTH = (
    MetricSpec("health/accelerometer_blocks", DataType.INT64, "blocks", value=0),
    MetricSpec("health/accelerometer_lost_blocks", DataType.INT64, "blocks", value=0),  # by their numbers
    MetricSpec("health/accelerometer_dropped_blocks", DataType.INT64, "blocks", value=0),  # the edge did not keep up
    MetricSpec("health/accelerometer_reconnects", DataType.INT64, value=0),
    MetricSpec("health/accelerometer_last_error", DataType.STRING, value=""),
)


class Accelerometer:
    """The sensor of one machine. Counters are written by its thread alone."""

    def __init__(
        self,
        section: AccelerometerSection,
        *,
        wall_s: Callable[[], float] = time.time,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
        chance: random.Random | None = None,
    ) -> None:
        self.received = self.lost = self.dropped = 0
        self._section = section
        self._source = Source(section, chance=chance)
        self._wall_s, self._clock, self._wait = wall_s, clock, wait
        self._waiting: queue.Queue[Delivery] = queue.Queue(WAITING_MAX)
        self._thread = threading.Thread(target=self._run, name="accelerometer", daemon=True)
        self._state = fold.State()
        self._skipped = 0  # of the dropped, those that the fold has not heard of

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; returns when it is over, or after two seconds."""
        self._source.close()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def taken(self) -> list[Delivery]:
        """All that waits; at once, and no more than the queue holds."""
        found = list[Delivery]()
        while len(found) < WAITING_MAX:
            try:
                found.append(self._waiting.get_nowait())
            except queue.Empty:
                break
        return found

    def offers(self) -> tuple[Offer, ...]:
        """The signals that it feeds, for the birth certificate."""
        if self._section.publish is Publish.BLOCKS:
            return ()
        return Offer(fold.RMS, self._section.url, "g"), Offer(fold.VELOCITY, self._section.url, "mm/s")

    def metrics(self) -> tuple[MetricSpec, ...]:
        """Return what it publishes that is no canonical signal, for the birth certificate."""
        return () if self._section.publish is Publish.VALUES else BLOCK_METRICS

    def health(self) -> dict[str, int | str]:
        """Values of `HEALTH`."""
        return {
            "health/accelerometer_blocks": self.received,
            "health/accelerometer_lost_blocks": self.lost,
            "health/accelerometer_dropped_blocks": self.dropped,
            "health/accelerometer_reconnects": self._source.reconnects,
            "health/accelerometer_last_error": self._source.last_error,
        }

    def _run(self) -> None:
        heard_s, ahead_s = self._clock(), 0.0
        try:
            for block in self._source.blocks(self._wait):
                now_s = self._clock()
                if block is not None:
                    ahead_s = max(ahead_s - SPEED_MAX * (now_s - heard_s), 0.0) + len(block.samples_g) / block.rate_hz
                    heard_s = now_s
                    self._take(block)
                    if ahead_s > AHEAD_S_MAX and not self._section.is_file:
                        self._source.pause((ahead_s - AHEAD_S_MAX) / SPEED_MAX)
                elif now_s - heard_s > SILENCE_S_MAX:
                    self._say_silent()
        except Exception as error:  # a bug of ours in here must not be one of the control's stream
            self._source.last_error = f"{self._section.url}: {type(error).__name__}: {error}"
            _log.exception("the accelerometer is given up")
            self._say_silent()

    def _take(self, block: Block) -> None:
        self.received += 1
        if self._waiting.full():
            self.dropped += 1
            self._skipped += 1
            return
        self._state, delivery = fold.step(self._section, self._state, block, self._wall_s() * 1e6)
        missing = sum(gap.lost for gap in delivery.frame.gaps)
        self.lost += max(missing - self._skipped, 0)
        self._skipped = 0
        self._put(delivery)

    def _say_silent(self) -> None:
        self._state, delivery = fold.silent(self._state, SILENCE_S_MAX, round(self._wall_s() * 1000))
        self._put(delivery)

    def _put(self, delivery: Delivery) -> None:
        if delivery.frame.samples or delivery.frame.gaps or delivery.changes or delivery.envelope:
            with contextlib.suppress(queue.Full):  # only at the end of a sensor that nobody listens to
                self._waiting.put_nowait(delivery)
