"""Blocks of acceleration become values and blocks to publish; whatever breaks the stream is said."""

import math
import random
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from edge.accelerometer.fold import BLOCK, NO_BLOCK, RATE, RMS, VELOCITY, Delivery, State, silent, step
from edge.accelerometer.frame import Block
from edge.accelerometer.section import AccelerometerSection, Publish
from processors.vibration import PROCESSOR
from processors.vibration import RMS as TWIN_RMS
from processors.vibration import VELOCITY as TWIN_VELOCITY
from sparkplug.quality import Quality
from tests.processors.streams import T0_MS, birth, data, engine_of, fed, published

RATE_HZ = 10_000.0
VALUES, BOTH = AccelerometerSection(url="tcp://sensor:9500"), AccelerometerSection(url="tcp://sensor:9500", publish=Publish.BOTH)
T0_US = T0_MS * 1000


def shaken(seconds: float) -> list[float]:
    chance = random.Random(5)
    return [1.0 + 0.4 * math.sin(0.05 * number) + chance.gauss(0.0, 0.1) for number in range(round(seconds * RATE_HZ))]


def blocks(samples_g: list[float], size: int = 1000, first: int = 0, *, timed: bool = True) -> list[Block]:
    """The samples cut into blocks; each with the time of its last sample."""
    found = []
    for number, at in enumerate(range(0, len(samples_g), size), start=first):
        part = tuple(samples_g[at : at + size])
        last_us = T0_US + round((at + len(part)) / RATE_HZ * 1e6)
        found.append(Block(number, RATE_HZ, last_us if timed else None, part))
    return found


def folded(section: AccelerometerSection, stream: list[Block], state: State | None = None) -> tuple[State, list[Delivery]]:
    state, found = state or State(), list[Delivery]()
    for block in stream:
        state, delivery = step(section, state, block, float(block.last_us or T0_US))
        found.append(delivery)
    return state, found


def told(deliveries: list[Delivery], signal: str = RMS) -> list[tuple[float, object, str | None]]:
    """Seconds, value and reason of each sample of a signal."""
    samples = (sample for delivery in deliveries for sample in delivery.frame.samples if sample.signal == signal)
    return [((sample.timestamp_ms - T0_MS) / 1000, sample.value, sample.reason) for sample in samples]


def test_values_come_each_second_after_the_filters_have_settled() -> None:
    _, found = folded(VALUES, blocks(shaken(3.6)))
    assert [at_s for at_s, _, _ in told(found)] == [1.5, 2.5, 3.5]
    assert [at_s for at_s, _, _ in told(found, VELOCITY)] == [1.5, 2.5, 3.5]
    assert all(delivery.changes == () for delivery in found)
    assert all(delivery.frame.accounted() for delivery in found)


def test_the_edge_and_the_processor_say_the_same_of_the_same_blocks() -> None:
    _, found = folded(BOTH, blocks(shaken(4.6), size=730))
    engine = engine_of(PROCESSOR, full_scale_g=16.0)
    fed(engine, birth(0.0, vibration_sample_rate_hz=RATE_HZ, vibration_block_g=None))
    effects = [
        effect
        for delivery in found
        for change in delivery.changes
        for effect in fed(engine, data((change.timestamp_ms - T0_MS) / 1000, **dict[str, Any]([(change.name, change.value)])))
    ]
    by_processor = published(effects)
    for ours, twins in ((RMS, TWIN_RMS), (VELOCITY, TWIN_VELOCITY)):
        expected = [value for _, name, value, _ in by_processor if name == twins and value is not None]
        mine = [value for _, value, _ in told(found, ours)]
        assert len(expected) >= 3
        assert mine[: len(expected)] == pytest.approx(expected, abs=2e-5, rel=1e-4)


def test_blocks_are_published_in_the_configured_length_with_the_time_of_their_last_sample() -> None:
    samples_g = shaken(2.2)
    _, found = folded(BOTH.model_copy(update={"publish": Publish.BLOCKS}), blocks(samples_g, size=333))
    changes = [change for delivery in found for change in delivery.changes]
    assert [change.name for change in changes] == [RATE, BLOCK] * 4
    assert [change.timestamp_ms - T0_MS for change in changes[1::2]] == [500, 1000, 1500, 2000]
    assert [value for change in changes[1::2] for value in change.value] == samples_g[:20_000]  # type: ignore[union-attr]
    assert told(found) == []


@given(size=st.integers(100, 3000), cut=st.integers(1, 12))
@settings(max_examples=10)
def test_neither_block_lengths_nor_a_restart_from_json_change_a_value(size: int, cut: int) -> None:
    samples_g = shaken(1.6)
    codec = TypeAdapter(State)
    _, whole = folded(VALUES, blocks(samples_g, size=500))
    stream = blocks(samples_g, size=size)
    state, first = folded(VALUES, stream[:cut])
    _, second = folded(VALUES, stream[cut:], codec.validate_json(codec.dump_json(state)))
    assert [(at_s, value) for at_s, value, _ in told(first + second)] == [(at_s, value) for at_s, value, _ in told(whole)]


def test_a_lost_block_is_a_hole_and_the_values_are_null_until_the_filters_have_settled() -> None:
    stream = blocks(shaken(4.0))
    _, found = folded(VALUES, stream[:20] + stream[23:])
    (gap,) = [gap for delivery in found for gap in delivery.frame.gaps]
    assert (gap.first_sequence, gap.last_sequence, gap.lost) == (20, 22, 3)
    assert told(found)[1:] == [
        (2.4, None, "blocks of the accelerometer are lost"),
        (pytest.approx(3.8, abs=0.01), told(found)[2][1], None),
    ]
    null = next(s for delivery in found for s in delivery.frame.samples if s.value is None)
    assert null.quality is Quality.BAD


def test_a_sender_that_starts_anew_is_a_hole_of_unknown_length() -> None:
    state, _ = folded(VALUES, blocks(shaken(1.0), first=500))
    _, found = folded(VALUES, blocks(shaken(0.3)), state)
    assert [(gap.reason, gap.lost) for gap in found[0].frame.gaps] == [("the accelerometer's sender started again", 0)]
    assert [gap for delivery in found[1:] for gap in delivery.frame.gaps] == []


FULL, NONSENSE = "the accelerometer reaches its full scale of 16 g", "a block of the accelerometer holds what no sensor measures"


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda b: b._replace(samples_g=(*b.samples_g[:-1], 15.99)), FULL),
        (lambda b: b._replace(samples_g=(-16.0, *b.samples_g[1:])), FULL),
        (lambda b: b._replace(samples_g=(*b.samples_g[:9], math.nan, *b.samples_g[10:])), NONSENSE),
        (lambda b: b._replace(samples_g=(math.inf, *b.samples_g[1:])), NONSENSE),
        (lambda b: b._replace(samples_g=(1.0,) * 1000), "all samples of the accelerometer are the same: is a sensor connected?"),
        (lambda b: b._replace(rate_hz=2000.0), "the accelerometer samples at 2000 Hz, and 4000 is the least"),
        (lambda b: b._replace(rate_hz=12_000.0), "the accelerometer's sample rate has changed"),
    ],
)
def test_a_block_that_cannot_be_used_makes_the_values_null_and_says_why(spoil: object, reason: str) -> None:
    assert callable(spoil)
    stream = blocks(shaken(4.0))
    stream[17:19] = [spoil(stream[17]), spoil(stream[18])]
    _, found = folded(VALUES, stream)
    nulls = [(at_s, why) for at_s, value, why in told(found) if value is None]
    assert nulls[0][0] == pytest.approx(1.8)
    assert {why for _, why in nulls} == {reason}
    assert told(found)[-1][1] is not None, "it recovers"
    assert not any(isinstance(value, float) and not math.isfinite(value) for _, value, _ in told(found))


def test_blocks_without_a_time_are_stamped_by_their_rate_and_not_by_the_networks_jitter() -> None:
    chance, state, stamps = random.Random(1), State(), list[float]()
    section = AccelerometerSection(url="tcp://sensor:1", publish=Publish.BLOCKS, block_s=0.1)
    for number, block in enumerate(blocks(shaken(5.0), timed=False)):
        arrival_us = T0_US + (number + 1) * 100_020 + chance.uniform(0.0, 80_000.0)  # 200 ppm slow, and late
        state, delivery = step(section, state, block, arrival_us)
        stamps += [change.timestamp_ms - T0_MS for change in delivery.changes if change.name == BLOCK]
    steps = [after - before for before, after in pairwise(stamps)]
    assert all(95 < one < 105 for one in steps)
    assert abs(stamps[-1] - 5000.0) < 90


def test_silence_is_said_once() -> None:
    state, found = folded(VALUES, blocks(shaken(1.6)))
    state, first = silent(state, 5.0, T0_MS + 7000)
    state, second = silent(state, 5.0, T0_MS + 8000)
    assert told([first]) == [(7.0, None, "no block from the accelerometer for 5 s")]
    assert second == Delivery()
    assert State().why_not == NO_BLOCK
    assert told(found)[0][1] is not None


def test_the_envelope_shows_a_surge_when_it_was() -> None:
    samples_g = [value * (5.0 if 20_000 <= place < 22_000 else 1.0) for place, value in enumerate(shaken(3.0))]
    _, found = folded(VALUES, blocks(samples_g))
    envelope = [point for delivery in found for point in delivery.envelope]
    assert len(envelope) == 25
    strong = [at_s - T0_MS / 1000 for at_s, rms_g in envelope if rms_g > 0.7]
    assert strong[0] == pytest.approx(2.05, abs=0.01)
    assert len(strong) in {2, 3}
