"""How often births are repeated and asked for."""

from __future__ import annotations

from itertools import pairwise
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from sparkplug.metric import NodeId
from sparkplug.rebirth import RebirthAnswer, RebirthRequests

NODE = NodeId("cnc", "edge")
STEPS = st.lists(st.tuples(st.integers(0, 3000), st.booleans()), max_size=60)


def test_the_first_request_is_answered_at_once_and_the_next_at_the_end_of_the_window() -> None:
    answer = RebirthAnswer(1000, at_once_max=1)
    assert answer.request(5000)
    assert not answer.request(5001)
    assert not answer.request(5999)
    assert not answer.due(5999)
    assert answer.due(6000)
    assert not answer.due(6001)
    assert not answer.request(6500)
    assert answer.due(7000)


def test_a_few_requests_are_answered_at_once_and_the_rest_together() -> None:
    answer = RebirthAnswer(1000, at_once_max=4)
    assert [answer.request(5000) for _ in range(9)] == [True] * 4 + [False] * 5
    assert answer.is_due
    assert [answer.due(ms) for ms in (5999, 6000, 9000)] == [False, True, False]


def test_a_request_after_the_window_is_answered_at_once() -> None:
    answer = RebirthAnswer(1000)
    assert answer.request(0) and answer.request(1000)


def test_a_clock_that_was_set_back_does_not_silence_the_node() -> None:
    answer = RebirthAnswer(1000)
    assert answer.request(1_000_000)
    assert answer.request(10)


@given(STEPS)
def test_two_births_are_a_window_apart_and_no_request_is_forgotten(steps: list[tuple[int, bool]]) -> None:
    answer, now_ms, births, asked_ms = RebirthAnswer(1000, at_once_max=1), 0, [], None
    for pause_ms, asks in steps:
        now_ms += pause_ms
        born = answer.due(now_ms)
        if asks:
            asked_ms = now_ms
            born = answer.request(now_ms) or born
        if born:
            births.append(now_ms)
            asked_ms = None
        assert asked_ms is None or now_ms - asked_ms <= 1000
    assert all(later - earlier >= 1000 for earlier, later in pairwise(births))


@given(st.integers(0, 1000))
def test_the_first_request_waits_up_to_the_spread(seed: int) -> None:
    requests = RebirthRequests(Random(seed), spread_ms=300)
    requests.want(NODE, 0)
    due_ms = next(ms for ms in range(1000) if requests.due(ms))
    assert 0 <= due_ms <= 300


def test_a_birth_that_comes_meanwhile_makes_the_request_needless() -> None:
    requests = RebirthRequests(Random(0))
    requests.want(NODE, 0)
    requests.born(NODE)
    assert requests.due(1_000_000) == []


def test_a_silent_node_is_asked_ever_more_seldom_and_then_left_alone() -> None:
    requests = RebirthRequests(Random(0), spread_ms=0, interval_ms_min=5000, interval_ms_max=60_000, attempts_max=8)
    requests.want(NODE, 0)
    asked = [second for second in range(0, 2000) if requests.due(1000 * second)]
    assert asked == [0, 5, 15, 35, 75, 135, 195, 255]


def test_a_node_that_says_something_again_is_asked_again() -> None:
    requests = RebirthRequests(Random(0), spread_ms=0, attempts_max=2)
    requests.want(NODE, 0)
    assert [second for second in range(100) if requests.due(1000 * second)] == [0, 5]
    requests.want(NODE, 200_000)
    assert requests.due(200_000) == [NODE]


@given(STEPS, st.integers(0, 100))
def test_no_node_is_asked_twice_within_the_shortest_interval(steps: list[tuple[int, bool]], seed: int) -> None:
    requests, now_ms, asked = RebirthRequests(Random(seed), interval_ms_min=5000), 0, []
    for pause_ms, wants in steps:
        now_ms += pause_ms
        if wants:
            requests.want(NODE, now_ms)
        else:
            requests.born(NODE)
        asked += [now_ms for _ in requests.due(now_ms)]
    assert all(later - earlier >= 5000 for earlier, later in pairwise(asked))


def test_a_storm_of_hosts_costs_a_node_few_births() -> None:
    hosts = [RebirthRequests(Random(seed)) for seed in range(50)]
    answer, births, requests = RebirthAnswer(1000), 0, 0
    for host in hosts:
        host.want(NODE, 0)
    for now_ms in range(0, 20_000, 10):
        born = answer.due(now_ms)
        for host in hosts:
            for _ in host.due(now_ms):
                requests += 1
                born = answer.request(now_ms) or born
        if born:
            births += 1
            for host in hosts:
                host.born(NODE)
    assert (births, requests) == (1, 1)


def test_a_thousand_nodes_are_asked_once_each_by_a_host_that_starts_again() -> None:
    host, nodes = RebirthRequests(Random(0)), [NodeId("cnc", f"edge-{i}") for i in range(1000)]
    asked: list[NodeId] = []
    for node in nodes:
        host.want(node, 0)
    for now_ms in range(0, 5000, 10):
        for node in host.due(now_ms):
            asked.append(node)
            host.born(node)
    assert sorted(asked) == sorted(nodes)
