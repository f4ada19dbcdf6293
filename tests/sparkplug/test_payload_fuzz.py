"""Payloads that somebody means ill with: whatever comes, a host says PayloadError at most, soon, and in little memory."""

from contextlib import suppress
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.arrays import ELEMENTS_MAX, unpack
from sparkplug.codec import PARTS_MAX, PAYLOAD_BYTES_MAX, decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.host_session import HostSession
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Verb
from sparkplug.values import Metric, Payload
from tests.fuzz_depth import FUZZ, within
from tests.sparkplug.everything import EVERYTHING

SIZE = PAYLOAD_BYTES_MAX - 100
ALL_OF_IT = encode(EVERYTHING)
CPU_S, PEAK_MB = 10.0, 100.0


def length(size: int) -> bytes:
    """A protobuf varint."""
    out = b""
    while size > 127:
        out, size = out + bytes([size & 127 | 128]), size >> 7
    return out + bytes([size])


def inside(tag: bytes, content: bytes) -> bytes:
    """A field of bytes or a message."""
    return tag + length(len(content)) + content


def value_of_a_metric(tag: bytes, datatype: DataType, content: bytes) -> bytes:
    return inside(b"\x12", b"\x20" + bytes([datatype]) + inside(tag, content))


FLOODS = {
    "metrics": b"\x12\x00" * (SIZE // 2),
    "properties": value_of_a_metric(b"\x4a", DataType.INT8, b"\x0a\x00" * (SIZE // 8) + b"\x12\x02\x08\x03" * (SIZE // 8)),
    "property sets": value_of_a_metric(
        b"\x4a", DataType.INT8, b"\x0a\x00" + inside(b"\x12", inside(b"\x4a", b"\x0a\x00" * (SIZE // 3)))
    ),
    "rows": value_of_a_metric(b"\x8a\x01", DataType.DATASET, b"\x22\x00" * (SIZE // 2)),
    "cells": value_of_a_metric(b"\x8a\x01", DataType.DATASET, inside(b"\x22", b"\x0a\x00" * (SIZE // 2))),
    "columns": value_of_a_metric(b"\x8a\x01", DataType.DATASET, b"\x12\x00" * (SIZE // 2)),
    "template": value_of_a_metric(b"\x92\x01", DataType.TEMPLATE, b"\x12\x00" * (SIZE // 2)),
    "parameters": value_of_a_metric(b"\x92\x01", DataType.TEMPLATE, b"\x1a\x00" * (SIZE // 2)),
}


@pytest.mark.parametrize("flood", FLOODS)
def test_a_flood_of_empty_parts_is_refused_before_anything_is_made_of_it(flood: str) -> None:
    assert len(FLOODS[flood]) < PAYLOAD_BYTES_MAX
    with within(CPU_S, PEAK_MB), pytest.raises(PayloadError, match=r"more than 100000|no Sparkplug payload"):
        parse(FLOODS[flood])


def test_as_many_parts_as_a_large_machine_has_are_taken() -> None:
    many = Payload(0, tuple(Metric(f"axis/{number}", float(number), DataType.DOUBLE) for number in range(PARTS_MAX)))
    assert len(decode(encode(many)).metrics) == PARTS_MAX


@pytest.mark.parametrize("depth", [16, 17, 50, 99, 101, 10_000])
def test_templates_in_templates_end_somewhere(depth: int) -> None:
    data = b""
    for _ in range(depth):
        data = b"\x20\x13" + inside(b"\x92\x01", b"\x1a\x01T" + inside(b"\x12", data)) if data else b"\x20\x03\x50\x01"
        if len(data) > SIZE:
            break
    with within(CPU_S, PEAK_MB), suppress(PayloadError):
        decode(inside(b"\x12", data))


@pytest.mark.parametrize(
    ("datatype", "data"),
    [
        (DataType.BOOLEAN_ARRAY, (8 * 500_000).to_bytes(4, "little") + bytes(500_000)),
        (DataType.BOOLEAN_ARRAY, b"\xff\xff\xff\xff" + bytes(100)),
        (DataType.STRING_ARRAY, bytes(ELEMENTS_MAX + 1)),
        (DataType.INT8_ARRAY, bytes(ELEMENTS_MAX + 1)),
    ],
)
def test_arrays_do_not_unfold_without_end(datatype: DataType, data: bytes) -> None:
    with within(CPU_S, PEAK_MB), pytest.raises(PayloadError):
        unpack(datatype, data)


@pytest.mark.parametrize("data", [b"\x12\xff\xff\xff\xff\x0f", b"\x12\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", b"\x0a" * 1000])
def test_a_length_beyond_the_end_asks_for_no_memory(data: bytes) -> None:
    with within(1.0, 1.0), pytest.raises(PayloadError):
        parse(data)


def damaged(data: bytes, seed: int) -> bytes:
    """Bytes set, cut out, doubled and swapped, a few at a time."""
    chance, out = Random(seed), bytearray(data)
    for _ in range(chance.randint(1, 6)):
        place, end = sorted((chance.randrange(len(out) + 1), chance.randrange(len(out) + 1)))
        match chance.randrange(4):
            case 0 if place < len(out):
                out[place] = chance.randrange(256)
            case 1:
                del out[place : min(end, place + 8)]
            case 2:
                out[place:place] = out[place:end]
            case _:
                out[place:place] = chance.randbytes(4)
    return bytes(out[:SIZE])


@FUZZ
@given(st.integers(0, 2**32))
def test_a_damaged_payload_is_read_or_refused(seed: int) -> None:
    with suppress(PayloadError):
        decode(damaged(ALL_OF_IT, seed))


def host() -> HostSession:
    session = HostSession("scada", chance=Random(0))
    session.connecting(0)
    session.connected(0)
    return session


@FUZZ
@given(st.lists(st.tuples(st.sampled_from([verb.value for verb in Verb]), st.integers(0, 2**32), st.booleans()), max_size=30))
def test_no_sequence_of_damaged_messages_breaks_a_host(messages: list[tuple[str, int, bool]]) -> None:
    """Alone an edge can do no more than this; the next whole birth is taken as if nothing had been."""
    session, now_ms = host(), 1_000_000
    for verb, seed, is_whole in messages:
        now_ms += 1000
        topic = f"spBv1.0/cnc/{verb}/evil" + ("/device" if verb.startswith("D") else "")
        session.message(topic, ALL_OF_IT if is_whole else damaged(ALL_OF_IT, seed), now_ms)
        session.tick(now_ms)
    birth = PayloadMessage(timestamp=now_ms + 10_000_000, seq=0)
    birth.metrics.add(name="bdSeq", datatype=DataType.INT64, long_value=77)
    birth.metrics.add(name="load", datatype=DataType.DOUBLE, double_value=37.5)
    session.message("spBv1.0/cnc/NBIRTH/good", birth.SerializeToString(), now_ms + 10_000_000)
    picture = next(session.picture(node) for node in session.nodes() if node.node == "good")
    assert picture is not None and picture.own.readings["load"].value == 37.5


@FUZZ
@given(st.text(max_size=60), st.binary(max_size=60))
def test_no_topic_and_no_state_breaks_a_host(topic: str, payload: bytes) -> None:
    session = host()
    for whole in (topic, f"spBv1.0/{topic}", f"spBv1.0/STATE/{topic}", "spBv1.0/STATE/scada"):
        session.message(whole, payload, 1)
