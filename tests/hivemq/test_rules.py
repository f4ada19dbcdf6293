"""Who may publish and read what on HiveMQ with the files of deploy/hivemq; the table is that of Mosquitto.

HiveMQ differs in three ways: it disconnects who publishes what is forbidden; it refuses a subscription that reaches too far,
where Mosquitto grants it and sends nothing; and its rules know of retained messages.
"""

import time
from dataclasses import replace

import pytest

from processors.discovery import discover
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import MetricSpec, NodeId
from tests.deploy.permissions import ALL, DEVICE_VERBS, MAY_READ, MAY_WRITE, NODE_VERBS, barrier
from tests.deploy.wire_client import PATIENCE_S, WireClient
from tests.hivemq.hivemq import DEPLOY, USERS, HiveMQ

pytestmark = pytest.mark.broker
TOPICS = [topic for topic in ALL if not topic.startswith("$")]


@pytest.mark.parametrize("who", ["edge-okuma", "processors", "viewer", "operator"])
def test_each_publishes_what_it_may_and_nothing_else(hivemq: HiveMQ, who: str) -> None:
    """HiveMQ disconnects at the first publish that is forbidden: one connection for each."""
    with WireClient(hivemq.open) as ear:
        ear.subscribe("#")
        with WireClient(hivemq.of(who)) as client:
            client.settle(*(client.publish(topic, who.encode()) for topic in MAY_WRITE[who]))
        for topic in set(TOPICS) - MAY_WRITE[who]:
            with WireClient(hivemq.on_loopback(who)) as client:
                client.publish(topic, who.encode())
                assert client.lost.wait(PATIENCE_S), topic
        ear.settle(ear.publish("over", b""))
        ear.hear("over", b"")
        ear.until(
            lambda: {topic for topic, payload in ear.received if payload == who.encode()} >= MAY_WRITE[who], "what is allowed"
        )
        assert {topic for topic, payload in ear.received if payload == who.encode()} == MAY_WRITE[who]


@pytest.mark.parametrize("who", USERS)
def test_each_reads_what_it_may_and_nothing_else(hivemq: HiveMQ, who: str) -> None:
    with WireClient(hivemq.open) as ear, WireClient(hivemq.of(who)) as client:
        client.subscribe("#", "spBv1.0/#", "$share/all/spBv1.0/cnc/#", "$share/all/spBv1.0/STATE/+", *TOPICS, "spBv1.0/STATE/+")
        ear.settle(*(ear.publish(topic, b"secret") for topic in TOPICS))
        ear.settle(ear.publish("spBv1.0/STATE/over", b""))
        client.hear("spBv1.0/STATE/over", b"")
        client.until(
            lambda: {topic for topic, payload in client.received if payload == b"secret"} >= MAY_READ[who], "what is allowed"
        )
    assert {topic for topic, payload in client.received if payload == b"secret"} == MAY_READ[who]


def test_an_edge_cannot_have_anything_retained(hivemq: HiveMQ) -> None:
    with WireClient(hivemq.of("edge-okuma")) as client:
        birth = "spBv1.0/cnc/NBIRTH/edge-okuma"
        client.settle(client.publish(birth, b"x"))
        client.publish(birth, b"x", retain=True)
        assert client.lost.wait(PATIENCE_S)


def test_a_will_is_no_way_around_the_rules(hivemq: HiveMQ) -> None:
    with WireClient(hivemq.open) as ear:
        ear.subscribe("#")
        will = ("spBv1.0/STATE/twin-mirror", b'{"online":false}', True)
        with (
            pytest.raises(AssertionError, match="did not accept"),
            WireClient(hivemq.of("edge-other"), will=will, patience_s=1.0),
        ):
            pass
        assert will[0] not in [topic for topic, _ in ear.received]


@pytest.mark.parametrize("wrong", ["password", "user", "certificate", "listener"])
def test_who_has_the_wrong_papers_stays_outside(hivemq: HiveMQ, wrong: str) -> None:
    good = hivemq.of("edge-okuma")
    address: BrokerAddress = {
        "password": good.with_password("wrong"),
        "user": replace(good, username=None, password=None),
        "certificate": replace(good, certificate_file=None, key_file=None),
        "listener": hivemq.on_loopback("edge-okuma").with_password("wrong"),
    }[wrong]
    edge = EdgeNode(address, NodeId("cnc", "edge-okuma"))
    edge.start()
    deadline_s = time.monotonic() + PATIENCE_S
    while not edge.last_error and time.monotonic() < deadline_s:
        time.sleep(0.01)
    online, error = edge.online, edge.last_error
    edge.stop()
    assert not online
    assert error and "\n" not in error and "pass word" not in error


def test_our_edge_node_and_host_application_work_under_these_rules(hivemq: HiveMQ) -> None:
    host = HostApplication(hivemq.of("processors"), "twin-mirror")
    edge = EdgeNode(hivemq.of("edge-okuma"), NodeId("cnc", "edge-okuma"))
    edge.declare_device("okuma", [MetricSpec("load", DataType.DOUBLE, value=37.5)])
    edge.start()
    try:
        deadline_s = time.monotonic() + PATIENCE_S
        while not edge.online:
            assert time.monotonic() < deadline_s, edge.last_error
            time.sleep(0.01)
        host.start()  # later than the birth, so that it has to ask for another one
        while (picture := host.picture(NodeId("cnc", "edge-okuma"))) is None or "okuma" not in picture.devices:
            assert time.monotonic() < deadline_s, host.last_error
            edge.publish(None, [])
            host.poll(0.05)
            with WireClient(hivemq.open) as other:
                other.publish("spBv1.0/cnc/NDATA/edge-okuma", b"")
        assert picture.devices["okuma"].readings["load"].value == 37.5
    finally:
        edge.stop()
        host.stop()


def test_the_rules_of_both_brokers_name_the_same_nodes() -> None:
    text = (DEPLOY / "credentials.xml").read_text()
    for name in discover():
        for verb in NODE_VERBS:
            assert f"<topic>spBv1.0/cnc/{verb}/twin-{name}</topic><activity>PUBLISH</activity>" in text
        for verb in DEVICE_VERBS:
            assert f"<topic>spBv1.0/cnc/{verb}/twin-{name}/+</topic><activity>PUBLISH</activity>" in text
    assert "<topic>#</topic>" not in text
    assert "<password>none</password>" in text, "nobody can log in before a password is set"
    assert barrier("${{username}}") in text


def test_no_statistics_go_out_and_nothing_listens_without_papers() -> None:
    text = (DEPLOY / "config.xml").read_text()
    assert "<anonymous-usage-statistics>\n        <enabled>false</enabled>" in text
    assert text.count("<bind-address>127.0.0.1</bind-address>") == text.count("<tcp-listener>") == 1
