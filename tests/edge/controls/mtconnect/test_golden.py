"""The documents of a real agent (2.3) that replayed a real Okuma: each observation once."""

import gzip
from collections import Counter
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.config import EdgeConfig, ToolChangeSection
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.multipart import MultipartParser
from edge.controls.mtconnect.state import Cursor, Phase
from edge.running.pipeline import Pipeline
from edge.sample import Drop
from tests.edge.controls.mtconnect.agent_documents import CONFIG, fed, values
from tests.recordings import recording

OBSERVATIONS = 25_727


@cache
def documents() -> tuple[bytes, ...]:
    raw = gzip.decompress(recording("mtconnect/golden/okuma_samples_2.3.xmlseq.gz").read_bytes())
    return tuple(b"<?xml" + part for part in raw.split(b"<?xml") if part.strip())


def golden(name: str) -> bytes:
    return recording(f"mtconnect/golden/okuma_{name}_2.3.xml").read_bytes()


def from_the_beginning() -> Cursor:
    """A cursor that wants sequence 1, as if it had been there from the start."""
    cursor, _ = fed(golden("probe"))
    return replace(cursor, phase=Phase.SAMPLE, next_sequence=1)


def test_each_observation_is_taken_once_and_none_twice() -> None:
    cursor, received, sequences, dropped = from_the_beginning(), 0, [], Counter[str]()
    assert len(documents()) == 61
    for document in documents():
        cursor, frame = fed(document, cursor=cursor)
        received += frame.received
        sequences += [sample.sequence for sample in frame.samples if sample.observations]
        dropped.update(frame.dropped)
        again, frame = fed(document, cursor=cursor)
        assert (again, frame.samples, frame.dropped.get(Drop.DUPLICATE, 0)) == (cursor, (), frame.received)
    assert received == OBSERVATIONS
    assert len(set(sequences)) == len(sequences)
    assert sequences == sorted(sequences)
    assert set(dropped) == {Drop.UNMAPPED}
    assert len(sequences) + dropped.total() == OBSERVATIONS
    assert cursor.next_sequence == 25_878


def test_documents_in_any_earlier_order_add_nothing() -> None:
    cursor = from_the_beginning()
    for document in documents()[:20]:
        cursor, _ = fed(document, cursor=cursor)
    for document in reversed(documents()[:20]):
        after, frame = fed(document, cursor=cursor)
        assert (after, frame.samples) == (cursor, ())


@settings(max_examples=5, deadline=None)
@given(st.integers(1, 70_000), st.sampled_from(["x-mixed-replace;boundary=b", 'mixed; boundary="b"']))
def test_a_stream_of_them_may_be_cut_anywhere(size: int, kind: str) -> None:
    chosen = documents()[:12]
    raw = b"".join(b"--b\r\nContent-type: text/xml\r\nContent-length: %d\r\n\r\n%s\r\n" % (len(d), d) for d in chosen)
    parser, cursor, received = MultipartParser(f"multipart/{kind}"), from_the_beginning(), 0
    for at in range(0, len(raw), size):
        for part in parser.feed(raw[at : at + size]):
            cursor, frame = fed(part, cursor=cursor)
            received += frame.received
    expected = 0
    cursor_of_whole = from_the_beginning()
    for document in chosen:
        cursor_of_whole, frame = fed(document, cursor=cursor_of_whole)
        expected += frame.received
    assert (received, cursor) == (expected, cursor_of_whole)


def test_the_current_state_is_the_end_of_the_samples() -> None:
    cursor = from_the_beginning()
    last: dict[str, object] = {}
    for document in documents():
        cursor, frame = fed(document, cursor=cursor)
        last |= dict(values(frame))
    _, frame = fed(golden("probe"), golden("current"))
    assert dict(values(frame)) == last
    assert len(last) == 33


def test_the_samples_hold_exactly_eleven_tool_changes() -> None:
    pipeline = Pipeline(EdgeConfig(source=MtconnectConfig(), tool_change=ToolChangeSection()))
    cursor, changes = from_the_beginning(), []
    received = settled = 0
    for document in documents():
        cursor, frame = fed(document, cursor=cursor)
        outcome = pipeline.take(frame, arrival_s=0.0)
        received += frame.received
        settled += outcome.dropped.total() + sum(sample.observations for row in outcome.rows for sample in row)
        assert received == settled + pipeline.held
        changes += [s.value for row in outcome.rows for s in row if s.signal == "tool_change_active"]
    assert [change for change in changes if change is not None] == [False, *[True, False] * 11]


@pytest.mark.parametrize("name", ["current", "probe"])
def test_the_golden_documents_leave_no_error(name: str) -> None:
    _, frame = fed(golden("probe"), golden(name))
    assert frame.error is None
    assert CONFIG.source.device == ""
