"""The figures of blocks of acceleration: rms of each second in the band, and the blocks as they are published. A pure fold.

Blocks are one stream while each has the number after the last one's and the same rate. A block that is lost, clipped, dead, or
holds what no sensor measures breaks the stream: the values are null with the reason, the filters start again, and the first half
second after that is not counted. A block that carries no time is stamped when it comes; the stamps of such blocks follow their
rate and are drawn to the arrivals slowly, so that the network's jitter is not in them.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from edge.accelerometer.filter import Carried, Sums, band, filtered, started
from edge.accelerometer.frame import Block
from edge.accelerometer.section import RATE_HZ_MIN, AccelerometerSection, Publish
from edge.sample import EdgeSample, Gap, SampleSet
from sparkplug.datatype import DataType
from sparkplug.metric import Change, MetricSpec
from sparkplug.quality import Quality
from twin.vocabulary.signals import VIBRATION_BLOCK_G, VIBRATION_SAMPLE_RATE_HZ

RMS, VELOCITY = "vibration_rms_g", "vibration_velocity_mm_s"
BLOCK, RATE = VIBRATION_BLOCK_G, VIBRATION_SAMPLE_RATE_HZ
BLOCK_METRICS = (
    MetricSpec(BLOCK, DataType.FLOAT_ARRAY, "g", is_transient=True),
    MetricSpec(RATE, DataType.DOUBLE, "Hz"),
)
CHUNK_S = 0.1
WINDOW_CHUNKS = 10
SETTLE_CHUNKS = 5
AT_FULL_SCALE = 0.999
G_MAX = 100_000.0
STEERED = 0.02  # of the difference between arrival and what the rate says, each block
STEERED_US_MAX = 1_000_000.0  # a larger one starts again
NO_BLOCK = "no block from the accelerometer yet"


class Delivery(NamedTuple):
    """The result of a block: values and holes, blocks to publish as they are, and the envelope for `edge.clock.signals`.

    envelope: middle of each tenth of a second, in seconds since 1970 by the EDGE's clock, and its rms in g
    """

    frame: SampleSet = SampleSet()
    changes: tuple[Change, ...] = ()
    envelope: tuple[tuple[float, float], ...] = ()


class State(NamedTuple):
    """The stream as far as it has come.

    number, rate_hz: of the last block; edge_us: when its last sample was, by the edge's clock
    carried: the filters' state; without it the next block begins a stream
    settling: chunks that are still to be left out; chunk, window: sums of those that are not full
    pending: samples that wait for a block to publish to be full
    why_not: what stands in place of values, "" while there are some
    """

    number: int | None = None
    rate_hz: float = 0.0
    edge_us: float = 0.0
    carried: Carried = Carried(())
    settling: int = 0
    chunk: Sums = Sums()
    window: Sums = Sums()
    pending: tuple[float, ...] = ()
    why_not: str = NO_BLOCK


def silent(state: State, for_s: float, now_ms: int) -> tuple[State, Delivery]:
    """No block came for so long."""
    return _broken(state, f"no block from the accelerometer for {for_s:g} s", now_ms)


def step(section: AccelerometerSection, state: State, block: Block, arrival_us: float) -> tuple[State, Delivery]:
    """Take a block in."""
    before, gaps, delivered = state.number, tuple[Gap, ...](), Delivery()
    if before is not None and block.number != before + 1:
        missing = max(block.number - before - 1, 0)
        reason = "blocks of the accelerometer are lost" if missing else "the accelerometer's sender started again"
        gaps = (Gap(reason, before + 1, max(block.number - 1, before), missing),)
    edge_us = _edge_us(state, block, arrival_us)
    stamp_us = edge_us if block.last_us is None else float(block.last_us)
    stamp_ms, wrong = round(stamp_us / 1000.0), _wrong(section, block)
    if not wrong and state.carried.w and block.rate_hz != state.rate_hz:
        broken = "the accelerometer's sample rate has changed"
    else:
        broken = wrong or (gaps[0].reason if gaps else "")
    if broken:
        state, delivered = _broken(state, broken, stamp_ms)
    if not wrong:
        state, more = _streamed(section, state, block, (stamp_us, edge_us))
        delivered = more._replace(frame=SampleSet((*delivered.frame.samples, *more.frame.samples)))
    state = state._replace(number=block.number, rate_hz=block.rate_hz, edge_us=edge_us)
    return state, delivered._replace(frame=replace(delivered.frame, gaps=gaps, newest_ms=stamp_ms))


def _edge_us(state: State, block: Block, arrival_us: float) -> float:
    """Return the time of the block's last sample by the edge's clock."""
    due_us = state.edge_us + 1e6 * len(block.samples_g) / block.rate_hz
    if state.number is None or block.number != state.number + 1 or abs(arrival_us - due_us) > STEERED_US_MAX:
        return arrival_us
    return due_us + STEERED * (arrival_us - due_us)


def _wrong(section: AccelerometerSection, block: Block) -> str:
    """Why a block cannot be used; "" where it can."""
    if block.rate_hz < RATE_HZ_MIN:
        return f"the accelerometer samples at {block.rate_hz:g} Hz, and {RATE_HZ_MIN:g} is the least"
    least, greatest = min(block.samples_g), max(block.samples_g)
    total = math.fsum((least, greatest, sum(block.samples_g)))  # NaN, where one is: min and max may miss it
    if not (least > -G_MAX and greatest < G_MAX and math.isfinite(total)):
        return "a block of the accelerometer holds what no sensor measures"
    if max(-least, greatest) >= AT_FULL_SCALE * section.scale_g:
        return f"the accelerometer reaches its full scale of {section.scale_g:g} g"
    if least == greatest and len(block.samples_g) > 1:
        return "all samples of the accelerometer are the same: is a sensor connected?"
    return ""


def _broken(state: State, reason: str, now_ms: int) -> tuple[State, Delivery]:
    """No stream; the values are null and say why, once."""
    after = State(state.number, state.rate_hz, state.edge_us, why_not=reason)
    if state.why_not == reason:
        return after, Delivery()
    null = EdgeSample(RMS, None, now_ms, Quality.BAD, reason, observations=0)
    return after, Delivery(SampleSet((null, replace(null, signal=VELOCITY))))


def _streamed(section: AccelerometerSection, state: State, block: Block, last_us: tuple[float, float]) -> tuple[State, Delivery]:
    """The stream with one block more, whose last sample was at `last_us` by the clock that stamps it and by the edge's."""
    stamp_us, edge_us = last_us
    filters = band(block.rate_hz)
    if not state.carried.w:
        state = state._replace(carried=started(filters, block.samples_g[0]), settling=SETTLE_CHUNKS)
    size, at, count = round(CHUNK_S * block.rate_hz), 0, len(block.samples_g)
    samples, envelope = list[EdgeSample](), list[tuple[float, float]]()
    while at < count:
        end = min(count, at + size - state.chunk.samples)
        carried, sums = filtered(filters, state.carried, block.samples_g[at:end])
        chunk, at = state.chunk.plus(sums), end
        if chunk.samples < size:
            state = state._replace(carried=carried, chunk=chunk)
            continue
        after_us = 1e6 * (count - end) / block.rate_hz
        state = state._replace(carried=carried, chunk=Sums())
        if state.settling:
            state = state._replace(settling=state.settling - 1)
            continue
        envelope.append(((edge_us - after_us) / 1e6 - CHUNK_S / 2.0, chunk.rms_g))
        window = state.window.plus(chunk)
        if window.samples < WINDOW_CHUNKS * size:
            state = state._replace(window=window)
            continue
        samples += _values(window, round((stamp_us - after_us) / 1000.0)) if section.publish is not Publish.BLOCKS else []
        state = state._replace(window=Sums(), why_not="")
    changes = list[Change]()
    if section.publish is not Publish.VALUES:
        state, changes = _blocks(section, state, block, stamp_us)
    return state, Delivery(SampleSet(tuple(samples)), tuple(changes), tuple(envelope))


def _values(window: Sums, stamp_ms: int) -> Iterator[EdgeSample]:
    yield EdgeSample(RMS, round(window.rms_g, 5), stamp_ms, observations=0)
    yield EdgeSample(VELOCITY, round(window.velocity_mm_s, 5), stamp_ms, observations=0)


def _blocks(section: AccelerometerSection, state: State, block: Block, stamp_us: float) -> tuple[State, list[Change]]:
    """Blocks of the configured length, stamped with the time of their last sample."""
    size = max(2, round(section.block_s * block.rate_hz))
    waiting, changes, at = (*state.pending, *block.samples_g), list[Change](), 0
    while at + size <= len(waiting):
        at += size
        stamp_ms = round((stamp_us - 1e6 * (len(waiting) - at) / block.rate_hz) / 1000.0)
        # The rate goes with each block: whoever has missed one of them has it with the next.
        changes += [Change(RATE, block.rate_hz, stamp_ms), Change(BLOCK, waiting[at - size : at], stamp_ms)]
    return state._replace(pending=waiting[at:]), changes
