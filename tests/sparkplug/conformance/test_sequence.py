"""The sequence number of all messages (6.4.5)."""

import pytest

from sparkplug.errors import MetricValueError, UnknownMetricError
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import EdgeLife, change

COUNTED = (Verb.NBIRTH, Verb.DBIRTH, Verb.NDATA, Verb.DDATA, Verb.DDEATH)


@pytest.mark.tck("tck-id-payloads-sequence-num-always-included")
def test_every_message_but_ndeath_carries_a_sequence_number(life: EdgeLife) -> None:
    assert {sent.verb for sent in life.sent} == {*COUNTED, Verb.NDEATH}
    for sent in life.sent:
        assert sent.payload.HasField("seq") == (sent.verb is not Verb.NDEATH)


@pytest.mark.tck("tck-id-payloads-sequence-num-req-nbirth")
def test_an_nbirth_carries_a_number_from_0_to_255(life: EdgeLife) -> None:
    births = life.of(Verb.NBIRTH)
    assert len(births) >= 4
    assert all(sent.payload.HasField("seq") and 0 <= sent.payload.seq <= 255 for sent in births)


@pytest.mark.tck("tck-id-payloads-sequence-num-incrementing")
def test_the_number_goes_up_by_one_with_each_message_and_to_zero_after_255(life: EdgeLife) -> None:
    follows = 0
    for before, after in zip(life.of(*COUNTED), life.of(*COUNTED)[1:], strict=False):
        if after.verb is not Verb.NBIRTH:
            assert after.payload.seq == (before.payload.seq + 1) % 256
            follows += before.payload.seq == 255
    assert follows == 1


@pytest.mark.tck("tck-id-payloads-sequence-num-incrementing")
def test_what_is_not_sent_uses_no_number(edge: EdgeLife) -> None:
    (first,) = edge.publish("okuma", change("spindle_load", 1.0, edge.now_ms))
    assert edge.publish("okuma") == []
    with pytest.raises(UnknownMetricError):
        edge.publish("okuma", change("no such metric", 1.0, edge.now_ms))
    with pytest.raises(MetricValueError):
        edge.publish("okuma", change("spindle_load", "not a number", edge.now_ms))
    (second,) = edge.publish("okuma", change("spindle_load", 2.0, edge.now_ms))
    assert second.payload.seq == first.payload.seq + 1
