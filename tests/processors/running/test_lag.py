"""The lag of a process: what waits is seen in seconds that are right; a wrong clock or a late edge is no lag."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.running.lag import NODES_MAX, STANDS_STILL_S, Lag
from tests.depth import examples

STAMP_S = 1_795_000_000.0  # what the edges' clocks show when ours shows 0
EDGES = tuple(f"edge-{number}" for number in range(5))
Clock = Callable[[str, float], float]


def right(_edge: str, sent_s: float) -> float:
    return STAMP_S + sent_s


class Process:
    """A process with so many edges; each message waits for `waits_s` before it is folded."""

    def __init__(self, edges: tuple[str, ...] = EDGES, clock: Clock = right) -> None:
        self.lag = Lag(0.0, STAMP_S, 0.0)
        self.now_s = self.cpu_s = 0.0
        self.edges, self.clock = edges, clock

    def second(self, waits_s: float = 0.0, late: dict[str, float] | None = None, busy: float = 1.0) -> float:
        """One second of messages; the lag that is reported."""
        for _ in range(10):
            self.now_s += 0.1
            for edge in self.edges:
                sent_s = self.now_s - waits_s - 0.02 - (late or {}).get(edge, 0.0)
                self.lag.folded(edge, round(1000 * self.clock(edge, sent_s)), self.now_s)
            self.lag.published(self.now_s)
        self.cpu_s += busy
        self.lag.report(self.now_s, STAMP_S + self.now_s, self.cpu_s)
        return self.lag.folded_s


def fall_behind(process: Process, seconds: int, rate: float = 0.5) -> float:
    """Fall behind by `rate` seconds a second; the last lag."""
    return [process.second(rate * second) for second in range(1, seconds + 1)][-1]


def test_a_process_in_time_has_no_lag() -> None:
    process = Process()
    assert max(process.second(busy=0.5) for _ in range(20)) == pytest.approx(0.0, abs=0.03)
    assert process.lag.busy_pct == pytest.approx(50.0)
    assert process.lag.published_s == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("rate", [0.05, 0.3, 0.8])
def test_what_waits_is_seen_in_seconds(rate: float) -> None:
    process = Process()
    process.second()
    for second in range(1, 120):
        assert process.second(rate * second) == pytest.approx(rate * second, abs=0.15)
    assert process.second() == pytest.approx(0.0, abs=0.03)


def test_a_lag_that_stays_is_seen_as_long_as_it_stays() -> None:
    process = Process()
    process.second()
    fall_behind(process, 36)
    for _ in range(100 * round(STANDS_STILL_S)):
        assert process.second(18.0) == pytest.approx(18.0, abs=0.15)


@pytest.mark.parametrize("rate", [0.3, 0.9])
def test_a_process_that_is_behind_from_its_first_message_on_is_seen_all_the_same(rate: float) -> None:
    process = Process()
    for second in range(5, 60):
        lag_s = process.second(rate * second)
    assert lag_s == pytest.approx(rate * 59, abs=0.15)


def test_a_storm_at_the_start_leaves_nothing_behind() -> None:
    process = Process()
    for waits_s in (2.0, 5.0, 8.0, 4.0, 0.0):
        process.second(waits_s)
    assert process.second() < 0.1
    assert fall_behind(process, 20) == pytest.approx(10.0, abs=0.15)


@pytest.mark.parametrize("offset_s", [-3600.0, -61.0, -30.0, -6.0, 6.0, 3600.0])
@pytest.mark.parametrize("edges", [EDGES, EDGES[:1]])
def test_edges_whose_clocks_are_wrong_are_no_lag_for_long(edges: tuple[str, ...], offset_s: float) -> None:
    process = Process(edges, lambda _edge, sent_s: STAMP_S + sent_s + offset_s)
    lags_s = [process.second(busy=0.8) for _ in range(300)]
    assert sum(lag_s >= 5.0 for lag_s in lags_s) <= STANDS_STILL_S
    assert max(lags_s[15:]) < 0.1


def test_an_edge_that_is_born_while_the_process_is_behind_is_as_late_as_the_others() -> None:
    process = Process(edges=EDGES[:1])
    process.second()
    fall_behind(process, 40)
    process.edges = EDGES  # four that are new, against one that is known
    for waits_s in (20.5, 21.0, 21.5):
        assert process.second(waits_s) == pytest.approx(waits_s, abs=1.1)


@pytest.mark.parametrize("edges", [EDGES, EDGES[:1]])
@pytest.mark.parametrize("step_s", [-3600.0, -10.0, -0.5, 10.0, 3600.0])
def test_a_clock_that_is_set_is_no_lag(edges: tuple[str, ...], step_s: float) -> None:
    process = Process(edges, lambda _edge, sent_s: STAMP_S + sent_s + (step_s if sent_s > 3.0 else 0.0))
    assert max(process.second() for _ in range(60)) <= 0.53


def test_a_clock_that_is_set_while_the_process_is_behind_hides_nothing() -> None:
    process = Process(clock=lambda _edge, sent_s: STAMP_S + sent_s - (100.0 if sent_s > 15.0 else 0.0))
    process.second()
    assert fall_behind(process, 60) == pytest.approx(30.0, abs=0.61)


def test_one_edge_that_sends_late_or_is_slewed_is_no_lag() -> None:
    process = Process()
    assert max(process.second(0.0, {EDGES[0]: 0.5 * second}) for second in range(600)) < 0.03


@pytest.mark.parametrize("drift", [-5e-5, 5e-5])
def test_a_clock_that_drifts_is_no_lag(drift: float) -> None:
    process = Process(EDGES[:1], lambda _edge, sent_s: STAMP_S + sent_s * (1.0 + drift))
    assert max(process.second() for _ in range(5000)) < 0.03


def test_edges_that_are_slewed_together_are_forgiven_where_the_process_has_time_to_spare() -> None:
    process = Process(clock=lambda _edge, sent_s: STAMP_S + sent_s - min(max(sent_s - 10.0, 0.0) * 0.08, 10.0))
    lags_s = [process.second(busy=0.3) for _ in range(600)]
    assert max(lags_s) == pytest.approx(10.0, abs=0.3)
    assert lags_s[-1] == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("offset_s", [-1e9, 86_400.0])
@pytest.mark.parametrize("speed", [1.0, 60.0])
def test_a_recording_of_any_time_that_begins_again_and_again_is_no_lag(offset_s: float, speed: float) -> None:
    process = Process(clock=lambda _edge, sent_s: STAMP_S + offset_s + speed * (sent_s % 7.0))
    assert max(process.second() for _ in range(30)) < 0.15


def test_wrong_clocks_do_not_hide_a_lag() -> None:
    process = Process(clock=lambda edge, sent_s: STAMP_S + sent_s + 1000.0 * EDGES.index(edge))
    process.second()
    assert fall_behind(process, 36) == pytest.approx(18.0, abs=0.15)


def test_a_second_without_a_message_is_no_lag_and_hides_none() -> None:
    process = Process()
    fall_behind(process, 36)
    edges, process.edges = process.edges, ()
    assert process.second() == 0.0
    process.edges = edges
    assert process.second(18.0) == pytest.approx(18.0, abs=0.15)


def test_results_that_are_held_are_later_than_what_was_folded() -> None:
    lag = Lag(0.0, STAMP_S, 0.0)
    lag.folded("edge-1", 1000, 0.1)
    lag.published(0.4)
    lag.folded("edge-1", 1500, 0.6)
    lag.report(1.0, STAMP_S + 1.0, 0.0)
    assert lag.published_s == pytest.approx(lag.folded_s + 0.4)


def test_silence_is_no_lag_and_nodes_are_bounded() -> None:
    lag = Lag(0.0, STAMP_S, 0.0)
    lag.report(100.0, STAMP_S + 100.0, 0.0)
    assert (lag.folded_s, lag.published_s, lag.busy_pct) == (0.0, 0.0, 0.0)
    for number in range(NODES_MAX + 10):
        lag.folded(f"edge-{number}", 0, 100.0)
    assert len(lag._ages_s) == NODES_MAX


@given(waits_s=st.lists(st.floats(0.0, 1000.0), min_size=1, max_size=30), offset_s=st.floats(-1e8, 1e8))
@settings(max_examples=examples(50, 30), deadline=None)
def test_a_lag_is_never_negative_and_never_grows_faster_than_time(waits_s: list[float], offset_s: float) -> None:
    process = Process(clock=lambda _edge, sent_s: STAMP_S + sent_s + offset_s)
    before_s = 0.0
    for wait_s in waits_s:
        now_s = process.second(wait_s)
        assert 0.0 <= now_s <= before_s + 1.0 + 1e-6
        before_s = now_s
