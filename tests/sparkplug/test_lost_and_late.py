"""What a host makes of messages that are lost, late, repeated or unreadable: the cases that the model once found, by name."""

from __future__ import annotations

import pytest

from sparkplug.actions import Publish
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.metric import Change, MetricSpec
from sparkplug.node_picture import NodePicture
from sparkplug.quality import Quality
from sparkplug.schema import PayloadMessage
from sparkplug.values import Metric, Payload
from sparkplug.watched import DOUBT_MS, DOUBTS_MAX
from tests.sparkplug.simulated_edge import Edge
from tests.sparkplug.world import World

SPEC = (MetricSpec("load", DataType.DOUBLE),)


@pytest.fixture
def world() -> World:
    """A host and one edge node with one device, born."""
    world = World(1)
    world.declare(world.edges[0], "okuma", SPEC)
    world.connect_host()
    world.connect_edge(world.edges[0])
    world.quiesce()
    return world


@pytest.fixture
def edge(world: World) -> Edge:
    """Its edge node."""
    return world.edges[0]


def picture(world: World) -> NodePicture:
    """Return what the host knows of the node."""
    known = world.host.picture(world.edges[0].node)
    assert known is not None
    return known


def rebirth(world: World, edge: Edge) -> None:
    """Another host asks for the births, and gets them."""
    payload = encode(Payload(world.now_ms, (Metric("Node Control/Rebirth", True, DataType.BOOLEAN, world.now_ms),)))
    world.command(edge, f"spBv1.0/cnc/NCMD/{edge.node.node}", payload)
    world.deliver_to_edge(edge)


def test_the_copy_of_an_older_birth_does_not_bring_a_dead_node_back(world: World, edge: Edge) -> None:
    for _ in range(2):
        world.restart_edge(edge, remembers_bd_seq=True)
        world.connect_edge(edge)
    world.cut_edge(edge)
    older = world.flight[0]
    assert older.verb == "NBIRTH"
    while world.late_wills:
        world.deliver_will(0)
    world.flight.append(older)
    world.quiesce()
    assert not picture(world).online
    world.check_quiet()


def test_a_rebirth_that_was_lost_is_asked_for_when_the_numbers_begin_again(world: World, edge: Edge) -> None:
    for _ in range(3):
        world.publish(edge, None, [Change("beat", 1, world.now_ms)])
    world.deliver(3)
    world.now_ms += 5000
    rebirth(world, edge)
    world.lose(0, len(world.flight))
    world.declare(edge, "okuma", (MetricSpec("load", DataType.STRING),))
    world.lose(0, len(world.flight))
    world.quiesce()
    world.check_quiet()


def test_a_peer_that_counts_sloppily_is_not_made_to_repeat_its_birth_for_ever(world: World, edge: Edge) -> None:
    asked = 0
    for second in range(DOUBT_MS // 1000 - 200):
        world.publish(edge, None, [Change("beat", second, world.now_ms)])
        message = PayloadMessage.FromString(world.flight[-1].publish.payload)
        message.seq, message.timestamp = 1, world.now_ms  # whatever it counted: always the same number
        world.flight[-1] = world.flight[-1]._replace(publish=Publish(world.flight[-1].publish.topic, message.SerializeToString()))
        world.deliver(1)
        world.wait(1000)
        asked += len(edge.inbox)
        edge.inbox.clear()
    assert 1 <= asked <= 2 * DOUBTS_MAX * 8
    assert picture(world).own.readings["beat"].value == second


def test_a_birth_that_cannot_be_read_makes_everything_stale(world: World, edge: Edge) -> None:
    world.publish(edge, "okuma", [Change("load", 1.0, world.now_ms)])
    world.deliver(1)
    world.now_ms += 5000
    rebirth(world, edge)
    broken = PayloadMessage.FromString(world.flight[0].publish.payload)
    broken.metrics.add(name="new", datatype=99)
    world.flight[0] = world.flight[0]._replace(publish=Publish(world.flight[0].publish.topic, broken.SerializeToString()))
    world.deliver(1)
    assert not picture(world).online
    qualities = {r.quality for _, owner in picture(world).owners() for r in owner.readings.values()}
    assert qualities == {Quality.STALE}
    world.check_always()
    world.quiesce()
    world.check_quiet()


def test_a_device_birth_that_cannot_be_read_makes_the_device_stale(world: World, edge: Edge) -> None:
    world.declare(edge, "okuma", (MetricSpec("load", DataType.INT32),))
    broken = PayloadMessage.FromString(world.flight[0].publish.payload)
    broken.metrics.add(name="new", datatype=99)
    world.flight[0] = world.flight[0]._replace(publish=Publish(world.flight[0].publish.topic, broken.SerializeToString()))
    world.deliver(1)
    assert picture(world).online and not picture(world).devices["okuma"].online
    world.check_always()
    world.publish(edge, "okuma", [Change("load", 1, world.now_ms)])
    world.quiesce()
    world.check_quiet()


def test_a_metric_that_is_not_of_its_declared_type_is_left_out_and_the_birth_asked_for(world: World, edge: Edge) -> None:
    world.publish(edge, None, [Change("lag", 1.0, world.now_ms), Change("beat", 9, world.now_ms)])
    message = PayloadMessage.FromString(world.flight[0].publish.payload)
    message.metrics[0].string_value = "of another type"
    world.flight[0] = world.flight[0]._replace(publish=Publish(world.flight[0].publish.topic, message.SerializeToString()))
    world.deliver(1)
    assert picture(world).own.readings["beat"].value == 9
    assert picture(world).own.readings["lag"].value is None
    world.check_always()
    world.quiesce()
    world.check_quiet()


@pytest.mark.parametrize("lost", [1, 5, 127, 128, 200, 239, 240, 255, 300])
def test_whatever_number_of_messages_is_lost_the_picture_is_right_again(world: World, edge: Edge, lost: int) -> None:
    world.publish(edge, "okuma", [Change("load", 50.0, world.now_ms)])
    for beat in range(lost - 1):
        world.publish(edge, None, [Change("beat", beat, world.now_ms)])
    world.lose(0, lost)
    world.quiesce()
    world.check_quiet()
