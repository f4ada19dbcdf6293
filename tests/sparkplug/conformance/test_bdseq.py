"""The birth/death sequence number that ties an NBIRTH to its NDEATH (4.2 and 6.4)."""

from pathlib import Path
from typing import Any

import pytest

from sparkplug.codec import parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.session_files.bdseq import BdSeq
from sparkplug.topics import Verb
from tests.sparkplug.conformance.life import NODE, EdgeLife


def _bd_seq(payload: Any) -> int:
    (metric,) = (metric for metric in payload.metrics if metric.name == "bdSeq")
    assert metric.datatype == DataType.INT64
    assert metric.WhichOneof("value") == "long_value"
    return int(metric.long_value)


@pytest.mark.tck(
    "tck-id-topics-nbirth-bdseq-included",
    "tck-id-topics-nbirth-bdseq-matching",
    "tck-id-message-flow-edge-node-birth-publish-nbirth-payload-bdSeq",
    "tck-id-payloads-nbirth-bdseq",
    "tck-id-payloads-nbirth-bdseq-repeat",
)
def test_every_nbirth_repeats_the_number_of_the_will_of_its_connect(life: EdgeLife) -> None:
    births = life.of(Verb.NBIRTH)
    assert len(births) > len(life.connects), "a rebirth belongs to the connect before it"
    for sent in births:
        assert _bd_seq(sent.payload) == _bd_seq(parse(life.connects[sent.session].will.payload))


@pytest.mark.tck("tck-id-payloads-ndeath-bdseq")
def test_every_ndeath_repeats_the_number_of_the_nbirth_before_it(life: EdgeLife) -> None:
    deaths = life.of(Verb.NDEATH)
    assert deaths
    for sent in deaths:
        (birth, *_) = (birth for birth in life.of(Verb.NBIRTH) if birth.session == sent.session)
        assert _bd_seq(sent.payload) == _bd_seq(birth.payload)
    for number, connect in enumerate(life.connects):
        (birth, *_) = (birth for birth in life.of(Verb.NBIRTH) if birth.session == number)
        assert _bd_seq(parse(connect.will.payload)) == _bd_seq(birth.payload)


@pytest.mark.tck(
    "tck-id-topics-nbirth-bdseq-increment",
    "tck-id-message-flow-edge-node-birth-publish-will-message-payload-bdSeq",
)
def test_the_number_begins_at_zero_and_goes_up_by_one_with_each_connect_and_to_zero_after_255() -> None:
    edge, numbers = EdgeLife(EdgeNodeSession(NODE)), BdSeq()
    for _ in range(600):
        edge.connect(bd_seq=numbers.next())
        edge.lose()
    wills = [_bd_seq(parse(connect.will.payload)) for connect in edge.connects]
    assert wills == [number % 256 for number in range(600)]
    assert [_bd_seq(birth.payload) for birth in edge.of(Verb.NBIRTH)] == wills


@pytest.mark.tck("tck-id-topics-nbirth-bdseq-increment")
def test_a_restart_of_the_program_goes_on_with_the_next_number(tmp_path: Path) -> None:
    file = tmp_path / "state" / "session.json"
    numbers = [BdSeq(file).next() for _ in range(258)]
    assert numbers == [*range(256), 0, 1]
