"""Waiting events: whose turn it is, what is put together, and what is passed over."""

from collections import Counter
from random import Random

import pytest

from processors.description import Role
from processors.running import backlog as backlog_module
from processors.running.backlog import Backlog
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.processors.describing import message
from tests.processors.streams import birth, data, death, hole

FLOOD, QUIET = NodeId("cnc", "edge-flood"), NodeId("cnc", "edge-quiet")


def flood(at_s: float, value: float = 0.0) -> HostEvent:
    return data(at_s, node=FLOOD, device="flood", a=value, b=value)


def taken(backlog: Backlog, cost_s: float = 1e-3) -> list[HostEvent]:
    events = []
    while backlog:
        events.append(backlog.take())
        backlog.spent(cost_s)
    return events


def test_what_waits_of_one_sender_comes_in_its_order() -> None:
    backlog = Backlog()
    stream = [birth(0.0, a=1.0), data(1.0, a=2.0), hole(1.5), data(2.0, a=3.0), death(3.0)]
    for event in stream:
        assert backlog.put(event) == []
    assert taken(backlog) == stream
    assert not backlog


def test_a_sender_waits_for_one_event_of_each_other_sender() -> None:
    backlog = Backlog()
    for number in range(500):
        backlog.put(flood(number / 1000, float(number)))
    backlog.take()
    backlog.spent(0.001)
    quiet = data(1.0, node=QUIET, device="quiet", a=1.0)
    backlog.put(quiet)
    order = taken(backlog)
    assert order.index(quiet) <= 1


def test_time_is_shared_by_what_events_cost_and_not_by_their_number() -> None:
    backlog, spent = Backlog(), Counter[str]()
    for number in range(400):
        backlog.put(flood(number / 1000))
        backlog.put(data(number / 1000, node=QUIET, device="quiet", a=float(number), state=str(number)))
    for _ in range(300):
        event = backlog.take()
        cost_s = 0.010 if event.node == FLOOD else 0.001
        spent[event.node.node] += round(cost_s * 1000)
        backlog.spent(cost_s)
    assert spent["edge-flood"] == pytest.approx(spent["edge-quiet"], rel=0.1)


def test_data_beyond_a_share_are_put_together_and_what_is_passed_over_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "WORK_S_MAX", 0.01)  # 2,000 readings
    backlog = Backlog()
    passed_over = [old for number in range(10_000) for old in backlog.put(flood(number / 1000, float(number)))]
    left = taken(backlog)
    assert len(left) + len(passed_over) == 10_000
    assert left[-1].readings[0].value == 9_999.0
    assert 1990 <= sum(1 + len(event.readings) for event in left) <= 2003
    assert {event.node for event in passed_over} == {FLOOD}


def test_states_are_kept_while_values_are_put_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "WORK_S_MAX", 0.0)
    backlog = Backlog()
    passed_over = 0
    for number in range(10_000):
        passed_over += len(backlog.put(data(number / 1000, a=float(number), exec_state=str(number // 100))))
    left = taken(backlog)
    assert [event.readings[1].value for event in left[-90:]] == [str(state) for state in range(10, 100)]
    assert [event.readings[0].value for event in left[-90:]] == [state * 100.0 + 99.0 for state in range(10, 100)]
    assert len(left) + passed_over == 10_000


def test_a_line_is_bounded_whatever_it_holds_and_births_outlast_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "LINE_MAX", 100)
    backlog = Backlog()
    backlog.put(birth(0.0, a=1.0))
    passed_over = 0
    for number in range(1000):
        passed_over += len(backlog.put(data(number / 1000, exec_state=str(number))))
    line = next(iter(backlog._lines.values()))
    assert (line.size <= 100, len(line.items) < 2000) == (True, True)
    left = taken(backlog)
    assert left[0].kind is EventKind.BIRTH
    assert left[-1].readings[0].value == "999"
    assert len(left) + passed_over == 1001
    for number in range(1000):
        passed_over += len(backlog.put(birth(float(number), a=float(number))))
    assert [event.readings[0].value for event in taken(backlog)][-1] == 999.0


def test_all_together_they_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "READINGS_MAX", 1000)
    monkeypatch.setattr(backlog_module, "WORK_S_MAX", 0.0)
    backlog = Backlog()
    for number in range(5_000):
        backlog.put(data(number / 1000, node=NodeId("cnc", f"edge-{number % 10}"), exec_state=str(number)))
    assert backlog._size <= 1100


def test_machines_of_a_twin_node_have_lines_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "LINE_MAX", 100)
    backlog, rules = Backlog(), NodeId("cnc", "twin-rules")
    alarm = data(0.0, node=rules, device="quiet", **{"twin/rule_vibration": True})
    backlog.put(alarm)
    for number in range(1000):
        backlog.put(data(number / 1000, node=rules, device="flood", **{"twin/rule_vibration": bool(number % 2)}))
    assert alarm in taken(backlog)


def test_whatever_comes_and_goes_everything_is_taken_or_passed_over_once() -> None:
    chance, backlog, came, gone = Random(7), Backlog(), Counter[int](), Counter[int]()
    events: dict[int, HostEvent] = {}
    for number in range(20_000):
        node = NodeId("cnc", f"edge-{chance.randrange(3)}")
        kind = chance.randrange(20)
        one = birth(float(number), node=node, a=1.0) if kind == 0 else death(float(number), node=node)
        if kind > 1:
            one = data(float(number), node=node, a=float(number), exec_state=str(chance.randrange(2)))
        events[number] = one
        came[one.timestamp_ms] += 1
        for old in backlog.put(one):
            gone[old.timestamp_ms] += 1
        if chance.random() < 0.3 and backlog:
            gone[backlog.take().timestamp_ms] += 1
            backlog.spent(0.001)
    for one in taken(backlog):
        gone[one.timestamp_ms] += 1
    assert came == gone


def test_descriptions_wait_behind_the_data_of_their_machine_and_its_next_data_behind_them() -> None:
    backlog = Backlog()
    for number in range(200):
        backlog.put(flood(number / 1000))
    before, after = data(1.0, a=1.0), data(2.0, a=2.0)
    live, challenger, of_nobody = message(1.0), message(2.0, Role.CHALLENGER), message(1.0, machine="nobody")
    for event in (before, live, challenger, after, of_nobody):
        backlog.put(event)
    order = taken(backlog)
    assert [event for event in order if event in (before, live, challenger, after)] == [before, live, challenger, after]
    assert of_nobody in order


def test_data_are_never_put_together_across_a_description(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backlog_module, "WORK_S_MAX", 0.0)
    backlog = Backlog()
    for number in range(200):
        backlog.put(flood(number / 1000, float(number)))
    backlog.put(message(1.0, machine="flood"))
    backlog.put(flood(900.0))
    backlog.put(flood(901.0))
    *_, described, last = taken(backlog)
    assert described.kind is EventKind.PLAIN
    assert last.newest_ms == flood(901.0).newest_ms
