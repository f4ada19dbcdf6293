"""The rate of a node: what is beyond it is dropped at the door, said, and costs no other node anything."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug import host as host_module
from sparkplug.actions import Publish
from sparkplug.admission.limits import Limits
from sparkplug.admission.rates import Rates
from sparkplug.admission.refusal import Refusal
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId

NODE, OTHER, OWN = NodeId("cnc", "edge-a"), NodeId("cnc", "edge-b"), NodeId("cnc", "twin-thermal")
LIMITS = Limits(messages_a_second_max=10, messages_at_once_max=50, births_a_second_max=2, births_at_once_max=5)
DATA, BIRTH = "spBv1.0/cnc/DDATA/edge-a/mill", "spBv1.0/cnc/DBIRTH/edge-a/mill"


def rates() -> Rates:
    return Rates(LIMITS, lambda node: node == OWN)


def test_so_many_at_once_then_a_second_of_nothing_and_so_many_a_second() -> None:
    door = rates()
    admitted = [step for step in range(4000) if door.admits(DATA, 10, step / 1000)]
    assert admitted[:50] == list(range(50))
    seconds = [sum(1000 * s <= step < 1000 * (s + 1) for step in admitted) for s in range(1, 4)]
    assert all(count <= 11 for count in seconds), seconds
    assert sum(seconds) >= 20
    (excess,) = door.excess()
    assert excess == (NODE, 4000 - len(admitted), 4000 - len(admitted))
    assert door.excess() == []


def test_births_have_an_allowance_of_their_own() -> None:
    door = rates()
    assert not all(door.admits(DATA, 10, 0.0) for _ in range(51))
    assert door.overrun == (NODE, False)
    door.overrun = None
    assert [door.admits(BIRTH, 10, 0.0) for _ in range(6)] == [True] * 5 + [False]
    assert door.overrun == (NODE, True)


def test_bytes_count_as_well() -> None:
    door = Rates(Limits(data_bytes_a_second_max=1000, data_bytes_at_once_max=1000), lambda _: False)
    assert [door.admits(DATA, 600, second) for second in (0.0, 0.1, 0.2, 1.2)] == [True, False, False, True]


def test_a_slow_sender_never_reaches_the_end_of_its_allowance() -> None:
    door = rates()
    assert all(door.admits(DATA, 10, step / 9) for step in range(10_000))


def test_other_nodes_trusted_ones_and_plain_messages_are_free() -> None:
    door = rates()
    for _ in range(1000):
        door.admits(DATA, 10, 0.0)
        assert door.admits("spBv1.0/cnc/DDATA/twin-thermal/mill", 10, 0.0)
        assert door.admits("cnc/jobs/request", 10, 0.0)
    assert door.admits("spBv1.0/cnc/DDATA/edge-b/mill", 10, 0.0)


@given(st.lists(st.tuples(st.floats(0.0, 0.5), st.integers(0, 400), st.booleans()), max_size=300))
def test_no_second_brings_more_than_the_allowance(sent: list[tuple[float, int, bool]]) -> None:
    door, now_s = rates(), 0.0
    admitted, dropped = [], 0
    for pause_s, size, is_birth in sent:
        now_s += pause_s
        if not door.admits(BIRTH if is_birth else DATA, size, now_s):
            dropped += 1
        elif not is_birth:
            admitted.append(now_s)
    assert sum(excess.messages for excess in door.excess()) == dropped
    for start_s in admitted:
        within = sum(start_s <= at_s < start_s + 1.0 for at_s in admitted)
        assert within <= LIMITS.messages_at_once_max + LIMITS.messages_a_second_max


def life(node: NodeId, values: int, bd_seq: int = 0) -> list[Publish]:
    session = EdgeNodeSession(node)
    session.declare_device("mill", [MetricSpec("load", DataType.DOUBLE)], 1)
    session.connecting(bd_seq, 1)
    actions = session.connected(1)
    for number in range(values):
        actions += session.publish("mill", [Change("load", float(number), 2 + number)], 2 + number)
    return [action for action in actions if isinstance(action, Publish)]


class Door:
    """An application that nobody has connected, and the clock that it looks at."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = time.monotonic()
        monkeypatch.setattr(host_module.time, "monotonic", lambda: self.now_s)
        self.host = HostApplication(BrokerAddress(), "test", limits=LIMITS)

    def hear(self, messages: list[Publish]) -> list[HostEvent]:
        for message in messages:
            self.host._message(message.topic, message.payload)
        return self.host.poll(0.0)


def test_a_flood_is_dropped_before_the_inbox_and_said_once_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    door = Door(monkeypatch)
    birth, device, *data = life(NODE, 200)
    events = door.hear([birth, device, *data[:-1], *life(OTHER, 30)])
    door.now_s += 1.1
    events += door.hear([])
    of_node = [event for event in events if event.node == NODE]
    assert sum(event.kind is EventKind.DATA for event in of_node) == 50
    assert sum(event.kind is EventKind.DATA for event in events if event.node == OTHER) == 30
    assert [event.kind for event in of_node].count(EventKind.HOLE) == 1
    (refused,) = [event for event in of_node if event.kind is EventKind.REFUSED]
    assert (refused.refusal, refused.refused, refused.device) == (Refusal.RATE, 149, None)
    assert [event.kind for event in door.hear(data[-1:])] == [EventKind.DATA], "its number begins a new count"
    assert door.host.counts.get("lost", 0) == 0
    assert door.host.quarantine[0].times == 149


def test_births_beyond_the_rate_void_what_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Data would be read by the birth before the one that was dropped."""
    door = Door(monkeypatch)
    birth, device, *data = life(NODE, 1)
    events = door.hear([birth, device, *[device] * 5, *data])
    kinds = [event.kind for event in events if event.kind not in (EventKind.HOLE, EventKind.REFUSED)]
    assert kinds[-2:] == [EventKind.DEATH, EventKind.DEATH]
    assert EventKind.DATA not in kinds
    door.now_s += 5.0
    assert [event.kind for event in door.hear(life(NODE, 1, bd_seq=1))][-3:] == [EventKind.BIRTH, EventKind.BIRTH, EventKind.DATA]


def test_a_plain_message_is_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    host = HostApplication(BrokerAddress(), "test", limits=Limits(plain_bytes_max=10))
    host._message("cnc/jobs/request", b"x" * 11)
    host._message("cnc/jobs/request", b"x" * 10)
    assert [len(event.payload) for event in host.poll(0.0)] == [10]
    assert host.dropped == 1
