"""The lag of a process: what waits is seen in seconds that are right; a wrong clock or a late edge is no lag."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.running.lag import Lag
from tests.depth import examples

STAMP_S = 1_795_000_000.0  # what the edges' clocks show when ours shows 0
EDGES = tuple(f"edge-{number}" for number in range(5))
Clock = Callable[[str, float], float]


def right(_edge: str, sent_s: float) -> float:
    return STAMP_S + sent_s


class Process:
    """A process with so many edges; `waits_s` says how long each message waits before it is folded."""

    def __init__(self, edges: tuple[str, ...] = EDGES, clock: Clock = right) -> None:
        self.lag = Lag(0.0, 0.0)
        self.now_s = 0.0
        self.edges, self.clock = edges, clock

    def second(self, waits_s: float = 0.0, late: dict[str, float] | None = None, *, idle: bool | None = None) -> float:
        """One second of messages; the lag that is reported."""
        for _ in range(10):
            self.now_s += 0.1
            for edge in self.edges:
                sent_s = self.now_s - waits_s - 0.02 - (late or {}).get(edge, 0.0)
                self.lag.folded(edge, round(1000 * self.clock(edge, sent_s)), self.now_s)
            self.lag.published(self.now_s)
            if idle or (idle is None and waits_s == 0.0):
                self.lag.caught_up(self.now_s)
        self.lag.report(self.now_s, 0.5 * self.now_s)
        return self.lag.folded_s


def test_a_process_in_time_has_no_lag() -> None:
    process = Process()
    assert [process.second() for _ in range(5)] == [0.0] * 5
    assert process.lag.busy_pct == pytest.approx(50.0)
    assert process.lag.published_s == 0.0


@pytest.mark.parametrize("rate", [0.3, 0.8])
def test_what_waits_is_seen_in_seconds_wherever_it_waits(rate: float) -> None:
    process = Process()
    process.second()
    for second in range(1, 60):
        assert process.second(rate * second) == pytest.approx(rate * second, abs=0.11)
    assert process.second() == 0.0


def test_a_busy_process_that_never_waits_and_is_in_time_has_no_lag() -> None:
    process = Process()
    process.second()
    assert max(process.second(0.05, idle=False) for _ in range(600)) < 0.1


def test_an_edge_that_is_born_while_the_process_is_behind_is_as_late_as_the_others() -> None:
    process = Process(edges=EDGES[:1])
    process.second()
    for second in range(1, 20):
        process.second(float(second))
    process.edges = EDGES  # four that are new, against one that is known
    assert process.second(20.0) == pytest.approx(20.0, abs=1.1)
    assert process.second(20.5) == pytest.approx(20.5, abs=1.1)
    assert process.second(21.0) == pytest.approx(21.0, abs=1.1)


@pytest.mark.parametrize("edges", [EDGES, EDGES[:1]])
@pytest.mark.parametrize("step_s", [-3600.0, -10.0, 10.0, 3600.0])
def test_edges_whose_clocks_are_set_are_no_lag_of_a_process_that_is_caught_up(edges: tuple[str, ...], step_s: float) -> None:
    process = Process(edges, lambda _edge, sent_s: STAMP_S + sent_s + (step_s if sent_s > 3.0 else 0.0))
    assert max(process.second() for _ in range(10)) <= 1.0


def test_one_edge_that_sends_late_or_is_set_back_is_no_lag_even_of_a_busy_process() -> None:
    process = Process()
    process.second()
    assert max(process.second(0.05, {EDGES[0]: 300.0}, idle=False) for _ in range(60)) < 0.1


@pytest.mark.parametrize("offset_s", [-1e9, 86_400.0])
@pytest.mark.parametrize("speed", [0.5, 1.0, 60.0])
def test_a_recording_of_any_time_and_speed_is_no_lag(offset_s: float, speed: float) -> None:
    process = Process(clock=lambda _edge, sent_s: STAMP_S + offset_s + speed * sent_s)
    assert max(process.second() for _ in range(30)) <= 1.0


def test_wrong_clocks_do_not_hide_a_lag() -> None:
    process = Process(clock=lambda edge, sent_s: STAMP_S + sent_s + 1000.0 * EDGES.index(edge))
    process.second()
    assert process.second(8.0) == pytest.approx(1.0, abs=0.11)  # a second ago nothing waited, so it cannot be more
    assert process.second(8.0) == pytest.approx(2.0, abs=0.11)
    for _ in range(8):
        process.second(8.0)
    assert process.second(8.0) == pytest.approx(8.0, abs=0.11)


def test_results_that_are_held_are_later_than_what_was_folded() -> None:
    lag = Lag(0.0, 0.0)
    lag.folded("edge-1", 1000, 0.1)
    lag.published(0.4)
    lag.folded("edge-1", 1500, 0.6)
    lag.report(1.0, 0.0)
    assert lag.published_s == pytest.approx(lag.folded_s + 0.4)


def test_silence_is_no_lag() -> None:
    lag = Lag(0.0, 0.0)
    lag.report(100.0, 0.0)
    assert (lag.folded_s, lag.published_s, lag.busy_pct) == (0.0, 0.0, 0.0)


@given(
    waits_s=st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30),
    offsets_s=st.lists(st.floats(-1e8, 1e8), min_size=5, max_size=5),
)
@settings(max_examples=examples(50, 30), deadline=None)
def test_the_lag_is_never_more_than_the_time_since_nothing_waited(waits_s: list[float], offsets_s: list[float]) -> None:
    process = Process(clock=lambda edge, sent_s: STAMP_S + sent_s + offsets_s[EDGES.index(edge)])
    since_s = 0.0
    for wait_s in waits_s:
        since_s = 0.0 if wait_s == 0.0 else since_s + 1.0
        assert 0.0 <= process.second(wait_s) <= since_s + 1e-9
