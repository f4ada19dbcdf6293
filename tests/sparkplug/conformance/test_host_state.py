"""The STATE of a host application (4.2.3, 5.3, 5.13, 5.14 and 6.4.27); the wire itself is in test_host_wire."""

import json
from typing import Any

import pytest

from sparkplug.actions import Connect, Disconnect, Publish, Subscribe
from tests.sparkplug.conformance.life import EPOCH_MS, STATE_TOPIC, HostLife


def _state(message: Publish) -> dict[str, Any]:
    state: dict[str, Any] = json.loads(message.payload.decode("utf-8"))
    return state


def _connected(host: HostLife) -> tuple[Connect, Publish]:
    """The CONNECT and the birth that followed it."""
    actions = host.connect()
    (birth,) = (action for action in actions if isinstance(action, Publish))
    return host.connects[-1], birth


@pytest.mark.tck(
    "tck-id-host-topic-phid-death-required",
    "tck-id-host-topic-phid-death-topic",
    "tck-id-host-topic-phid-death-qos",
    "tck-id-host-topic-phid-death-retain",
    "tck-id-operational-behavior-host-application-connect-will",
    "tck-id-operational-behavior-host-application-connect-will-topic",
    "tck-id-operational-behavior-host-application-connect-will-qos",
    "tck-id-operational-behavior-host-application-connect-will-retained",
    "tck-id-payloads-state-will-message",
    "tck-id-payloads-state-will-message-qos",
    "tck-id-payloads-state-will-message-retain",
)
def test_every_connect_registers_the_death_as_its_will(host: HostLife) -> None:
    for _ in range(3):
        will = _connected(host)[0].will
        assert (will.topic, will.qos, will.retain) == (STATE_TOPIC, 1, True)
        host.session.lost(host.now_ms)


@pytest.mark.tck(
    "tck-id-host-topic-phid-death-payload",
    "tck-id-host-topic-phid-death-payload-timestamp-connect",
    "tck-id-operational-behavior-host-application-connect-will-payload",
    "tck-id-payloads-state-will-message-payload",
)
def test_the_will_says_offline_with_the_time_of_the_connect(host: HostLife) -> None:
    for now_ms in (EPOCH_MS + 10, EPOCH_MS + 99_000):
        host.now_ms = now_ms
        assert _state(_connected(host)[0].will) == {"online": False, "timestamp": now_ms}
        host.session.lost(host.now_ms)


@pytest.mark.tck(
    "tck-id-conformance-primary-host",
    "tck-id-intro-sparkplug-host-state",
    "tck-id-components-ph-state",
    "tck-id-host-topic-phid-birth-topic",
    "tck-id-host-topic-phid-birth-qos",
    "tck-id-host-topic-phid-birth-retain",
    "tck-id-operational-behavior-host-application-connect-birth-topic",
    "tck-id-operational-behavior-host-application-connect-birth-qos",
    "tck-id-operational-behavior-host-application-connect-birth-retained",
)
def test_the_birth_is_a_retained_message_with_qos_1_on_the_state_topic(host: HostLife) -> None:
    _, birth = _connected(host)
    assert (birth.topic, birth.qos, birth.retain) == (STATE_TOPIC, 1, True)
    assert _state(birth)["online"] is True


@pytest.mark.tck(
    "tck-id-host-topic-phid-birth-payload",
    "tck-id-host-topic-phid-birth-payload-timestamp",
    "tck-id-message-flow-phid-sparkplug-state-publish-payload",
    "tck-id-message-flow-phid-sparkplug-state-publish-payload-timestamp",
    "tck-id-operational-behavior-host-application-connect-birth-payload",
    "tck-id-payloads-state-birth-payload",
)
def test_the_birth_says_online_with_the_time_stamp_of_the_will(host: HostLife) -> None:
    for now_ms in (EPOCH_MS, EPOCH_MS + 60_000):
        host.now_ms = now_ms
        connect, birth = _connected(host)
        assert host.now_ms > now_ms, "the birth is sent later than the connect"
        assert _state(birth) == {"online": True, "timestamp": _state(connect.will)["timestamp"]}
        host.session.lost(host.now_ms)


@pytest.mark.tck(
    "tck-id-host-topic-phid-birth-message",
    "tck-id-host-topic-phid-birth-sub-required",
    "tck-id-host-topic-phid-birth-required",
    "tck-id-message-flow-phid-sparkplug-subscription",
    "tck-id-message-flow-phid-sparkplug-state-publish",
    "tck-id-operational-behavior-host-application-connect-birth",
    "tck-id-payloads-state-subscribe",
    "tck-id-payloads-state-birth",
)
def test_a_host_subscribes_to_its_state_and_to_the_nodes_and_then_is_born_before_anything_else(host: HostLife) -> None:
    for _ in range(2):
        actions = host.connect()
        filters = [action.topic_filter for action in actions if isinstance(action, Subscribe)]
        assert filters == [STATE_TOPIC, "spBv1.0/#"]
        assert [type(action) for action in actions] == [Subscribe, Subscribe, Publish]
        assert actions[-1].topic == STATE_TOPIC  # type: ignore[union-attr]
        host.session.lost(host.now_ms)


@pytest.mark.tck("tck-id-message-flow-hid-sparkplug-state-message-delivered")
def test_a_host_that_reads_of_its_own_death_is_born_again_at_once(host: HostLife) -> None:
    connect, birth = _connected(host)
    host.now_ms += 5000
    assert host.own_state(connect.will.payload) == [birth]
    assert host.own_state(b'{"online":false,"timestamp":1}') == [birth]
    assert host.own_state(birth.payload) == []


@pytest.mark.tck(
    "tck-id-operational-behavior-host-application-termination",
    "tck-id-operational-behavior-host-application-death-topic",
    "tck-id-operational-behavior-host-application-death-payload",
    "tck-id-operational-behavior-host-application-death-qos",
    "tck-id-operational-behavior-host-application-death-retained",
    "tck-id-operational-behavior-host-application-disconnect-intentional",
    "tck-id-host-topic-phid-death-topic",
    "tck-id-host-topic-phid-death-qos",
    "tck-id-host-topic-phid-death-retain",
    "tck-id-host-topic-phid-death-payload",
    "tck-id-host-topic-phid-death-payload-timestamp-disconnect-clean",
    "tck-id-host-topic-phid-death-payload-timestamp-disconnect-with-no-disconnect-packet",
    "tck-id-conformance-primary-host",
    "tck-id-intro-sparkplug-host-state",
    "tck-id-components-ph-state",
)
def test_a_host_that_ends_by_its_own_will_publishes_its_death_with_the_present_time_and_disconnects(host: HostLife) -> None:
    host.connect()
    host.now_ms += 70_000
    death, disconnect = host.close()
    assert isinstance(death, Publish)
    assert (death.topic, death.qos, death.retain) == (STATE_TOPIC, 1, True)
    assert _state(death) == {"online": False, "timestamp": host.now_ms}
    assert isinstance(disconnect, Disconnect)


def test_a_host_that_has_ended_does_not_come_alive_by_its_own_death(host: HostLife) -> None:
    host.connect()
    death = host.close()[0]
    assert isinstance(death, Publish)
    assert host.own_state(death.payload) == []


def test_a_state_message_of_nested_brackets_is_only_malformed(host: HostLife) -> None:
    host.connect()
    assert host.own_state(b"[" * 100_000) == []
    assert host.session.counts["malformed"] == 1
