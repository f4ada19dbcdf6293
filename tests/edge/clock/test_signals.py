"""The clock by the signals: on a made spindle, and on that of a real Okuma."""

import random
from itertools import pairwise
from statistics import median

import pytest

from edge.clock import offset as clock
from edge.clock import signals as clock_signals
from edge.clock.bounds import Bound
from edge.clock.signals import News, Points, State, compare, step
from edge.controls.mtconnect.documents import timestamp_ms
from edge.sample import ClockReading
from tests.recordings import recording

STEPS_S = (11.3, 14.0, 31.7, 45.2, 45.9, 70.4, 88.8, 101.1)


def speed_of(steps_s: tuple[float, ...], poll_s: float) -> Points:
    """A spindle that changes at these moments, as a control shows it that is polled."""
    polls = (round(poll_s * number, 6) for number in range(round(130.0 / poll_s)))
    shown = [(at_s, 500.0 + 700.0 * (sum(at_s >= one for one in steps_s) % 3)) for at_s in polls]
    return tuple(point for place, point in enumerate(shown) if not place or point[1] != shown[place - 1][1])


def current_of(steps_s: tuple[float, ...], offset_s: float, chance: random.Random, *, follows_speed: bool = False) -> Points:
    """Return what a sensor of the edge sees, by the edge's clock: a surge of 0.2 s at each change, or a level that follows the
    speed."""
    grid = (number * 0.05 for number in range(-200, 2800))
    if follows_speed:
        return tuple((t - offset_s, sum(t >= one for one in steps_s) % 3 + chance.gauss(0, 0.05)) for t in grid)
    return tuple((t - offset_s, sum(0.0 <= t - one < 0.2 for one in steps_s) + abs(chance.gauss(0, 0.1))) for t in grid)


@pytest.mark.parametrize("follows_speed", [False, True])
@pytest.mark.parametrize("offset_s", [0.0, 1.7, -2.4])
def test_the_offset_is_found_in_the_signals_to_within_half_a_second(offset_s: float, follows_speed: bool) -> None:
    envelope = current_of(STEPS_S, offset_s, random.Random(3), follows_speed=follows_speed)
    peak = compare(speed_of(STEPS_S, 0.35), envelope, from_s=2.0, around_s=0.5, poll_s=0.35)
    assert peak is not None
    assert peak.quality > clock_signals.QUALITY_MIN
    assert abs(peak.offset_s - offset_s) < 0.25


def test_a_spindle_that_keeps_its_speed_tells_nothing() -> None:
    envelope = current_of(STEPS_S, 0.0, random.Random(3))
    assert compare(((0.0, 500.0), (60.0, 500.0)), envelope, from_s=2.0, around_s=0.0, poll_s=0.35) is None
    assert compare(speed_of(STEPS_S, 0.35), (), from_s=2.0, around_s=0.0, poll_s=0.35) is None


def test_a_sensor_of_another_machine_is_below_the_quality_that_counts() -> None:
    """Eight machines whose spindles change at other moments."""
    for seed in range(8):
        chance = random.Random(seed)
        other = tuple(sorted(chance.uniform(0.0, 120.0) for _ in STEPS_S))
        news = News(speed_of(STEPS_S, 0.35), current_of(other, 0.0, chance))
        state, bound = step(State(), news, at_s=0.0, around_s=0.0, poll_s=0.35)
        assert bound is None
        assert state.offsets_s == ()


def test_points_come_one_by_one_and_the_state_stays_bounded() -> None:
    speed, envelope = speed_of(STEPS_S, 0.35), current_of(STEPS_S, 1.0, random.Random(1))
    state, bounds, told = State(), list[Bound](), 0
    for point in envelope:
        now = [one for one in speed[told:] if one[0] <= point[0] + 1.0]
        told += len(now)
        state, bound = step(state, News(tuple(now), (point,)), at_s=point[0], around_s=0.8, poll_s=0.35)
        bounds += [bound] if bound is not None else []
    assert [bound.low_s <= 1.0 <= bound.high_s for bound in bounds] == [True]
    assert len(state.envelope) < 700
    for number in range(clock_signals.POINTS_MAX + 50):
        state, _ = step(state, News(((200.0 + number, 1.0),)), at_s=0.0, around_s=0.0, poll_s=0.35)
    assert len(state.speed) <= clock_signals.POINTS_MAX


def test_where_stamps_alone_are_known_the_signals_say_how_long_a_sample_takes() -> None:
    """Samples that take 0.9 s, of a clock that stamps; the clock that is read is another and 100 s off."""
    state = clock.State()
    for number in range(200):
        reading = ClockReading((1000 + number) * 1000 + 100_000, (1000 + number) * 1000, 10, 1)
        peak = Bound(float(number), -0.6, 0.6) if number == 100 else None
        stamp_ms = (1000 + number) * 1000 - 900
        state = clock.step(state, clock.Heard(float(number), (1000 + number) * 1000.0, reading, stamp_ms, peak)).state
    assert state.published is not None
    assert state.published.bound is not None
    assert state.published.method == "stamps of samples, signals; the clock that is read is another"
    assert state.published.bound.low_s <= 0.0 <= state.published.bound.high_s
    assert state.published.bound.spread_s < 0.8


def recorded_speed() -> Points:
    """The ten minutes of the recording in which the main spindle works."""
    shown: list[tuple[float, float]] = []
    for line in recording("mtconnect/okuma.txt").read_text(encoding="utf-8", errors="replace").split("\n"):
        fields = line.split("|")
        pairs = dict(zip(fields[1::2], fields[2::2], strict=False))
        at_ms = timestamp_ms(fields[0])
        if at_ms is not None and pairs.get("S1speed", "").isdigit():
            shown.append((at_ms / 1000.0, float(pairs["S1speed"])))
    begin = max(range(1, len(shown) - 200), key=lambda place: shown[place - 1][0] - shown[place][0])  # where its time goes back
    return tuple(point for point in shown[begin:] if 0.0 <= point[0] - shown[begin][0] < 610.0)


@pytest.mark.parametrize(("offset_s", "ppm"), [(0.0, 0.0), (1.7, 0.0), (-2.4, 50.0), (0.8, -100.0)])
def test_the_recorded_spindle_of_an_okuma_gives_the_offset_to_within_half_a_second(offset_s: float, ppm: float) -> None:
    """The table of the method; sensor and network are made, and each change happens at some moment of the poll before."""
    chance, speed = random.Random(2), recorded_speed()
    assert len(speed) > 200
    from_s = speed[0][0]
    surges = [0.0] * 12400
    for (_, before), (at_s, value) in pairwise(speed):
        place = round((at_s - chance.uniform(0.1, 0.4) - from_s) / 0.05)
        for number in (place, place + 1):
            surges[number] += abs(value - before) / 100.0
    times = (from_s + 0.05 * number for number in range(len(surges)))
    envelope = tuple(
        (t - offset_s - ppm * 1e-6 * (t - from_s), surge + abs(chance.gauss(0, 0.3)))
        for t, surge in zip(times, surges, strict=True)
    )
    found = [compare(speed, envelope, from_s=from_s + 120.0 * number, around_s=0.0, poll_s=0.35) for number in range(5)]
    used = [peak.offset_s for peak in found if peak is not None and peak.quality > clock_signals.QUALITY_MIN]
    assert len(used) >= 2
    assert abs(median(used) - offset_s - ppm * 1e-6 * 300.0) < 0.5
