"""Commands to nodes and devices, from the host's side and the edge's (4.2.1.4, 5.4, 5.6, 5.17, 6.4.23 and 6.4.24)."""

import pytest

from sparkplug.actions import Publish, Subscribe
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import REBIRTH, EdgeNodeSession
from sparkplug.errors import MetricValueError, UnknownMetricError
from sparkplug.metric import Change, MetricSpec
from sparkplug.topics import Verb
from sparkplug.values import Metric, Payload
from tests.sparkplug.conformance.life import EPOCH_MS, NODE, PROBE_METRICS, EdgeLife, HostLife, change


@pytest.fixture
def commander(host: HostLife, edge: EdgeLife) -> HostLife:
    """A host application that knows the births of the edge node."""
    host.connect()
    host.receive(*edge.rebirth())
    return host


def _ncmd(commander: HostLife, *changes: Change) -> Publish:
    return commander.session.command(NODE, None, changes or (change("health/lag", 0, EPOCH_MS),), EPOCH_MS + 7)


def _dcmd(commander: HostLife, *changes: Change) -> Publish:
    return commander.session.command(NODE, "okuma", changes or (change("tool_number", 3, EPOCH_MS),), EPOCH_MS + 7)


@pytest.mark.tck(
    "tck-id-topics-ncmd-topic",
    "tck-id-topics-ncmd-mqtt",
    "tck-id-payloads-ncmd-qos",
    "tck-id-payloads-ncmd-retain",
    "tck-id-operational-behavior-data-commands-ncmd-verb",
)
def test_a_command_to_a_node_is_an_ncmd_with_qos_0_that_is_not_retained(commander: HostLife) -> None:
    command = _ncmd(commander)
    assert (command.topic, command.qos, command.retain) == ("spBv1.0/cnc/NCMD/edge-okuma", 0, False)


@pytest.mark.tck(
    "tck-id-topics-dcmd-topic",
    "tck-id-topics-dcmd-mqtt",
    "tck-id-payloads-dcmd-qos",
    "tck-id-payloads-dcmd-retain",
    "tck-id-operational-behavior-data-commands-dcmd-verb",
)
def test_a_command_to_a_device_is_a_dcmd_with_qos_0_that_is_not_retained(commander: HostLife) -> None:
    command = _dcmd(commander)
    assert (command.topic, command.qos, command.retain) == ("spBv1.0/cnc/DCMD/edge-okuma/okuma", 0, False)


@pytest.mark.tck(
    "tck-id-topics-ncmd-timestamp",
    "tck-id-payloads-ncmd-timestamp",
    "tck-id-topics-dcmd-timestamp",
    "tck-id-payloads-dcmd-timestamp",
)
def test_a_command_says_when_it_was_sent(commander: HostLife) -> None:
    for command in (_ncmd(commander), _dcmd(commander)):
        assert parse(command.payload).timestamp == EPOCH_MS + 7


@pytest.mark.tck("tck-id-payloads-ncmd-seq", "tck-id-payloads-dcmd-seq")
def test_a_command_carries_no_sequence_number(commander: HostLife) -> None:
    for command in (_ncmd(commander), _dcmd(commander)):
        assert not parse(command.payload).HasField("seq")


@pytest.mark.tck(
    "tck-id-topics-ncmd-payload",
    "tck-id-operational-behavior-data-commands-ncmd-metric-name",
    "tck-id-operational-behavior-data-commands-ncmd-metric-value",
)
def test_the_node_reads_from_an_ncmd_what_the_host_wants_written(commander: HostLife, edge: EdgeLife) -> None:
    edge.session.commands.clear()
    command = _ncmd(commander, change("health/lag", -4, EPOCH_MS), change("health/agent", "again", EPOCH_MS))
    edge.receive(command.topic, command.payload)
    assert [(c.device, c.name, c.value) for c in edge.session.commands] == [
        (None, "health/lag", -4),
        (None, "health/agent", "again"),
    ]


@pytest.mark.tck(
    "tck-id-topics-dcmd-payload",
    "tck-id-operational-behavior-data-commands-dcmd-metric-name",
    "tck-id-operational-behavior-data-commands-dcmd-metric-value",
)
def test_the_device_reads_from_a_dcmd_what_the_host_wants_written(commander: HostLife, edge: EdgeLife) -> None:
    edge.session.commands.clear()
    command = _dcmd(commander, change("tool_number", -4, EPOCH_MS), change("spindle_load", None, EPOCH_MS))
    edge.receive(command.topic, command.payload)
    assert [(c.device, c.name, c.value) for c in edge.session.commands] == [
        ("okuma", "tool_number", -4),
        ("okuma", "spindle_load", None),
    ]


@pytest.mark.tck(
    "tck-id-operational-behavior-data-commands-ncmd-metric-name",
    "tck-id-operational-behavior-data-commands-dcmd-metric-name",
)
def test_a_metric_that_no_birth_declares_is_not_commanded(commander: HostLife) -> None:
    with pytest.raises(UnknownMetricError):
        _ncmd(commander, change("tool_number", 1, EPOCH_MS))
    with pytest.raises(UnknownMetricError):
        _dcmd(commander, change("health/lag", 1, EPOCH_MS))


@pytest.mark.tck(
    "tck-id-operational-behavior-data-commands-ncmd-metric-value",
    "tck-id-operational-behavior-data-commands-dcmd-metric-value",
)
@pytest.mark.parametrize("value", ["one", 1.5, True, 2**63])
def test_a_value_that_the_declared_type_cannot_carry_is_not_commanded(commander: HostLife, value: object) -> None:
    with pytest.raises(MetricValueError):
        _ncmd(commander, Change("health/lag", value, EPOCH_MS))  # type: ignore[arg-type]
    with pytest.raises(MetricValueError):
        _dcmd(commander, Change("tool_number", value, EPOCH_MS))  # type: ignore[arg-type]


@pytest.mark.tck("tck-id-operational-behavior-data-commands-rebirth-name")
def test_a_rebirth_is_commanded_by_name_as_any_other_metric_that_the_birth_declares(commander: HostLife, edge: EdgeLife) -> None:
    command = _ncmd(commander, change(REBIRTH, True, EPOCH_MS), change("health/lag", 3, EPOCH_MS))
    rebirth, lag = parse(command.payload).metrics
    assert (rebirth.name, rebirth.boolean_value, rebirth.HasField("alias")) == (REBIRTH, True, False)
    assert lag.HasField("alias")
    edge.wait(10_000)
    assert edge.receive(command.topic, command.payload)[0].verb is Verb.NBIRTH


def test_other_controls_that_a_birth_declares_are_commanded_too(host: HostLife) -> None:
    host.connect()
    controls = (MetricSpec("Node Control/Reboot", DataType.BOOLEAN, value=False),)
    edge = EdgeLife(EdgeNodeSession(NODE, controls, now_ms=EPOCH_MS))
    host.receive(*edge.connect(bd_seq=0))
    command = _ncmd(host, change("Node Control/Reboot", True, EPOCH_MS))
    edge.receive(command.topic, command.payload)
    assert [(c.name, c.value) for c in edge.session.commands] == [("Node Control/Reboot", True)]


@pytest.mark.parametrize(("device", "name"), [("okuma", REBIRTH), (None, "bdSeq")])
def test_no_birth_declares_the_rebirth_of_a_device_or_a_bdseq_to_write(
    commander: HostLife, device: str | None, name: str
) -> None:
    with pytest.raises(UnknownMetricError):
        commander.session.command(NODE, device, [change(name, True, EPOCH_MS)], EPOCH_MS)


def test_a_node_whose_birth_offers_no_rebirth_is_not_commanded_to_give_one_but_can_be_asked(host: HostLife) -> None:
    host.connect()
    birth = encode(Payload(EPOCH_MS, (Metric("bdSeq", 0, DataType.INT64, EPOCH_MS),), seq=0))
    host.session.message("spBv1.0/cnc/NBIRTH/edge-okuma", birth, EPOCH_MS)
    with pytest.raises(UnknownMetricError):
        _ncmd(host, change(REBIRTH, True, EPOCH_MS))
    assert host.session.rebirth_request(NODE, EPOCH_MS).topic == "spBv1.0/cnc/NCMD/edge-okuma"


@pytest.mark.tck("tck-id-message-flow-edge-node-ncmd-subscribe")
def test_the_node_subscribes_to_its_commands_with_qos_1_on_each_connection(life: EdgeLife) -> None:
    for number in range(len(life.connects)):
        assert Subscribe("spBv1.0/cnc/NCMD/edge-okuma", qos=1) in life.subscriptions(number)


@pytest.mark.tck("tck-id-message-flow-device-dcmd-subscribe")
def test_each_device_is_subscribed_to_its_commands_with_qos_1(edge: EdgeLife) -> None:
    before = edge.subscriptions(3)
    assert [s for s in before if "DCMD" in s.topic_filter] == [Subscribe("spBv1.0/cnc/DCMD/edge-okuma/okuma", qos=1)]
    edge.declare("late", PROBE_METRICS)
    assert edge.subscriptions(3)[len(before) :] == [Subscribe("spBv1.0/cnc/DCMD/edge-okuma/late", qos=1)]


def test_a_command_of_a_sloppy_host_by_name_and_with_datatype_is_read_too(edge: EdgeLife) -> None:
    edge.session.commands.clear()
    edge.command(Metric("tool_number", 12, DataType.INT32), device="okuma")
    assert [(c.device, c.name, c.value) for c in edge.session.commands] == [("okuma", "tool_number", 12)]
