"""Memory: everything that is said on the broker goes into the store as it comes, and what matters is pinned there.

The runtime hands each message to the recorder, whole; this fold decides only which raw windows are pinned: where a flag rises (an
anomaly, a rule, a growing gap), from `pin_before_s` before to `pin_after_s` after it, so that whoever looks into it a year later
finds the machine's own values and not a roll-up. A growing gap names the window that should be diagnosed; that one is pinned too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

from pydantic import Field

from processors.alarms import machine_alarms
from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Pin, Processor, Provenance, Sample, SampleKind
from sparkplug.datatype import DataType
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

PINS, REASON, WINDOW = "twin/history_pins", "twin/history_pin_reason", twin_signals.GAP_WINDOW
DAY_MS = 86_400_000
LONGER_MS_MIN = 60_000
_DATA, _BIRTH = SampleKind.DATA, SampleKind.BIRTH


class HistorianConfig(ProcessorConfig):
    """The store, how long it keeps what (docs/reference/store.md), and what is pinned."""

    store: str = ""
    pin_before_s: float = Field(default=600.0, ge=0.0, le=86_400.0)
    pin_after_s: float = Field(default=600.0, ge=0.0, le=86_400.0)
    pin_s_max: float = Field(default=21_600.0, gt=0.0, le=604_800.0)
    pins_a_day_max: int = Field(default=50, ge=1, le=10_000)
    flags: tuple[str, ...] = Field(default_factory=machine_alarms)
    raw_days: float = Field(default=365.0, gt=0.0, le=36_500.0)
    block_days: float = Field(default=7.0, gt=0.0, le=36_500.0)
    disk_gb: float = Field(default=0.0, ge=0.0, le=1e6)
    hole_s: float = Field(default=60.0, gt=0.0, le=86_400.0)

    @cached_property
    def watched(self) -> frozenset[str]:
        """The signals that may ask for a pin."""
        return frozenset({*self.flags, WINDOW})


@dataclass(frozen=True, slots=True)
class Risen:
    """A flag that stands, and since when."""

    flag: str
    since_ms: int


@dataclass(frozen=True, slots=True)
class Stretch:
    """The stretch that was pinned last, with all that overlapped it."""

    from_ms: int
    to_ms: int
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class HistorianState:
    """The flags that stand; how many stretches were pinned, in all and on the day that is counted; the last of them."""

    risen: tuple[Risen, ...] = ()
    pins: int = 0
    day: int = 0
    pins_of_day: int = 0
    window: str = ""
    last: Stretch | None = None


def step(config: HistorianConfig, state: HistorianState, sample: Sample) -> tuple[HistorianState, Sequence[Output | Pin]]:
    """Pin what the flags that changed ask for."""
    if config.watched.isdisjoint(sample.changed) or sample.is_history or sample.kind not in (_DATA, _BIRTH):
        return state, ()
    pins: list[Pin] = []
    for name in sample.changed:
        if name in config.flags:
            state = _see(config, state, sample.machine, sample.row[name], pins)
        elif name == WINDOW:
            state = _see_window(state, sample.machine, sample.row[name], pins)
    if not pins:
        return state, ()
    return _counted(config, state, pins)


def _see(config: HistorianConfig, state: HistorianState, machine: str, reading: Reading, pins: list[Pin]) -> HistorianState:
    """A flag was told: where it rises or falls, the stretch about it. What is null or stale neither rises nor falls."""
    if reading.quality is not Quality.GOOD or not isinstance(reading.value, bool):
        return state
    flag, at_ms = reading.name, reading.timestamp_ms
    since_ms = next((risen.since_ms for risen in state.risen if risen.flag == flag), None)
    if reading.value == (since_ms is not None):
        return state
    before_ms, after_ms = round(config.pin_before_s * 1000), round(config.pin_after_s * 1000)
    if since_ms is None:
        pins.append(Pin(machine, at_ms - before_ms, at_ms + max(after_ms, 1), flag.removeprefix(twin_signals.TWIN_PREFIX)))
        return replace(state, risen=(*state.risen, Risen(flag, at_ms)))
    to_ms = min(at_ms + after_ms, since_ms + round(config.pin_s_max * 1000))
    if to_ms > since_ms + after_ms:  # what the rise has not pinned already
        pins.append(Pin(machine, since_ms - before_ms, to_ms, flag.removeprefix(twin_signals.TWIN_PREFIX)))
    return replace(state, risen=tuple(risen for risen in state.risen if risen.flag != flag))


def _see_window(state: HistorianState, machine: str, reading: Reading, pins: list[Pin]) -> HistorianState:
    """The stretch that the gap processor wants diagnosed, as `begin/end` in ISO 8601; each is pinned once."""
    text = reading.value
    if reading.quality is not Quality.GOOD or not isinstance(text, str) or text == state.window:
        return state
    begin, _, end = text.partition("/")
    try:
        from_ms, to_ms = (round(datetime.fromisoformat(moment).timestamp() * 1000) for moment in (begin, end))
    except ValueError:
        return state
    if from_ms < to_ms:
        pins.append(Pin(machine, from_ms, to_ms, "gap window to diagnose"))
    return replace(state, window=text)


def _counted(
    config: HistorianConfig, state: HistorianState, pins: Sequence[Pin]
) -> tuple[HistorianState, Sequence[Output | Pin]]:
    """Pin what is not pinned yet: what goes on with the last stretch always, others no more often than a day may have."""
    taken: list[Pin] = []
    is_refused = False
    for pin in pins:
        last = state.last
        if last is not None and last.from_ms <= pin.to_ms and pin.from_ms <= last.to_ms:
            state, longer = _gone_on(config, state, last, pin)
            taken += longer
            continue
        day = pin.to_ms // DAY_MS
        used = state.pins_of_day if day == state.day else 0
        state = replace(state, day=day, pins_of_day=used + 1)
        if used >= config.pins_a_day_max:
            is_refused = True
            continue
        state = replace(state, pins=state.pins + 1, last=Stretch(pin.from_ms, pin.to_ms, (pin.reason,)))
        taken.append(pin)
    if taken:
        return state, [*taken, Output(PINS, state.pins), Output(REASON, taken[-1].reason)]
    if is_refused:
        too_many = f"more than {config.pins_a_day_max} stretches a day are asked for: the rest is not pinned"
        return state, [Output(REASON, too_many, Quality.BAD)]
    return state, ()


def _gone_on(config: HistorianConfig, state: HistorianState, last: Stretch, pin: Pin) -> tuple[HistorianState, Sequence[Pin]]:
    """Return the last stretch with a pin that overlaps it, and the pin where it adds something.

    A stretch that grows does so by `LONGER_MS_MIN` at least, so that a flag that flaps sets few pins however often it does.
    """
    is_within = last.from_ms <= pin.from_ms and pin.to_ms <= last.to_ms
    if is_within and pin.reason in last.reasons:
        return state, ()
    if pin.to_ms > last.to_ms:
        pin = pin._replace(to_ms=max(pin.to_ms, last.to_ms + min(LONGER_MS_MIN, round(config.pin_after_s * 1000))))
    reasons = last.reasons if pin.reason in last.reasons else (*last.reasons, pin.reason)
    longer = Stretch(min(last.from_ms, pin.from_ms), max(last.to_ms, pin.to_ms), reasons)
    return replace(state, last=longer), (pin,)


PROCESSOR = Processor(
    name="historian",
    version=2,
    inputs=None,
    outputs=(
        OutputSpec(PINS, DataType.INT64, "stretches", "stretches of raw data that no sweep may take", Provenance.INFERRED),
        OutputSpec(REASON, DataType.STRING, None, "why the last stretch was pinned", Provenance.INFERRED),
    ),
    config=HistorianConfig,
    state=HistorianState,
    initial=lambda _: HistorianState(),
    step=step,
    records=True,
)
