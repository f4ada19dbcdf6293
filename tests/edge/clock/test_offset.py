"""The clock fold: whatever the control's clock is, the truth lies in the spread that is stated, and a step of it is found."""

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from edge.clock import offset as clock
from edge.clock.offset import OFFSET, SPREAD, STAMPED_BY, Heard, State, heard
from edge.sample import ClockReading, EdgeSample, SampleSet
from edge.signals import signal
from sparkplug.metric import MetricSpec

T0_S = 1_700_000_000.0


@dataclass(frozen=True)
class Clock:
    """A control's clock and the way to it; all that is drawn is drawn from `seed`.

    ways_s: the shortest and the longest way of a message
    """

    offset_s: float = 0.0
    ppm: float = 0.0
    resolution_ms: int = 1000
    ways_s: tuple[float, float] = (0.001, 0.02)
    every_s: float = 10.0
    one_way_ms: int = 0
    stamps_samples: bool = False
    seed: int = 0

    def at(self, at_s: float) -> float:
        """Control minus edge."""
        return self.offset_s + self.ppm * 1e-6 * at_s

    def shows_ms(self, at_s: float) -> int:
        shown_ms = int((T0_S + at_s + self.at(at_s)) * 1000)
        return shown_ms - shown_ms % self.resolution_ms

    def looks(self, from_s: float, to_s: float) -> Iterator[Heard]:
        """What the edge hears of it."""
        chance, at_s, last_s = random.Random(f"{self.seed} {from_s}"), from_s, from_s
        while at_s < to_s:
            looked_s = at_s + chance.uniform(*self.ways_s)
            arrival_s = max(last_s, looked_s + chance.uniform(*self.ways_s))
            middle_ms = 0 if self.one_way_ms else round((T0_S + (at_s + arrival_s) / 2) * 1000)
            trip_ms = self.one_way_ms or round((arrival_s - at_s) * 1000)
            reading = ClockReading(self.shows_ms(looked_s), middle_ms, trip_ms, self.resolution_ms, self.stamps_samples)
            newest_ms = replace(self, resolution_ms=1).shows_ms(looked_s - 0.1) if self.stamps_samples else None
            yield Heard(arrival_s, (T0_S + arrival_s) * 1000, reading, newest_ms)
            last_s = arrival_s
            at_s += self.every_s * chance.uniform(0.9, 1.1)


def folded(looks: Iterator[Heard], state: State | None = None) -> Iterator[tuple[Heard, clock.Done]]:
    state = state or State()
    for look in looks:
        done = clock.step(state, look)
        state = done.state
        yield look, done


def after(looks: Iterator[Heard], state: State | None = None) -> State:
    """The state after all of them."""
    *_, (_, done) = folded(looks, state)
    return done.state


def last_health(looks: Iterator[Heard], state: State | None = None) -> tuple[dict[str, object], State]:
    """The health that was told last, and the state after all."""
    health: dict[str, object] = {}
    for _, done in folded(looks, state):
        health |= done.health
        state = done.state
    assert state is not None
    return health, state


def values(samples: tuple[EdgeSample, ...]) -> dict[str, object]:
    return {sample.signal: sample.value for sample in samples}


WAYS = st.tuples(st.floats(0.0, 0.2), st.floats(0.0, 2.0)).map(lambda ways: (ways[0], ways[0] + ways[1]))
CLOCKS = st.builds(
    Clock,
    offset_s=st.floats(-1e8, 1e8),
    ppm=st.floats(-400, 400),
    resolution_ms=st.sampled_from([1, 10, 1000]),
    ways_s=WAYS,
    stamps_samples=st.booleans(),
    seed=st.integers(0, 10**6),
)


@given(one=CLOCKS)
@settings(max_examples=60, deadline=None)
def test_the_truth_lies_within_the_stated_spread_whatever_the_clock_and_the_network(one: Clock) -> None:
    """Readings over a round trip are hard bounds, so this holds at every moment, not on average."""
    told: dict[str, object] = {}
    for look, done in folded(one.looks(0.0, 600.0)):
        told = values(done.samples) or told
        offset_s, spread_s = told[OFFSET], told[SPREAD]
        assert isinstance(offset_s, float)
        assert isinstance(spread_s, float)
        assert abs(offset_s - one.at(look.at_s)) <= spread_s
        assert done.state.steps == 0


@given(offset_s=st.floats(-1e6, 1e6), ppm=st.floats(-100, 100), seed=st.integers(0, 10**6))
@example(offset_s=-1.0625, ppm=0.0, seed=298)  # of the first 14 documents none that was quick came just after a full second
@settings(max_examples=25, deadline=None)
def test_documents_that_come_one_way_are_enough_where_one_of_them_is_quick(offset_s: float, ppm: float, seed: int) -> None:
    one = Clock(offset_s, ppm, ways_s=(0.02, 0.9), every_s=0.7, one_way_ms=500, stamps_samples=True, seed=seed)
    told: dict[str, object] = {}
    for look, done in folded(one.looks(0.0, 300.0)):
        told = values(done.samples) or told
        if told:
            assert abs(float(str(told[OFFSET])) - one.at(look.at_s)) <= float(str(told[SPREAD]))
        assert done.state.steps == 0
    assert told[STAMPED_BY] == "control"
    assert float(str(told[SPREAD])) < 0.6


@given(
    every_s=st.sampled_from([0.1, 0.5, 0.7, 1.9, 3.0]),
    longest_s=st.floats(0.1, 0.95),
    ppm=st.floats(-400, 400),
    resolution_ms=st.sampled_from([1, 10, 1000]),
    stamps_samples=st.booleans(),
    seed=st.integers(0, 10**6),
)
@example(every_s=2.0, longest_s=0.85, ppm=32.5, resolution_ms=10, stamps_samples=True, seed=4059)
@settings(max_examples=15, deadline=None)
def test_documents_cover_at_any_pace_and_drift_where_half_of_them_are_quick(
    every_s: float, longest_s: float, ppm: float, resolution_ms: int, stamps_samples: bool, seed: int
) -> None:
    one = Clock(77.7, ppm, resolution_ms, (0.02, longest_s), every_s, 500, stamps_samples, seed)
    told: dict[str, object] = {}
    for look, done in folded(one.looks(0.0, 600.0)):
        told = values(done.samples) or told
        if told:
            assert abs(float(str(told[OFFSET])) - one.at(look.at_s)) <= float(str(told[SPREAD]))
        assert done.state.steps == 0


@given(
    by_s=st.floats(1.6, 1e7),
    is_back=st.booleans(),
    resolution_ms=st.sampled_from([1, 1000]),
    one_way_ms=st.sampled_from([0, 500]),
)
@example(by_s=1.6, is_back=False, resolution_ms=1000, one_way_ms=500)
@example(by_s=1.64, is_back=False, resolution_ms=1000, one_way_ms=500)
@settings(max_examples=25, deadline=None)
def test_a_clock_that_is_set_is_one_step_and_its_size_is_told(
    by_s: float, is_back: bool, resolution_ms: int, one_way_ms: int
) -> None:
    by_s = -by_s if is_back else by_s
    before = Clock(3.0, 20.0, resolution_ms, every_s=3.0, one_way_ms=one_way_ms, stamps_samples=True)
    state = after(before.looks(0.0, 300.0))
    assert state.steps == 0
    *_, (look, done) = folded(replace(before, offset_s=3.0 + by_s, seed=1).looks(300.0, 500.0), state)
    assert done.state.steps == 1
    assert done.state.published is not None
    assert done.state.published.bound is not None
    assert abs(done.state.published.bound.offset_s - 3.0 - by_s - 20e-6 * look.at_s) <= done.state.published.bound.spread_s
    found_s = float(done.state.step.removeprefix("the control's clock was set by ").removesuffix(" s"))
    assert found_s == pytest.approx(by_s, abs=1.1)


@pytest.mark.parametrize("by_s", [0.9, 1.0, 1.2, -1.0, 1.4])
@pytest.mark.parametrize("seed", range(4))
def test_a_small_step_is_never_counted_twice(by_s: float, seed: int) -> None:
    """It is about as large as what one document in whole seconds leaves open, so the window straddles it for a while."""
    before = Clock(3.0, 20.0, 1000, every_s=3.0, one_way_ms=500, stamps_samples=True, seed=seed)
    state = after(before.looks(0.0, 600.0))
    *_, (_, done) = folded(replace(before, offset_s=3.0 + by_s, seed=seed + 100).looks(600.0, 1200.0), state)
    assert done.state.steps <= 1
    if done.state.step:
        found_s = float(done.state.step.removeprefix("the control's clock was set by ").removesuffix(" s"))
        assert found_s == pytest.approx(by_s, abs=0.6)


def test_what_the_edge_itself_was_set_by_is_no_step_of_the_control() -> None:
    one = Clock(2.0, resolution_ms=1)
    state = after(one.looks(0.0, 200.0))
    later = replace(one, offset_s=2.0 - 3600.0, seed=1).looks(200.0, 400.0)  # the edge's wall clock is an hour further
    set_on = (
        look._replace(
            arrival_ms=look.arrival_ms + 3_600_000,
            reading=replace(
                look.reading, control_ms=look.reading.control_ms + 3_600_000, edge_ms=look.reading.edge_ms + 3_600_000
            ),
        )
        for look in later
        if look.reading is not None
    )
    told: list[object] = []
    health: dict[str, object] = {}
    for _, done in folded(set_on, state):
        told += [sample.value for sample in done.samples if sample.signal == OFFSET]
        health |= done.health
    assert health["health/clock_step"] == 1
    assert health["health/clock_alarm"] == "the edge's own clock was set by +3600.000 s"
    assert told == [pytest.approx(2.0 - 3600.0, abs=0.05)] * len(told)
    assert told


def test_a_drift_past_a_second_is_an_alarm_and_its_rate_is_known_by_then() -> None:
    seen: list[tuple[float, str, object]] = []
    one = Clock(5.0, 90.0, 1000, every_s=20.0)
    for look, done in folded(one.looks(0.0, 4 * 3600.0)):
        if done.health:
            seen.append((look.at_s, str(done.health["health/clock_alarm"]), done.health["health/clock_drift_ppm"]))
    first_s, words, ppm = next(entry for entry in seen if entry[1])
    assert 1.0 / 90e-6 * 0.85 < first_s < 1.0 / 90e-6 * 1.25
    assert words.startswith("the control's clock has drifted by +1.")
    assert ppm == pytest.approx(90.0, abs=15.0)
    assert seen[-1][2] == pytest.approx(90.0, abs=5.0)
    assert all(words for at_s, words, _ in seen if at_s > first_s + 600.0)


def test_a_clock_that_runs_at_another_rate_has_no_offset() -> None:
    """A recording that is played ten times as fast, for instance."""
    one = Clock(0.0, 9e6, every_s=1.0, one_way_ms=500, stamps_samples=True)
    told = [(look.at_s, values(done.samples)[OFFSET]) for look, done in folded(one.looks(0.0, 900.0)) if done.samples]
    assert told[-1][1] is None
    assert told[-1][0] < 60.0, "no flapping"


def test_samples_that_carry_the_edges_time_say_so_and_their_stamps_prove_nothing() -> None:
    one = Clock(-77.0, resolution_ms=1)
    looks = (look._replace(newest_ms=round(look.arrival_ms)) for look in one.looks(0.0, 300.0))
    done = [done for _, done in folded(looks)]
    told = [values(one.samples) for one in done if one.samples]
    assert {str(look[STAMPED_BY]) for look in told} == {"edge"}
    assert told[-1][OFFSET] == pytest.approx(-77.0, abs=0.05)
    assert done[-1].state.published is not None
    assert done[-1].state.published.method == "readings of the clock"


@pytest.mark.parametrize("stamps_ahead_s", [40.0, -40.0])
def test_stamps_of_another_clock_than_the_one_that_is_read_are_found_out(stamps_ahead_s: float) -> None:
    """An agent on a server whose adapter, on the control, has a clock of its own: the stamps are what others go by."""
    one = Clock(1.0, every_s=1.0, one_way_ms=500, stamps_samples=True)
    looks = (
        look._replace(newest_ms=look.newest_ms + round(stamps_ahead_s * 1000))
        for look in one.looks(0.0, 200.0)
        if look.newest_ms is not None
    )
    health, state = last_health(looks)
    assert health["health/clock_alarm"] == ""
    assert state.published is not None
    assert state.published.bound is not None
    assert abs(state.published.bound.offset_s - 1.0 - stamps_ahead_s) <= state.published.bound.spread_s
    assert state.published.method == "stamps of samples; the clock that is read is another"


def test_a_step_of_the_clock_that_stamps_is_found_where_another_one_is_read() -> None:
    one = Clock(1.0, every_s=1.0, one_way_ms=500, stamps_samples=True)

    def stamped(looks: Iterator[Heard], ahead_ms: int) -> Iterator[Heard]:
        return (look._replace(newest_ms=look.newest_ms + ahead_ms) for look in looks if look.newest_ms is not None)

    state = after(stamped(one.looks(0.0, 200.0), 40_000))
    health, _ = last_health(stamped(one.looks(200.0, 400.0), 3_640_000), state)
    assert health["health/clock_step"] == 1
    assert str(health["health/clock_alarm"]).startswith("the control's clock was set by +3600.")


def test_one_stamp_from_the_future_moves_nothing() -> None:
    one = Clock(0.0, every_s=1.0, one_way_ms=500, stamps_samples=True)
    looks = list(one.looks(0.0, 200.0))
    looks[100] = looks[100]._replace(newest_ms=round((T0_S + 10**9) * 1000))
    plain, odd = after(one.looks(0.0, 200.0)), after(iter(looks))
    assert odd.steps == 0
    assert odd.published is not None
    assert plain.published is not None
    assert odd.published.bound == plain.published.bound


def test_a_stall_of_the_network_is_no_step() -> None:
    one = Clock(0.5, every_s=0.5, one_way_ms=500, stamps_samples=True)
    state = after(one.looks(0.0, 100.0))
    late = (
        look._replace(at_s=max(look.at_s, 125.0), arrival_ms=max(look.arrival_ms, (T0_S + 125.0) * 1000))
        for look in replace(one, seed=2).looks(100.0, 300.0)
    )
    for _, done in folded(late, state):
        assert done.state.steps == 0
        assert done.state.published is not None
        assert done.state.published.bound is not None


def test_stamps_of_a_backlog_or_of_a_state_as_found_say_nothing_of_latency() -> None:
    old = EdgeSample("spindle_rpm", 1.0, 5, is_baseline=True)
    assert heard(SampleSet((old,), newest_ms=5, received=1), 1.0, 9.0).newest_ms is None
    assert heard(SampleSet(newest_ms=5, backlog=3), 1.0, 9.0).newest_ms is None
    assert heard(SampleSet((replace(old, is_baseline=False),), newest_ms=5, received=1), 1.0, 9.0).newest_ms == 5


def test_an_hour_without_a_reading_makes_a_null_with_the_reason() -> None:
    state = after(Clock(1.0).looks(0.0, 100.0))
    *_, (_, done) = folded((Heard(at_s, (T0_S + at_s) * 1000) for at_s in (3000.0, 3690.0, 3720.0)), state)
    assert done.samples[0].value is None
    assert done.samples[0].reason == clock.OUTDATED


def test_nothing_is_published_while_nothing_changes() -> None:
    one = Clock(1.0, 5.0, resolution_ms=1)
    news = sum(bool(done.samples) for _, done in folded(one.looks(0.0, 3600.0)))
    assert 1 <= news <= 12


def test_a_state_survives_json_and_the_fold_goes_on_as_if_nothing_had_been() -> None:
    one, codec = Clock(1.0, 50.0, every_s=1.0, one_way_ms=500, stamps_samples=True), TypeAdapter(State)
    state = after(one.looks(0.0, 200.0))
    kept = codec.validate_json(codec.dump_json(state))
    assert kept == state
    assert after(one.looks(200.0, 300.0), kept) == after(one.looks(200.0, 300.0), state)


def test_what_is_published_is_declared() -> None:
    assert [signal(name).name for name in clock.SIGNALS] == list(clock.SIGNALS)
    *_, (_, done) = folded(Clock().looks(0.0, 100.0))
    assert set(done.health) == {spec.name for spec in clock.HEALTH}
    assert all(isinstance(spec, MetricSpec) for spec in clock.HEALTH)
