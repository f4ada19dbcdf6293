"""Documents and multipart streams of an agent that means ill or is broken: DocumentError or ConnectionLostError, and soon."""

from contextlib import suppress
from random import Random
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.controls.mtconnect.documents import StreamsDocument, parse_document
from edge.controls.mtconnect.multipart import HEAD_BYTES_MAX, MultipartParser
from edge.controls.mtconnect.xml import (
    ATTRIBUTES_MAX,
    DEPTH_MAX,
    DOCUMENT_BYTES_MAX,
    ELEMENTS_MAX,
    SMALL_BYTES_MAX,
    parse_small,
    parse_xml,
)
from edge.errors import ConnectionLostError, DocumentError
from tests.fuzz_depth import FUZZ, within

HEADER = '<Header instanceId="1" bufferSize="10" firstSequence="1" lastSequence="2" nextSequence="3"/>'
STREAM = (
    f'<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.3">{HEADER}<Streams><DeviceStream name="m" uuid="u">'
    '<ComponentStream component="Linear" name="X" componentId="x"><Samples><Position dataItemId="xp" sequence="1" '
    'timestamp="2022-08-08T13:51:34.716Z">12.5</Position></Samples><Condition><Fault dataItemId="c" sequence="2" type="SYSTEM" '
    'timestamp="2022-08-08T13:51:35Z" nativeCode="7">overtravel</Fault></Condition></ComponentStream></DeviceStream></Streams>'
    "</MTConnectStreams>"
).encode()
LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10))
TYPED = {
    "billion laughs": f'<!DOCTYPE a [<!ENTITY l0 "lol">{LAUGHS}]><a>&l9;</a>',
    "quadratic": f'<!DOCTYPE a [<!ENTITY b "{"x" * 100_000}">]><a>{"&b;" * 10_000}</a>',
    "file": '<!DOCTYPE a [<!ENTITY f SYSTEM "file:///etc/passwd">]><a>&f;</a>',
    "network": '<!DOCTYPE a SYSTEM "http://127.0.0.1:1/evil.dtd"><a/>',
    "parameter": '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1:1/evil.dtd"> %p;]><a/>',
}


@pytest.mark.parametrize("name", TYPED)
def test_whatever_a_document_type_could_do_it_is_refused_at_its_name(name: str) -> None:
    with within(1.0, 8.0), pytest.raises(DocumentError, match="document type 'a' refused"):
        parse_xml(TYPED[name].encode())


@pytest.mark.parametrize("name", TYPED)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "cp037", "utf-7"])
def test_the_short_way_takes_no_document_type_in_any_encoding(name: str, encoding: str) -> None:
    for declared in ("", f'<?xml version="1.0" encoding="{encoding}"?>'):
        assert parse_small((declared + TYPED[name]).encode(encoding)) is None
        half = declared.encode() + TYPED[name].encode(encoding)  # declared in ASCII
        assert parse_small(half) is None


def test_the_short_way_is_for_small_documents_and_gives_the_same() -> None:
    small, large = parse_small(STREAM), parse_small(STREAM.replace(b"overtravel", b"x" * SMALL_BYTES_MAX))
    assert small is not None
    assert ET.tostring(small) == ET.tostring(parse_xml(STREAM))
    assert large is None
    assert parse_small(STREAM[:-9]) is None, "and who is careful says what is wrong"


def test_a_small_document_that_is_nested_deeply_is_read_no_deeper_than_observations_are() -> None:
    deep = b"<Entry>" * 4_000 + b"</Entry>" * 4_000
    document = parse_document(STREAM.replace(b"12.5", deep))
    assert isinstance(document, StreamsDocument)
    assert [o.has_entries for o in document.observations] == [True, False]
    with pytest.raises(DocumentError, match="nested deeper"):
        parse_document(STREAM.replace(b"12.5", deep).replace(b"MTConnectStreams", b"MTConnectDevices"))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "iso-8859-1"])
def test_another_encoding_is_no_way_around(encoding: str) -> None:
    head = "" if "utf-8" in encoding else f'<?xml version="1.0" encoding="{encoding}"?>'
    with within(1.0, 8.0), pytest.raises(DocumentError, match="document type 'a' refused"):
        parse_xml((head + TYPED["billion laughs"]).encode(encoding))


@pytest.mark.parametrize(
    ("document", "said"),
    [
        (b"<a>" * 100_000, f"nested deeper than {DEPTH_MAX}"),
        (b"<a>" + b"<b/>" * (ELEMENTS_MAX + 1), f"more than {ELEMENTS_MAX} elements"),
        (b"<a " + b" ".join(b'x%d="1"' % n for n in range(50_000)) + b"/>", f"the most that is read is {ATTRIBUTES_MAX}"),
        (b"<a>" + b"x" * DOCUMENT_BYTES_MAX, "the most that is read is"),
        (b"<" + b"a" * 1_000_000, "no well-formed XML"),
        (b"<a " + b"x" * 1_000_000, "no well-formed XML"),
        (b"<a>&l9;</a>", "no well-formed XML"),
        (b'<?xml version="1.0" encoding="nonsense"?><a/>', "no well-formed XML"),
    ],
    ids=["depth", "elements", "attributes", "size", "name", "attribute", "unknown entity", "unknown encoding"],
)
def test_a_flood_is_refused_in_time_and_memory(document: bytes, said: str) -> None:
    with within(10.0, 150.0), pytest.raises(DocumentError, match=said):
        parse_xml(document)


def damaged(data: bytes, seed: int) -> bytes:
    """Pieces cut out, doubled or replaced by what means something in XML."""
    chance, out = Random(seed), bytearray(data)
    words = (
        b"<",
        b">",
        b"&",
        b'"',
        b"\0",
        b"]]>",
        b"<![CDATA[",
        b"<!--",
        b"&#0;",
        b"&#x110000;",
        b"\xff",
        b"Samples",
        b'sequence="9e9"',
    )
    for _ in range(chance.randint(1, 8)):
        place = chance.randrange(len(out) + 1)
        end = min(place + chance.randrange(60), len(out))
        match chance.randrange(3):
            case 0:
                del out[place:end]
            case 1:
                out[place:place] = out[place:end]
            case _:
                out[place:place] = chance.choice(words)
    return bytes(out)


@FUZZ
@given(st.integers(0, 2**32))
def test_a_damaged_document_is_read_or_refused(seed: int) -> None:
    with suppress(DocumentError):
        parse_document(damaged(STREAM, seed))


@FUZZ
@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    with suppress(DocumentError):
        parse_document(data)


def stream(parts: list[bytes], *, with_length: bool) -> bytes:
    """As an agent sends them."""
    out = b""
    for part in parts:
        out += b"--b\r\nContent-type: text/xml\r\n" + (b"Content-length: %d\r\n" % len(part) if with_length else b"") + b"\r\n"
        out += part + b"\r\n"
    return out + b"--b--\r\n"


@FUZZ
@given(st.lists(st.binary(max_size=40).filter(lambda part: b"--b" not in part), max_size=5), st.booleans(), st.integers(0, 2**32))
def test_however_a_stream_is_cut_into_reads_the_parts_are_the_same(parts: list[bytes], with_length: bool, seed: int) -> None:
    chance, parser, data = Random(seed), MultipartParser("multipart/mixed; boundary=b"), stream(parts, with_length=with_length)
    found: list[bytes] = []
    while data:
        size = chance.randint(1, 30)
        found += parser.feed(data[:size])
        data = data[size:]
    expected = parts if with_length else [part.removesuffix(b"\r") for part in parts]
    assert [part.removesuffix(b"\r") for part in found] == [part.removesuffix(b"\r") for part in expected]


@FUZZ
@given(st.integers(0, 2**32))
def test_a_damaged_stream_gives_parts_or_an_error(seed: int) -> None:
    parser = MultipartParser("multipart/mixed; boundary=b")
    with suppress(ConnectionLostError):
        for byte in damaged(stream([STREAM, b"<a/>"], with_length=bool(seed % 2)), seed):
            parser.feed(bytes([byte]))


def test_a_part_without_an_end_is_searched_once_and_not_again_with_each_read() -> None:
    parser = MultipartParser("multipart/mixed; boundary=b", part_bytes_max=16 * 2**20)
    parser.feed(b"--b\r\n\r\n")
    with within(5.0, 40.0), pytest.raises(ConnectionLostError, match="part of more than"):
        for _ in range(20_000):
            parser.feed(b"\n" * 1000)


@pytest.mark.parametrize("data", [b"x" * (HEAD_BYTES_MAX + 100), b"--b\r\n" + b"h" * (HEAD_BYTES_MAX + 100)])
def test_a_head_without_an_end_is_given_up(data: bytes) -> None:
    with within(1.0, 2.0), pytest.raises(ConnectionLostError):
        MultipartParser("multipart/mixed; boundary=b").feed(data)


def test_a_part_that_announces_too_much_is_refused_before_it_comes() -> None:
    with within(1.0, 1.0), pytest.raises(ConnectionLostError, match="part of 999999999999 bytes"):
        MultipartParser("multipart/mixed; boundary=b").feed(b"--b\r\nContent-length: 999999999999\r\n\r\n")
