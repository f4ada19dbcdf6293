"""The reorder window of a host application (5.9)."""

import pytest

from sparkplug.actions import Publish
from sparkplug.host_session import EventKind
from tests.sparkplug.conformance.life import EdgeLife, HostLife, Sent, change, new_host_life


def _three(host: HostLife, edge: EdgeLife) -> tuple[Sent, Sent, Sent]:
    """A host that knows the births, and three messages that follow."""
    host.connect()
    births = edge.rebirth()
    host.now_ms = edge.now_ms
    host.receive(*births)
    first, second, third = (edge.publish("okuma", change("tool_number", n, edge.now_ms))[0] for n in (1, 2, 3))
    return first, second, third


def _requests(host: HostLife) -> list[Publish]:
    return [action for action in host.take() if isinstance(action, Publish)]


@pytest.mark.tck("tck-id-operational-behavior-host-reordering-param")
@pytest.mark.parametrize("timeout_ms", [0, 500, 2000, 10_000])
def test_the_timeout_is_a_parameter(edge: EdgeLife, timeout_ms: int) -> None:
    host = new_host_life(reorder_timeout_ms=timeout_ms)
    first, _, third = _three(host, edge)
    host.receive(first, third)
    if timeout_ms:
        host.wait(timeout_ms - 1)
        host.wait(0)
        assert _requests(host) == []
        host.wait(1)
    else:
        host.wait(0)
    host.wait(1000)
    assert len(_requests(host)) == 1


@pytest.mark.tck("tck-id-operational-behavior-host-reordering-start")
def test_a_message_out_of_order_starts_the_timer_and_is_held(host: HostLife, edge: EdgeLife) -> None:
    first, _, third = _three(host, edge)
    host.wait(60_000)
    assert [event.kind for event in host.receive(first)] == [EventKind.DATA]
    assert host.receive(third) == []
    assert host.wait(1999) == []
    events = host.wait(1)
    assert [event.kind for event in events] == [EventKind.HOLE, EventKind.DATA]
    assert events[1].readings[0].value == 3


@pytest.mark.tck("tck-id-operational-behavior-host-reordering-success")
@pytest.mark.parametrize("order", [(1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0), (0, 2, 1)])
def test_messages_that_come_within_the_timeout_are_put_in_order_and_the_timer_ends(
    host: HostLife, edge: EdgeLife, order: tuple[int, ...]
) -> None:
    messages = _three(host, edge)
    events = []
    for index in order:
        events += host.receive(messages[index])
        events += host.wait(600)
    assert [event.readings[0].value for event in events] == [1, 2, 3]
    assert host.wait(60_000) == []
    assert _requests(host) == []


@pytest.mark.tck("tck-id-operational-behavior-host-reordering-start", "tck-id-operational-behavior-host-reordering-success")
def test_the_next_message_out_of_order_has_the_whole_timeout_again(host: HostLife, edge: EdgeLife) -> None:
    first, second, third = _three(host, edge)
    host.receive(second)
    host.wait(1500)
    host.receive(first, third)
    _, late = (edge.publish("okuma", change("tool_number", n, edge.now_ms))[0] for n in (4, 5))
    host.wait(1500)
    assert host.receive(late) == []
    assert host.wait(1999) == []
    assert [event.kind for event in host.wait(1)] == [EventKind.HOLE, EventKind.DATA]
