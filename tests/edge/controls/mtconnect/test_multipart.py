"""Both kinds of multipart stream, cut anywhere."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.controls.mtconnect.multipart import MultipartParser
from edge.errors import ConnectionLostError

PARTS = [b"<a/>", b"", b"<b>--bou\r\n</b>", b"<c>\r\n--boundar</c>"]
KINDS = {
    "x-mixed-replace": ("multipart/x-mixed-replace;boundary=boundary", b"\r\n"),
    "mixed": ('multipart/mixed; boundary="boundary"', b"\r\n"),
    "bare line feeds": ("multipart/mixed;boundary=boundary", b"\n"),
}


def stream(newline: bytes, *, lengths: bool = True, end: bool = True) -> bytes:
    body = b""
    for part in PARTS:
        head = [b"--boundary", b"Content-type: text/xml"] + ([b"Content-LENGTH: %d" % len(part)] if lengths else [])
        body += newline.join([*head, b"", part, b""])
    return body + (b"--boundary--" + newline if end else b"")


def fed(content_type: str, chunks: list[bytes]) -> list[bytes]:
    parser = MultipartParser(content_type)
    return [part for chunk in chunks for part in parser.feed(chunk)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lengths", [True, False])
def test_a_stream_cut_at_any_byte_gives_the_same_parts(kind: str, lengths: bool) -> None:
    content_type, newline = KINDS[kind]
    raw = stream(newline, lengths=lengths)
    for at in range(len(raw) + 1):
        assert fed(content_type, [raw[:at], raw[at:]]) == PARTS


@pytest.mark.parametrize("kind", KINDS)
def test_a_stream_that_drips_gives_each_part_as_soon_as_it_is_whole(kind: str) -> None:
    content_type, newline = KINDS[kind]
    raw = stream(newline, end=False)
    assert fed(content_type, [raw[i : i + 1] for i in range(len(raw))]) == PARTS


@given(st.lists(st.integers(0, 400), max_size=12))
def test_a_stream_cut_anywhere_any_number_of_times_gives_the_same_parts(cuts: list[int]) -> None:
    raw = stream(b"\r\n")
    edges = sorted({0, len(raw), *(cut for cut in cuts if cut < len(raw))})
    assert fed(KINDS["mixed"][0], [raw[a:b] for a, b in pairwise(edges)]) == PARTS


@pytest.mark.parametrize(
    "lost", [b"\r\nContent-type: text/xml\r\nContent-LENGTH: 4\r\n\r\n<a/>", b": text/xml\r\nContent-LENGTH: 4\r\n\r\n<a/>"]
)
def test_bytes_that_were_lost_in_a_head_lose_no_part_in_silence(lost: bytes) -> None:
    raw = stream(b"\r\n")
    with pytest.raises(ConnectionLostError, match="out of step"):
        fed(KINDS["mixed"][0], [raw.replace(lost, b"", 1)])


def test_lost_bytes_are_noticed() -> None:
    raw = stream(b"\r\n").replace(b"<a/>", b"")
    with pytest.raises(ConnectionLostError, match="out of step"):
        fed(KINDS["mixed"][0], [raw])


def test_a_part_beyond_the_bound_is_refused_before_it_is_read() -> None:
    with pytest.raises(ConnectionLostError, match="the most that is read is 10"):
        MultipartParser("multipart/mixed;boundary=b", part_bytes_max=10).feed(b"--b\r\nContent-length: 11\r\n\r\n")
    with pytest.raises(ConnectionLostError, match="more than 10 bytes"):
        MultipartParser("multipart/mixed;boundary=b", part_bytes_max=10).feed(b"--b\r\n\r\n0123456789ab")


def test_a_head_without_an_end_is_refused() -> None:
    with pytest.raises(ConnectionLostError, match="longer than"):
        MultipartParser("multipart/mixed;boundary=b").feed(b"--b\r\n" + b"x" * 20_000)


def test_a_stream_without_a_part_is_refused() -> None:
    with pytest.raises(ConnectionLostError, match="no part begins"):
        MultipartParser("multipart/mixed;boundary=b").feed(b" " * 20_000)


def test_a_multipart_stream_without_a_boundary_is_refused() -> None:
    with pytest.raises(ConnectionLostError, match="without a boundary"):
        MultipartParser("multipart/mixed")


@given(st.lists(st.binary(max_size=60), max_size=6))
def test_any_bytes_are_survived(chunks: list[bytes]) -> None:
    parser = MultipartParser("multipart/mixed;boundary=b")
    try:
        for chunk in chunks:
            parser.feed(chunk)
    except ConnectionLostError:
        return
