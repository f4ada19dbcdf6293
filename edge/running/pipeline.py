"""The way from what a frame gave to what is published: the tool change's state machine, then report by exception, then messages.

A message is one row of the machine: the changes of one moment, in the order in which they happened. A consumer that keeps the
last value of each signal thus sees each state that the machine was in. The state as found on (re)joining is one row, whatever the
age of its values.

What waits in the state machine for more evidence has left the control and is in no row yet. So its memory is stored with the
rows, and an edge that was killed in the middle of a tool change goes on in the middle of it, where the control's server still has
what came since; after a hole it begins again.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from edge import tool_change
from edge.config import EdgeConfig
from edge.running.report_by_exception import verdict
from edge.sample import Drop, EdgeSample, SampleSet
from twin.vocabulary.signals import DERIVED

_log = logging.getLogger(__name__)
_TAKEN_IN = ("tool_number", tool_change.CUE)  # signals that the state machine keeps, to hand on what it makes of them


@dataclass(frozen=True, slots=True)
class Outcome:
    """Rows to publish, and what was dropped on the way."""

    rows: tuple[tuple[EdgeSample, ...], ...]
    dropped: Counter[Drop] = field(default_factory=Counter)


class Memory(NamedTuple):
    """The state that outlives a restart: the tool change's state, and what was last published of it."""

    change: tool_change.State
    last: tuple[EdgeSample, ...]


_MEMORY: TypeAdapter[Memory] = TypeAdapter(Memory)
_REMEMBERED = ("tool_number", *DERIVED)
_FED = ("tool_number", "nc_block", "exec_state", tool_change.CUE)


class Pipeline:
    """The two folds of one machine, one after the other. `memory`: of the edge that was here before, as `memory` gave it."""

    def __init__(self, config: EdgeConfig[Any], memory: str | None = None) -> None:
        self._tool_change = config.tool_change
        self._sections = config.signals
        self._interval_ms_max = round(config.report.interval_s_max * 1000)
        self._change = tool_change.State()
        self._last: dict[str, EdgeSample] = {}  # published, of each signal
        self._heard: tuple[int, float] | None = None
        self._before = _remembered(memory)
        self._kept: Memory | None = None

    @property
    def held(self) -> int:
        """Observations that wait for more evidence."""
        return self._change.held + (0 if self._before is None else self._before.change.held)

    def memory(self) -> str | None:
        """Return what to store with the rows of the frame that was taken last; None where it is what `keep_memory` noted."""
        lasting = self._lasting()
        if self._before is not None or lasting == self._kept:
            return None
        return _MEMORY.dump_json(lasting._replace(change=replace(lasting.change, clock_ms=self._change.clock_ms))).decode()

    def keep_memory(self) -> None:
        """Note that the present memory is stored."""
        self._kept = self._lasting()

    def _lasting(self) -> Memory:
        """The memory without its clock, which goes on with each frame."""
        last = tuple(self._last[name] for name in _REMEMBERED if name in self._last)
        change = self._change
        # A block that commands nothing changes nothing, and a program shows ten of them a second.
        return Memory(change.changed(clock_ms=None, block=change.block if change.shows_change else None), last)

    @property
    def last(self) -> tuple[EdgeSample, ...]:
        """Return what was published last, of each signal."""
        return tuple(self._last.values())

    def take(self, frame: SampleSet, arrival_s: float) -> Outcome:
        """The samples of one frame that arrived at this (monotonic) time."""
        dropped: Counter[Drop] = Counter()
        for reason, number in frame.dropped.items():
            dropped[Drop(reason)] += number
        news: list[EdgeSample] = []
        continues = self._before is not None and any(sample.is_baseline for sample in frame.samples)
        if continues and self._before is not None:
            self._resume(self._before, frame, news, dropped)
            continues = not frame.gaps
        for sample in frame.samples:
            if continues and sample.is_baseline and sample.signal in _FED:  # the memory knows it, and better
                if sample.signal in _TAKEN_IN:
                    dropped[Drop.DUPLICATE] += sample.observations
                else:
                    self._report(sample, news, dropped)
                continue
            if tells_nothing(self._change, sample):
                self._report(sample, news, dropped)
                continue
            done = tool_change.step(self._tool_change, self._change, sample)
            self._change = done.state
            if done.debounced:
                dropped[Drop.DEBOUNCED] += done.debounced
            if sample.signal == tool_change.CUE:
                dropped[Drop.EVIDENCE] += sample.observations
            elif sample.signal not in _TAKEN_IN:
                self._report(sample, news, dropped)
            for candidate in done.samples:
                self._report(candidate, news, dropped)
        for sample in self._time_passes(frame, arrival_s, dropped):
            self._report(sample, news, dropped)
        return Outcome(tuple(rows_of(news)), +dropped)

    def declare(self, samples: Iterable[EdgeSample]) -> Outcome:
        """Samples that come from no observation."""
        dropped: Counter[Drop] = Counter()
        news: list[EdgeSample] = []
        for sample in samples:
            self._report(sample, news, dropped)
        return Outcome(tuple(rows_of(news)), +dropped)

    def _resume(self, before: Memory, frame: SampleSet, news: list[EdgeSample], dropped: Counter[Drop]) -> None:
        """The edge has rejoined: it goes on where it was, or after a hole begins again."""
        self._before = None
        if frame.gaps:
            dropped[Drop.DEBOUNCED] += before.change.held
            return
        self._change = before.change
        for sample in before.last:
            self._report(replace(sample, is_baseline=True, observations=0), news, dropped)

    def _time_passes(self, frame: SampleSet, arrival_s: float, dropped: Counter[Drop]) -> tuple[EdgeSample, ...]:
        """A frame without news says that nothing happened until now; only then may the clock go further than the samples."""
        clock_ms = self._change.clock_ms
        if frame.samples and clock_ms is not None:
            self._heard = clock_ms, arrival_s
        if self._heard is None or frame.samples or frame.backlog or frame.error is not None:
            return ()
        heard_ms, heard_s = self._heard
        done = tool_change.tick(self._tool_change, self._change, heard_ms + round((arrival_s - heard_s) * 1000))
        self._change = done.state
        dropped[Drop.DEBOUNCED] += done.debounced
        return done.samples

    def _report(self, sample: EdgeSample, news: list[EdgeSample], dropped: Counter[Drop]) -> None:
        """Add the sample to what is published, if it says something new."""
        name = sample.signal
        deadband = self._sections[name].deadband if name in self._sections else 0.0
        drop = verdict(self._last.get(name), sample, deadband=deadband, interval_ms_max=self._interval_ms_max)
        if drop is None:
            self._last[name] = sample
            news.append(sample)
        else:
            dropped[drop] += sample.observations


def _remembered(text: str | None) -> Memory | None:
    """Return what `Pipeline.memory` has written; None where that cannot be read, for instance by another version."""
    if text is None:
        return None
    try:
        return _MEMORY.validate_json(text)
    except ValidationError as error:
        _log.warning("the tool change's memory cannot be read and is left behind: %s", error.errors(include_url=False)[0]["msg"])
        return None


def tells_nothing(state: tool_change.State, sample: EdgeSample) -> bool:
    """Return True if the tool change would only hand this sample on: the time is known, nothing waits, it is no evidence."""
    is_known = sample.timestamp_ms == state.clock_ms and state.phase is tool_change.Phase.SETTLED
    return is_known and not sample.is_baseline and sample.signal not in _FED


def rows_of(samples: Iterable[EdgeSample]) -> Iterator[tuple[EdgeSample, ...]]:
    """Cut where the moment changes or a signal comes again."""
    row: dict[str, EdgeSample] = {}
    before: EdgeSample | None = None
    for sample in samples:
        if before is not None:
            same_moment = sample.timestamp_ms == before.timestamp_ms or (sample.is_baseline and before.is_baseline)
            if not same_moment or sample.signal in row:
                yield tuple(row.values())
                row = {}
        row[sample.signal] = before = sample
    if row:
        yield tuple(row.values())
