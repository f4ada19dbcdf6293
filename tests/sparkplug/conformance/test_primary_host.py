"""An edge node that waits for its primary host, and leaves with it (5.4, 5.5, 5.10)."""

import pytest

from sparkplug.actions import HostState, Publish, Subscribe, WalkToNextServer
from sparkplug.edge_session import VISIT_MS, EdgeNodeSession, Phase
from sparkplug.errors import SparkplugError
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import (
    EPOCH_MS,
    HOST_ID,
    NODE,
    NODE_METRICS,
    PROBE_METRICS,
    STATE_TOPIC,
    EdgeLife,
    Sent,
    change,
    new_host_life,
)


@pytest.fixture
def waiting() -> EdgeLife:
    """An edge node with one device that is connected and waits for its primary host."""
    return _waiting(servers=1)


@pytest.fixture
def walking() -> EdgeLife:
    """The same with two brokers."""
    return _waiting(servers=2)


def _waiting(servers: int) -> EdgeLife:
    edge = EdgeLife(EdgeNodeSession(NODE, NODE_METRICS, now_ms=EPOCH_MS, primary_host=HOST_ID, servers=servers))
    edge.session.declare_device("probe", PROBE_METRICS, EPOCH_MS)
    assert edge.connect(bd_seq=0) == []
    return edge


def _goes_on(edge: EdgeLife) -> None:
    """The transport ends the connection and opens the next one, at the next broker."""
    edge.lose()
    number = len(edge.connects)
    assert edge.connect(bd_seq=number, server=number % 2) == []


def _says(edge: EdgeLife, online: bool, timestamp_ms: int, topic: str = STATE_TOPIC) -> list[Sent]:
    return edge.receive(topic, HostState(online, timestamp_ms).encode())


def _verbs(sent: list[Sent]) -> list[Verb]:
    return [message.verb for message in sent]


@pytest.mark.tck(
    "tck-id-message-flow-edge-node-birth-publish-phid-wait",
    "tck-id-operational-behavior-edge-node-birth-sequence-wait",
)
def test_nothing_is_born_until_the_primary_host_is_online(waiting: EdgeLife) -> None:
    waiting.wait(3_600_000)
    assert waiting.publish(None, change("health/lag", 1, waiting.now_ms)) == []
    assert waiting.rebirth() == []
    assert waiting.sent == []
    assert _verbs(_says(waiting, True, 5)) == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-phid-wait-id")
@pytest.mark.parametrize(
    "topic", ["spBv1.0/STATE/other", "spBv1.0/STATE/scada2", "spBv1.0/STATE/SCADA", "STATE/scada", "spBv1.0/STATE/x/scada"]
)
def test_another_host_does_not_stand_in_for_the_primary_one(waiting: EdgeLife, topic: str) -> None:
    assert _says(waiting, True, 5, topic) == []
    assert waiting.session.phase is Phase.WAITING


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-phid-wait-online")
@pytest.mark.parametrize(
    "payload",
    [
        b'{"online":false,"timestamp":5}',
        b'{"online":"true","timestamp":5}',
        b'{"online":1,"timestamp":5}',
        b'{"timestamp":5}',
        b'{"online":true}',
        b"ONLINE",
        b"",
    ],
)
def test_only_a_boolean_true_is_online(waiting: EdgeLife, payload: bytes) -> None:
    assert waiting.receive(STATE_TOPIC, payload) == []
    assert waiting.session.phase is Phase.WAITING


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-phid-wait-timestamp")
@pytest.mark.parametrize(
    ("timestamp_ms", "births"), [(999, []), (1000, [Verb.NBIRTH, Verb.DBIRTH]), (1001, [Verb.NBIRTH, Verb.DBIRTH])]
)
def test_online_with_an_older_time_stamp_does_not_count(waiting: EdgeLife, timestamp_ms: int, births: list[Verb]) -> None:
    _says(waiting, False, 1000)
    waiting.lose()
    waiting.connect(bd_seq=1)
    assert _verbs(_says(waiting, True, timestamp_ms)) == births


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-phid-wait-timestamp")
def test_the_first_time_stamp_is_taken_whatever_it_is(waiting: EdgeLife) -> None:
    assert _verbs(_says(waiting, True, 0)) == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.tck(
    "tck-id-message-flow-edge-node-birth-publish-phid-offline",
    "tck-id-operational-behavior-edge-node-termination-host-offline",
    "tck-id-operational-behavior-edge-node-termination-host-offline-reconnect",
)
@pytest.mark.parametrize("timestamp_ms", [1000, 1001, 10**13])
def test_when_the_primary_host_goes_offline_the_node_dies_leaves_and_begins_again(waiting: EdgeLife, timestamp_ms: int) -> None:
    _says(waiting, True, 1000)
    (death,) = _says(waiting, False, timestamp_ms)
    assert (death.verb, death.raw) == (Verb.NDEATH, death.raw)
    assert death.raw.topic == waiting.connects[-1].will.topic
    assert waiting.endings() == [WalkToNextServer()]
    waiting.lose()
    assert waiting.connect(bd_seq=1, server=1) == []
    assert _verbs(_says(waiting, True, timestamp_ms + 1)) == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.tck("tck-id-operational-behavior-edge-node-termination-host-offline-timestamp")
def test_an_offline_that_is_older_than_the_last_online_is_ignored(waiting: EdgeLife) -> None:
    _says(waiting, True, 1000)
    assert _says(waiting, False, 999) == []
    assert waiting.endings() == []
    assert _verbs(waiting.publish(None, change("health/lag", 1, waiting.now_ms))) == [Verb.NDATA]


def test_a_node_with_one_broker_waits_there_for_its_primary_host_and_owes_it_no_death(waiting: EdgeLife) -> None:
    for number in range(10):
        assert _says(waiting, False, 1000 + number) == []
        assert waiting.wait(60_000) == []
    assert waiting.endings() == []
    assert _verbs(_says(waiting, True, 2000)) == [Verb.NBIRTH, Verb.DBIRTH]


def test_nothing_is_published_between_the_death_and_the_next_connection(waiting: EdgeLife) -> None:
    _says(waiting, True, 1000)
    assert _verbs(_says(waiting, False, 1001)) == [Verb.NDEATH]
    assert _says(waiting, False, 1002) == []
    assert waiting.publish(None, change("health/lag", 1, waiting.now_ms)) == []
    assert waiting.rebirth() == []
    assert waiting.endings() == [WalkToNextServer()]


@pytest.mark.tck("tck-id-operational-behavior-primary-application-state-with-multiple-servers-walk")
def test_a_node_that_finds_its_primary_host_offline_walks_to_the_next_broker(walking: EdgeLife) -> None:
    assert _verbs(_says(walking, False, 1000)) == [Verb.NDEATH]
    assert walking.endings() == [WalkToNextServer()]


@pytest.mark.tck("tck-id-operational-behavior-primary-application-state-with-multiple-servers-walk")
def test_a_node_that_was_at_all_brokers_looks_at_each_for_a_while(walking: EdgeLife) -> None:
    _says(walking, False, 1000)
    for _ in range(3):
        _goes_on(walking)
        assert _says(walking, False, 1000) == []
        assert walking.wait(VISIT_MS - 500) == []
        assert _verbs(walking.wait(500)) == [Verb.NDEATH]
    assert walking.endings() == [WalkToNextServer()] * 4
    _goes_on(walking)
    assert _verbs(_says(walking, True, 1001)) == [Verb.NBIRTH, Verb.DBIRTH]
    assert walking.wait(10 * VISIT_MS) == []


@pytest.mark.tck("tck-id-operational-behavior-primary-application-state-with-multiple-servers-walk")
def test_a_node_whose_host_goes_offline_at_once_looks_at_all_the_others(walking: EdgeLife) -> None:
    _says(walking, True, 1000)
    assert _verbs(_says(walking, False, 1001)) == [Verb.NDEATH]
    _goes_on(walking)
    assert _verbs(_says(walking, False, 1001)) == [Verb.NDEATH]
    _goes_on(walking)
    assert _says(walking, False, 1001) == []


@pytest.mark.parametrize("step_ms", [VISIT_MS, -VISIT_MS])
def test_a_broker_that_knows_nothing_of_the_primary_host_is_left_too(walking: EdgeLife, step_ms: int) -> None:
    assert _verbs(walking.wait(step_ms)) == [Verb.NDEATH]
    assert walking.endings() == [WalkToNextServer()]


@pytest.mark.tck("tck-id-operational-behavior-primary-application-state-with-multiple-servers-single-server")
def test_a_node_is_on_one_broker_at_a_time(waiting: EdgeLife) -> None:
    with pytest.raises(SparkplugError):
        waiting.session.connecting(1, waiting.now_ms, server=1)
    waiting.lose()
    waiting.connect(bd_seq=1, server=1)


@pytest.mark.tck("tck-id-message-flow-edge-node-birth-publish-phid-wait-timestamp")
def test_the_time_stamps_of_one_broker_say_nothing_of_another(waiting: EdgeLife) -> None:
    _says(waiting, False, 1000)
    waiting.lose()
    waiting.connect(bd_seq=1, server=1)
    assert _verbs(_says(waiting, True, 500)) == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.tck("tck-id-operational-behavior-primary-application-state-with-multiple-servers-state-subs")
def test_the_node_subscribes_to_the_state_that_the_primary_host_publishes_on_every_broker(waiting: EdgeLife) -> None:
    host = new_host_life()
    (birth,) = (action for action in host.connect() if isinstance(action, Publish))
    waiting.lose()
    waiting.connect(bd_seq=1, server=1)
    for number in (0, 1):
        assert Subscribe(birth.topic, qos=1) in waiting.subscriptions(number)
    assert _verbs(waiting.receive(birth.topic, birth.payload)) == [Verb.NBIRTH, Verb.DBIRTH]


@pytest.mark.tck(
    "tck-id-operational-behavior-primary-application-state-with-multiple-servers-state",
    "tck-id-operational-behavior-host-application-multi-server-timestamp",
)
def test_a_host_on_two_brokers_is_born_on_each_with_the_time_stamp_of_its_connect_there() -> None:
    first, second = new_host_life(), new_host_life()
    second.now_ms += 4000
    for host in (first, second, first):
        host.now_ms += 10_000
        connect_ms = host.now_ms
        published = [action for action in host.connect() if isinstance(action, Publish)]
        assert [HostState.decode(p.payload) for p in published] == [HostState(True, connect_ms)]
        host.session.lost(host.now_ms)
