"""The vibration processor: blocks in, figures of a window out; what breaks the stream is said."""

import json
import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.actions import Action, DeadLetter, Publish
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from processors.vibration import BLOCK, CREST, KURTOSIS, NAMES, PEAK, PROCESSOR, RATE, RMS, VELOCITY
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change
from sparkplug.quality import Quality
from tests.processors.streams import birth, data, death, engine_of, event, fed, hole, reading

RATE_HZ = 10_000.0
SINE_MM_S = 9806.65 / (2.0 * math.pi * 100.0) / math.sqrt(2.0)


def shaking(seconds: float, rate_hz: float = RATE_HZ) -> Any:
    """1 g of gravity, 1 g of 100 Hz, and noise of the sensor."""
    at_s = np.arange(round(seconds * rate_hz)) / rate_hz
    return 1.0 + np.sin(2.0 * math.pi * 100.0 * at_s) + np.random.default_rng(1).normal(0.0, 1e-3, at_s.size)


def blocks(signal: Any, block_s: float = 0.1, start_s: float = 0.0, rate_hz: float = RATE_HZ) -> list[HostEvent]:
    """The signal as an edge sends it, each block stamped with its end."""
    size = round(block_s * rate_hz)
    parts = [signal[i : i + size] for i in range(0, len(signal), size)]
    ends_s = start_s + np.cumsum([len(part) for part in parts]) / rate_hz
    return [data(float(end_s), **{BLOCK: tuple(part.tolist())}) for part, end_s in zip(parts, ends_s, strict=True)]


def start(at_s: float = 0.0, rate_hz: float | None = RATE_HZ) -> HostEvent:
    """The birth of a machine with a sensor that has not measured yet."""
    return event(
        EventKind.BIRTH,
        at_s,
        reading(BLOCK, None, at_s, quality=Quality.BAD, reason="not known yet"),
        reading(RATE, rate_hz, at_s),
    )


def last(engine: Engine) -> dict[str, Change]:
    """Return what a reader knows by now."""
    return engine._machines["okuma"].live.emission.latest


def shown(actions: list[Action], name: str) -> list[Change]:
    """Return what was published of one output."""
    return [c for action in actions if isinstance(action, Publish) for c in action.changes if c.name == name]


def test_a_sine_of_1_g_at_100_hz_reads_as_on_paper() -> None:
    engine = engine_of(PROCESSOR)
    actions = fed(engine, start(), *blocks(shaking(3.0)))
    assert [action for action in actions if isinstance(action, DeadLetter)] == []
    assert last(engine)[VELOCITY].value == pytest.approx(SINE_MM_S, rel=1e-3)
    assert last(engine)[RMS].value == pytest.approx(1.0 / math.sqrt(2.0), rel=1e-3)
    assert last(engine)[PEAK].value == pytest.approx(1.0, abs=0.01)
    assert last(engine)[CREST].value == pytest.approx(math.sqrt(2.0), abs=0.01)
    assert last(engine)[KURTOSIS].value == pytest.approx(1.5, abs=0.01)


def test_before_the_first_window_is_full_there_are_no_figures() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, start(), *blocks(shaking(1.4)))
    assert last(engine)[VELOCITY].value is None
    fed(engine, *blocks(shaking(0.2), start_s=1.4))
    assert last(engine)[VELOCITY].value is not None


@given(sizes=st.lists(st.integers(100, 9_000), min_size=1, max_size=12))
@settings(max_examples=25, deadline=None)
def test_where_blocks_end_changes_no_figure(sizes: list[int]) -> None:
    """Windows are counted in samples: with blocks of a tenth of a second or of any length, the same windows come out."""
    signal = shaking(3.5)
    cuts = np.cumsum([*sizes, *[5_000] * 7])
    parts = [part for part in np.split(signal, cuts[cuts < len(signal) - 100]) if len(part)]
    at_s, any_length = 0.0, []
    for part in parts:
        at_s += len(part) / RATE_HZ
        any_length.append(data(at_s, **{BLOCK: tuple(part.tolist())}))
    plain, other = engine_of(PROCESSOR), engine_of(PROCESSOR)
    fed(plain, start(), *blocks(signal))
    actions = fed(other, start(), *any_length)
    assert not [c.reason for c in shown(actions, VELOCITY)[1:] if c.reason]
    for name in NAMES:
        assert last(other)[name].value == pytest.approx(last(plain)[name].value, rel=0.02)
    states = [engine._machines["okuma"].live.state for engine in (plain, other)]
    assert states[0].unsettled == states[1].unsettled == 0
    assert states[0].tally == pytest.approx(states[1].tally, rel=1e-9)


def test_a_restart_between_any_two_blocks_changes_nothing() -> None:
    stream = [start(), *blocks(shaking(2.5))]
    whole = fed(engine_of(PROCESSOR), *stream)
    adapter: TypeAdapter[Any] = TypeAdapter(PROCESSOR.state)
    engine, found = engine_of(PROCESSOR), []
    for one in stream:
        found += fed(engine, one)
        fold = engine._machines["okuma"].live.fold
        fold.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, fold.state))))
    assert repr(found) == repr(whole)


def test_the_state_stays_small() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, start(), *blocks(shaking(3.0)))
    assert len(engine.snapshot("okuma")) < 2_500


@pytest.mark.parametrize(
    ("table", "spoilt", "reason"),
    [
        ({}, {40: math.nan}, "vibration_block_g holds what no sensor measures"),
        ({}, {40: math.inf}, "vibration_block_g holds what no sensor measures"),
        ({}, {0: -1e9}, "vibration_block_g holds what no sensor measures"),
        ({"full_scale_g": 16.0}, {40: -16.0}, "vibration_block_g reaches the full scale of 16 g"),
        ({}, {40: "one"}, "vibration_block_g is no array of numbers"),
        ({}, {40: True}, "vibration_block_g is no array of numbers"),
    ],
)
def test_a_block_that_cannot_be_trusted_breaks_the_stream_and_says_so(
    table: dict[str, Any], spoilt: dict[int, Any], reason: str
) -> None:
    engine = engine_of(PROCESSOR, **table)
    stream = blocks(shaking(3.0))
    values: list[Any] = list(stream[20].readings[0].value)  # type: ignore[arg-type]
    for index, value in spoilt.items():
        values[index] = value
    stream[20] = data(2.1, **{BLOCK: tuple(values)})
    fed(engine, start(), *stream[:20])
    assert last(engine)[VELOCITY].value is not None
    fed(engine, stream[20])
    assert {(last(engine)[name].value, last(engine)[name].reason) for name in NAMES} == {(None, reason)}
    fed(engine, *stream[21:], *blocks(shaking(1.0), start_s=3.0))
    assert last(engine)[VELOCITY].value == pytest.approx(SINE_MM_S, rel=2e-3)


@pytest.mark.parametrize(
    ("table", "block", "reason"),
    [
        ({}, (0.0,) * 1000, "all samples of vibration_block_g are the same: is a sensor connected?"),
        ({}, (), "vibration_block_g is shorter than 10 ms or longer than 1000000 samples"),
        ({}, (0.1, 0.2), "vibration_block_g is shorter than 10 ms or longer than 1000000 samples"),
        ({"block_samples": 500}, (0.1, 0.2) * 500, "vibration_block_g has not the 500 samples that are configured"),
        ({}, 3.0, "vibration_block_g is no array of numbers"),
        ({}, "text", "vibration_block_g is no array of numbers"),
        ({}, (None, 1.0) * 500, "vibration_block_g is no array of numbers"),
        ({}, (2**63, 1) * 500, "vibration_block_g holds what no sensor measures"),
    ],
)
def test_a_first_block_that_is_none_gives_a_reason(table: dict[str, Any], block: Any, reason: str) -> None:
    engine = engine_of(PROCESSOR, **table)
    actions = fed(engine, start(), data(0.1, **{BLOCK: block}))
    assert [action for action in actions if isinstance(action, DeadLetter)] == []
    assert last(engine)[VELOCITY].reason == reason


@pytest.mark.parametrize("lost", [1, 3, 40])
def test_a_lost_block_is_seen_by_the_stamps(lost: int) -> None:
    engine = engine_of(PROCESSOR)
    stream = blocks(shaking(9.0))
    fed(engine, start(), *stream[:20])
    actions = fed(engine, *stream[20 + lost :])
    velocity = shown(actions, VELOCITY)
    assert velocity[0].reason == "vibration_block_g: a block is missing, or its sample rate is lower than it says"
    assert all(c.value == pytest.approx(SINE_MM_S, rel=2e-3) for c in velocity[1:] if c.value is not None)
    assert last(engine)[VELOCITY].value is not None


def test_after_a_break_so_much_is_settled_that_no_figure_is_wrong() -> None:
    """A tenth of a second of 50 mm/s at 20 Hz lies between two pieces of the same quiet signal; its end is cut off."""
    engine = engine_of(PROCESSOR)
    at_s = np.arange(30_000) / RATE_HZ
    quiet = 0.01 * np.sin(2.0 * math.pi * 100.0 * at_s)
    stream = blocks(quiet)
    wild = blocks(0.6 * np.sin(2.0 * math.pi * 20.0 * at_s[:1000]), start_s=1.0)
    actions = fed(engine, start(), *stream[:10], *wild, *blocks(quiet[:25_000], start_s=1.6))
    after = [c.value for c in shown(actions, VELOCITY) if c.value is not None]
    assert after == pytest.approx([SINE_MM_S / 100.0], abs=0.002)


@pytest.mark.parametrize(
    ("block_s", "reason"),
    [
        (0.05, "vibration_block_g: blocks come faster than their sample rate says"),
        (0.09, "vibration_block_g: blocks come faster than their sample rate says"),
        (0.12, "vibration_block_g: a block is missing, or its sample rate is lower than it says"),
    ],
)
def test_a_sample_rate_that_the_stamps_contradict_is_not_believed(block_s: float, reason: str) -> None:
    """At 10 kHz a block of 1000 is 0.1 s. A velocity of another rate would be wrong by as much."""
    engine = engine_of(PROCESSOR)
    signal = shaking(4.0)
    stream = [data(block_s * i, **{BLOCK: tuple(signal[1000 * i : 1000 * i + 1000].tolist())}) for i in range(1, 40)]
    actions = fed(engine, start(), *stream)
    assert [c.value for c in shown(actions, VELOCITY) if c.value is not None] == []
    assert last(engine)[VELOCITY].reason == reason


def test_a_block_that_comes_twice_counts_once() -> None:
    once, twice = engine_of(PROCESSOR), engine_of(PROCESSOR)
    stream = blocks(shaking(2.0))
    fed(once, start(), *stream)
    fed(twice, start(), *(one for block in stream for one in (block, block)))
    assert last(once) == last(twice)


def test_a_block_from_before_a_hole_is_not_taken_again() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, start(), *blocks(shaking(2.0)), hole(2.0), data(2.05, **{RATE: RATE_HZ}))
    assert engine._machines["okuma"].live.state.stamp_ms is None


def test_an_edge_that_jitters_by_less_than_half_a_block_loses_nothing() -> None:
    engine = engine_of(PROCESSOR)
    chance = np.random.default_rng(2)
    late_s = np.abs(chance.normal(0.0, 0.01, 30))
    signal = shaking(3.0)
    stream = [data(0.1 * i + late_s[i - 1], **{BLOCK: tuple(signal[1000 * i - 1000 : 1000 * i].tolist())}) for i in range(1, 31)]
    actions = fed(engine, start(), *stream)
    assert not [c.reason for c in shown(actions, VELOCITY)[1:] if c.reason]


def test_without_a_sample_rate_nothing_is_said_and_a_configured_one_serves() -> None:
    nameless = birth(0.0, spindle_rpm=0.0)
    bare = event(EventKind.BIRTH, 0.0, reading(BLOCK, None, quality=Quality.BAD))
    engine = engine_of(PROCESSOR)
    fed(engine, nameless)
    assert last(engine)[VELOCITY].reason == "vibration_block_g is not offered"
    engine = engine_of(PROCESSOR)
    fed(engine, bare, *blocks(shaking(2.0)))
    assert last(engine)[VELOCITY].reason == "vibration_sample_rate_hz is not offered, and no sample_rate_hz is configured"
    engine = engine_of(PROCESSOR, sample_rate_hz=RATE_HZ)
    fed(engine, bare, *blocks(shaking(2.0)))
    assert last(engine)[VELOCITY].value == pytest.approx(SINE_MM_S, rel=1e-3)


def test_a_rate_too_low_for_the_band_is_refused_and_a_changed_one_starts_anew() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, start(rate_hz=2000.0), *blocks(shaking(2.0)))
    assert last(engine)[VELOCITY].reason == "the sample rate is outside 4000 to 200000 Hz"
    engine = engine_of(PROCESSOR)
    fed(engine, start(), *blocks(shaking(2.0)), data(2.0, **{RATE: 20_000.0}))
    actions = fed(engine, *blocks(shaking(3.0, 20_000.0), start_s=2.0, rate_hz=20_000.0))
    assert shown(actions, VELOCITY)[0].reason == "the sample rate has changed"
    assert last(engine)[VELOCITY].value == pytest.approx(SINE_MM_S, rel=1e-3)


def test_silence_death_and_a_hole_end_the_figures() -> None:
    stream = [start(), *blocks(shaking(2.0))]
    engine = engine_of(PROCESSOR)
    fed(engine, *stream, data(8.0, **{RATE: RATE_HZ}))
    assert last(engine)[VELOCITY].reason == "no block for 5 s"
    engine = engine_of(PROCESSOR)
    fed(engine, *stream, death(2.1))
    assert last(engine)[VELOCITY].reason == "vibration_block_g is stale: device offline"
    engine = engine_of(PROCESSOR)
    fed(engine, *stream, hole(2.1))
    assert last(engine)[VELOCITY].reason == "3 messages are lost"


def test_a_block_longer_than_the_window_is_a_window() -> None:
    engine = engine_of(PROCESSOR)
    quiet, loud = 0.1 * (shaking(5.0) - 1.0), shaking(5.0) - 1.0
    actions = fed(engine, start(), *blocks(np.concatenate([loud, quiet, loud]), block_s=5.0))
    values = [c.value for c in shown(actions, VELOCITY) if c.value is not None]
    assert values[0] == pytest.approx(SINE_MM_S, rel=1e-3)
    assert len(values) == 3
    assert values[1] == pytest.approx(math.sqrt((0.5 + 4.5 * 0.01) / 5.0) * SINE_MM_S, rel=0.02)


@given(
    stream=st.lists(
        st.tuples(
            st.sampled_from([0.0, 0.1, 0.1, 0.1, 0.2, 7.0, -0.05]),
            st.one_of(
                st.integers(0, 3000).map(lambda n: tuple(np.random.default_rng(n).normal(0.0, 1.0, n).tolist())),
                st.lists(st.one_of(st.floats(), st.integers(-(2**70), 2**70), st.none()), max_size=5).map(tuple),
                st.floats(),
                st.none(),
            ),
            st.sampled_from([None, None, 10_000.0, 20_000.0, math.nan, -1.0, "fast"]),
        ),
        max_size=25,
    )
)
@settings(max_examples=60, deadline=None)
def test_nothing_that_comes_as_a_block_crashes_it(stream: list[tuple[float, Any, Any]]) -> None:
    engine, actions, at_s = engine_of(PROCESSOR), [], 0.0
    actions += fed(engine, start())
    for step_s, block, rate in stream:
        at_s = max(at_s + step_s, 0.0)
        actions += fed(engine, data(at_s, **{BLOCK: block}, **({} if rate is None else {RATE: rate})))
    assert [action for action in actions if isinstance(action, DeadLetter)] == []
    assert all(c.reason for name in NAMES for c in shown(actions, name) if c.value is None)
    lane = engine._machines["okuma"].live
    adapter: TypeAdapter[Any] = TypeAdapter(PROCESSOR.state)
    assert decode_state(adapter, json.loads(json.dumps(encode_state(adapter, lane.state)))) == lane.state


def test_it_is_found_without_numpy() -> None:
    code = "import sys; sys.modules['numpy'] = None; import processors.vibration, processors.rules.processor"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
