"""XML that is not what it should be never becomes a document."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.controls.mtconnect.cursor import parse
from edge.controls.mtconnect.documents import parse_document, timestamp_ms
from edge.controls.mtconnect.xml import DEPTH_MAX, parse_xml
from edge.errors import DocumentError
from tests.edge.controls.mtconnect.agent_documents import CONFIG, fed, probe, streams, value

BOMB = b'<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><MTConnectStreams>&c;</MTConnectStreams>'
FRAMES = (probe(), streams(12, [value("rpm", 10, "3"), value("tool", 11)], conditions=[value("servo", 9, element="Normal")]))


@pytest.mark.parametrize(
    "raw",
    [
        BOMB,
        BOMB.decode().encode("utf-16"),
        b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>',
        b"<a>&b;</a>",
        b"<a" * 10 + b">",
        b"<a>" * (DEPTH_MAX + 1) + b"</a>" * (DEPTH_MAX + 1),
        b"",
        b"{}",
        b"<MTConnectStreams/>",
        b'<MTConnectStreams><Header instanceId="1"/></MTConnectStreams>',
        b'<MTConnectStreams><Header nextSequence="99999999999999999999999"/></MTConnectStreams>',
        b"<html><Header/></html>",
        b'<?xml version="1.0" encoding="klingon"?><a/>',
    ],
)
def test_what_is_no_document_is_refused(raw: bytes) -> None:
    with pytest.raises(DocumentError):
        parse_document(raw)


def test_a_document_beyond_the_bound_is_refused_before_it_is_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge.controls.mtconnect.xml.DOCUMENT_BYTES_MAX", 10)
    with pytest.raises(DocumentError, match="the most that is read is 10"):
        parse_xml(b"<a>0123456789</a>")


@given(st.sampled_from(FRAMES), st.data())
def test_a_truncated_frame_gives_nothing_and_moves_nothing(frame: bytes, data: st.DataObject) -> None:
    cursor, _ = fed(probe(), streams(9))
    cut = data.draw(st.integers(0, len(frame) - 1))
    after, samples = parse(CONFIG, cursor, frame[:cut])
    assert samples.error is not None
    assert (samples.samples, samples.received, after.next_sequence) == ((), 0, cursor.next_sequence)


@given(st.sampled_from(FRAMES), st.lists(st.tuples(st.integers(0, 2000), st.binary(max_size=3)), min_size=1, max_size=6))
def test_a_corrupt_frame_never_crashes_and_stays_accounted_for(frame: bytes, damage: list[tuple[int, bytes]]) -> None:
    for at, patch in damage:
        here = at % len(frame)
        frame = frame[:here] + patch + frame[here + len(patch) :]
    for cursor in (fed(probe(), streams(9))[0], fed(probe())[0], fed()[0]):
        after, samples = parse(CONFIG, cursor, frame)
        assert samples.accounted()
        assert parse(CONFIG, cursor, frame) == (after, samples)


@given(st.binary(max_size=200))
def test_any_bytes_are_survived(raw: bytes) -> None:
    _, samples = parse(CONFIG, fed(probe(), streams(9))[0], raw)
    assert samples.samples == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2022-08-08T13:51:34.7167146Z", 1659966694716),
        ("2022-08-08T13:51:28.9276Z", 1659966688927),
        ("2018-07-18T09:54:06.306Z", 1531907646306),
        ("2018-07-18T09:54:06Z", 1531907646000),
        ("2018-07-18T11:54:06+02:00", 1531907646000),
        ("2018-07-18T09:54:06", 1531907646000),
        ("2018-07-18T09:54:06.3061234567Z", 1531907646306),
        ("1969-12-31T23:59:59Z", None),
        ("yesterday", None),
        ("", None),
    ],
)
def test_time_stamps_may_have_any_number_of_digits(text: str, expected: int | None) -> None:
    assert timestamp_ms(text) == expected
