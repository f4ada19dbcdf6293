"""The death certificate of a device (4.2.2.3, 5.7 and 6.4.26)."""

import pytest

from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import PROBE_METRICS, EdgeLife


@pytest.mark.tck("tck-id-topics-ddeath-topic")
def test_the_topic_names_group_node_and_device(life: EdgeLife) -> None:
    assert {sent.raw.topic for sent in life.of(Verb.DDEATH)} == {"spBv1.0/cnc/DDEATH/edge-okuma/probe"}


@pytest.mark.tck("tck-id-topics-ddeath-mqtt")
def test_it_is_published_with_qos_0_and_not_retained(life: EdgeLife) -> None:
    assert {(sent.raw.qos, sent.raw.retain) for sent in life.of(Verb.DDEATH)} == {(0, False)}


@pytest.mark.tck(
    "tck-id-topics-ddeath-seq-num",
    "tck-id-payloads-ddeath-seq",
    "tck-id-payloads-ddeath-seq-inc",
    "tck-id-payloads-ddeath-seq-number",
)
def test_its_sequence_number_is_one_more_than_that_of_the_message_before(edge: EdgeLife) -> None:
    numbers = []
    for _ in range(300):
        (birth,) = edge.declare("probe", PROBE_METRICS)
        (death,) = edge.remove("probe")
        assert death.payload.HasField("seq")
        assert death.payload.seq == (birth.payload.seq + 1) % 256
        numbers.append(death.payload.seq)
    assert 253 < max(numbers) <= 255


@pytest.mark.tck("tck-id-payloads-ddeath-timestamp")
def test_it_says_when_it_was_sent(life: EdgeLife) -> None:
    assert [sent.payload.timestamp for sent in life.of(Verb.DDEATH)] == [sent.at_ms for sent in life.of(Verb.DDEATH)]


@pytest.mark.tck("tck-id-operational-behavior-device-ddeath")
def test_losing_a_device_publishes_its_death_at_once(edge: EdgeLife) -> None:
    (death,) = edge.remove("okuma")
    assert (death.verb, death.topic.device) == (Verb.DDEATH, "okuma")
    assert "okuma" not in {sent.topic.device for sent in edge.rebirth()}


@pytest.mark.tck("tck-id-operational-behavior-device-ddeath")
def test_a_device_that_was_never_born_has_no_death(edge: EdgeLife) -> None:
    edge.lose()
    assert edge.remove("okuma") == []
    assert {sent.topic.device for sent in edge.connect(bd_seq=4)} == {None}
