"""Aliases (6.4.7)."""

import pytest

from sparkplug.codec import parse
from sparkplug.edge_session import REBIRTH
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import EPOCH_MS, NODE, PROBE_METRICS, EdgeLife, HostLife, change


@pytest.mark.tck("tck-id-payloads-alias-uniqueness")
def test_an_alias_stands_for_one_metric_of_the_node_and_all_its_devices(life: EdgeLife, edge: EdgeLife) -> None:
    edge.declare("third", PROBE_METRICS)
    edge.remove("third")
    edge.declare("fourth", PROBE_METRICS)
    edge.rebirth()
    for lived in (life, edge):
        meaning: dict[int, tuple[str | None, str]] = {}
        for sent in lived.of(Verb.NBIRTH, Verb.DBIRTH):
            for metric in sent.payload.metrics:
                if metric.HasField("alias"):
                    owner = (sent.topic.device, metric.name)
                    assert meaning.setdefault(metric.alias, owner) == owner
        assert len(set(meaning.values())) == len(meaning)


@pytest.mark.tck("tck-id-payloads-alias-birth-requirement")
def test_births_carry_name_and_alias_of_all_but_the_rebirth_control(life: EdgeLife) -> None:
    names = {name for sent in life.of(Verb.NBIRTH) for name in sent.names}
    assert {"bdSeq", "Node Control/Rebirth", "Axis"} <= names
    for sent in life.of(Verb.NBIRTH, Verb.DBIRTH):
        for metric in sent.payload.metrics:
            assert metric.HasField("name")
            assert metric.HasField("alias") == (metric.name != REBIRTH)


@pytest.mark.tck("tck-id-payloads-alias-data-cmd-requirement")
def test_data_carries_the_alias_and_no_name(life: EdgeLife) -> None:
    for sent in life.of(Verb.NDATA, Verb.DDATA):
        for metric in sent.payload.metrics:
            assert metric.HasField("alias")
            assert not metric.HasField("name")


@pytest.mark.tck("tck-id-payloads-alias-data-cmd-requirement")
def test_a_command_for_a_metric_with_an_alias_carries_the_alias_and_no_name(host: HostLife, edge: EdgeLife) -> None:
    host.connect()
    births = edge.rebirth()
    host.receive(*births)
    command = host.session.command(NODE, None, [change("health/lag", 1, EPOCH_MS)], EPOCH_MS)
    (metric,) = parse(command.payload).metrics
    assert metric.alias == births[0].metric("health/lag").alias
    assert not metric.HasField("name")
