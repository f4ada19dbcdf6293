"""A remembered layout says exactly what the long way says, or nothing."""

from __future__ import annotations

import struct
from random import Random
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sparkplug.admission.gate import Gate
from sparkplug.codec import encode, parse
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.host_session import HostEvent, HostSession
from sparkplug.layouts.layout import Layout, Packed
from sparkplug.layouts.memory import Memory, Room
from sparkplug.layouts.route import Route
from sparkplug.metric import Reading
from sparkplug.node_picture import NodePicture, tells_quality
from sparkplug.records.named import NamedPayloads, handed_on
from sparkplug.sequence import SequenceWindow
from sparkplug.topics import NodeId
from sparkplug.values import Metric, Payload, PropertyValue

NODE = NodeId("cnc", "edge")
START_MS = 1_790_000_000_000
QUICK = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
# Declared in this order, with the aliases 0, 1, 2, …; the last one has none.
TYPES = (
    DataType.DOUBLE,
    DataType.FLOAT,
    DataType.BOOLEAN,
    DataType.INT8,
    DataType.INT32,
    DataType.INT64,
    DataType.UINT64,
    DataType.STRING,
    DataType.UNKNOWN,
    DataType.DOUBLE,
)
# The field in which a peer sends each type: its tag and what makes its content.
VARINT, LENGTH = 0, 2


def varint(value: int, padding: int = 0) -> bytes:
    """A varint; `padding` adds bytes that say nothing."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    for _ in range(min(padding, 10 - len(out))):
        out[-1] |= 128
        out.append(0)
    return bytes(out)


def field(number: int, wire: int, content: bytes) -> bytes:
    """A field with its tag."""
    size = varint(len(content)) if wire == LENGTH else b""
    return varint(number << 3 | wire) + size + content


def properties(quality: int) -> bytes:
    """A property set with a quality, as a peer writes it."""
    whole = parse(encode(Payload(1, (Metric("m", None, properties={"Quality": PropertyValue(DataType.INT32, quality)}),))))
    data: bytes = whole.metrics[0].properties.SerializeToString()
    return data


WHOLE = st.one_of(st.integers(0, 200), st.integers(0, 2**64 - 1)).flatmap(
    lambda value: st.builds(varint, st.just(value), st.sampled_from([0, 0, 0, 1, 9]))
)
TEXT = st.one_of(st.text(max_size=4).map(str.encode), st.binary(max_size=4), st.sampled_from([b"Quality", b"reason"]))
FLAG = st.sampled_from([b"\x00", b"\x01", b"\x01", b"\x81\x00"])
STAMP = st.one_of(
    st.just(varint(START_MS + 5)),
    st.integers(START_MS, START_MS + 20).map(varint),
    st.sampled_from([b"\x00", varint(START_MS, 1), b"\x80\x80\x80\x80\x80\x00", varint(2**64 - 1)]),
)
VALUES: dict[int, tuple[int, st.SearchStrategy[bytes]]] = {
    10: (0, WHOLE),
    11: (0, WHOLE),
    12: (5, st.binary(min_size=4, max_size=4)),
    13: (1, st.one_of(st.floats().map(lambda x: struct.pack("<d", x)), st.binary(min_size=8, max_size=8))),
    14: (0, FLAG),
    15: (2, TEXT),
}
USUAL = {
    DataType.DOUBLE: 13,
    DataType.FLOAT: 12,
    DataType.BOOLEAN: 14,
    DataType.INT8: 10,
    DataType.INT32: 10,
    DataType.INT64: 11,
    DataType.UINT64: 11,
    DataType.STRING: 15,
    DataType.UNKNOWN: 10,
}
ODD = (
    b"",
    field(5, VARINT, b"\x01"),
    field(6, VARINT, b"\x01"),
    field(7, VARINT, b"\x01"),
    field(4, VARINT, b"\x0a"),
    field(9, LENGTH, properties(0)),
    field(9, LENGTH, properties(192)),
    field(9, LENGTH, properties(7)),
    field(9, LENGTH, b"\x0a\x01k"),  # a key without a value
    field(8, LENGTH, b"\x1a\x00"),
    field(8, LENGTH, b""),
    field(2, VARINT, b"\x01"),  # perhaps a second alias
    field(3, VARINT, varint(START_MS)),
    field(13, 1, bytes(8)),  # perhaps a second value
    field(16, LENGTH, b"ab"),
    field(20, VARINT, b"\x05"),
    field(20, LENGTH, b"abc"),
    b"\xa3\x01\xa4\x01",  # a group
    b"\x82\x00",  # a tag of two bytes where one would do
)


@st.composite
def metrics(draw: st.DrawFn, odd: st.SearchStrategy[bool]) -> bytes:
    """A metric as some peer may send it."""
    place = draw(st.integers(0, len(TYPES) - 1))
    by_name = place == len(TYPES) - 1 or draw(st.booleans())
    number = USUAL[TYPES[place]] if not draw(odd) else draw(st.sampled_from(sorted(VALUES)))
    wire, contents = VALUES[number]
    parts = [field(1, LENGTH, f"m{place}".encode()) if by_name else field(2, VARINT, varint(place))]
    parts.append(field(3, VARINT, draw(STAMP)) if not draw(odd) else b"")
    parts.append(field(number, wire, draw(contents)) if not draw(odd) else b"\x38\x01")
    if draw(odd):
        parts.append(draw(st.sampled_from(ODD)))
        parts = draw(st.permutations(parts))
    return b"".join(parts)


@st.composite
def payloads(draw: st.DrawFn) -> bytes:
    """A data message, most often an ordinary one."""
    odd = st.just(False) if draw(st.booleans()) else st.integers(0, 9).map(lambda n: n == 0)
    parts = [field(1, VARINT, draw(STAMP))]
    parts += [field(2, LENGTH, metric) for metric in draw(st.lists(metrics(odd), max_size=4))]
    parts.append(field(3, VARINT, varint(draw(st.integers(0, 255)), int(draw(odd)))))
    if draw(odd):
        parts.append(
            draw(st.sampled_from([b"", field(4, LENGTH, b"id"), field(5, LENGTH, b"x"), field(9, VARINT, b"\x01"), b"\x08"]))
        )
        parts = draw(st.permutations(parts))
    return b"".join(parts)


def picture() -> NodePicture:
    born = NodePicture(NODE)
    declared = [Metric(f"m{i}", None, t, START_MS, i if i < len(TYPES) - 1 else None) for i, t in enumerate(TYPES)]
    born.own.bear(parse(encode(Payload(START_MS, tuple(declared)))), START_MS, born.holders)
    return born


def bits(readings: tuple[Reading, ...]) -> list[Any]:
    """Return what two readings have to share: NaN with its bits, the sign of zero, and the type of each value."""
    return [
        (type(r.value), struct.pack("<d", r.value) if isinstance(r.value, float) else r.value, r[:1] + r[2:]) for r in readings
    ]


def long_way(born: NodePicture, payload: bytes) -> tuple[Any, tuple[Reading, ...], bool]:
    message = parse(payload)
    stamp_ms = message.timestamp or START_MS
    readings, complete = born.read_data(born.own, message, stamp_ms, may_tell_quality=tells_quality(payload))
    return message, tuple(readings), complete


def learnt(born: NodePicture, payload: bytes) -> tuple[Layout, Memory] | None:
    """The layout of a payload, and the memory of nothing else, where it is learnt."""
    try:
        message, readings, complete = long_way(born, payload)
    except PayloadError:
        return None
    if not complete or not readings:
        return None
    memory = Memory(Room())
    route = Route(born, SequenceWindow(1000), born.own, None, memory, Gate())
    names = () if any(reading.is_historical for reading in readings) else tuple(reading.name for reading in readings)
    route.learn(payload, message, readings, names)
    found = memory.read(payload)
    return None if found is None else (found[0], memory)


def changed(layout: Layout, payload: bytes, seed: int) -> bytes:
    """Other values in the same places, and now and then anything anywhere."""
    chance, out = Random(seed), bytearray(payload)
    mask = layout.mask.to_bytes(len(payload), "little")
    for at, fixed in enumerate(mask):
        if fixed == 0 and chance.random() < 0.5:
            out[at] = chance.randrange(256)
        elif fixed == 0x80 and chance.random() < 0.5:
            out[at] ^= chance.randrange(128)
    if layout.first_at and chance.random() < 0.8:  # then the time stamps have to stay equal
        width = layout.first_end - layout.first_at
        stamp, places = out[layout.first_at : layout.first_end], layout.spread
        stamp[0] ^= chance.randrange(128)
        while places:
            at = (places & -places).bit_length() // 8
            out[at : at + width] = stamp
            places &= places - 1
    for _ in range(chance.choice((0, 0, 0, 1, 2))):
        out[chance.randrange(len(out))] ^= 1 << chance.randrange(8)
    match chance.randrange(8):
        case 0:
            out += chance.randbytes(1)
        case 1:
            del out[chance.randrange(len(out))]
    return bytes(out)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=400)
@given(payloads(), st.lists(st.integers(0, 2**32), min_size=20, max_size=20))
def test_a_layout_reads_what_the_long_way_reads_or_nothing(payload: bytes, seeds: list[int]) -> None:
    born = picture()
    known = learnt(born, payload)
    if known is None:
        return
    layout, memory = known
    for data in (payload, *(changed(layout, payload, seed) for seed in seeds)):
        found = memory.read(data)
        if found is None:
            continue
        message, readings, complete = long_way(born, data)
        stamp_ms, seq, values, stamps_ms, oldest_ms, newest_ms = found[1]
        assert complete
        assert (stamp_ms, seq) == (message.timestamp, message.seq)
        assert bits(layout.readings(values, stamps_ms)) == bits(readings)
        assert (oldest_ms, newest_ms) == (min(r.timestamp_ms for r in readings), max(r.timestamp_ms for r in readings))
        assert layout.names == tuple(r.name for r in readings)
        if layout.pieces is None:
            continue
        handed = NamedPayloads().read(handed_on(Packed(layout, data)))
        assert (handed.timestamp_ms, handed.seq) == (stamp_ms, seq)
        assert bits(handed.readings) == bits(readings)
        assert (handed.names, handed.oldest_ms, handed.newest_ms) == (layout.names, oldest_ms, newest_ms)


@QUICK
@given(st.lists(st.sampled_from(range(len(TYPES))), min_size=1, max_size=6), st.booleans(), st.data())
def test_ordinary_messages_are_learnt_and_known_again(places: list[int], together: bool, data: st.DataObject) -> None:
    born = picture()

    def message() -> bytes:
        parts = [field(1, VARINT, varint(START_MS + data.draw(st.integers(0, 9))))]
        for count, place in enumerate(places):
            number = USUAL[TYPES[place]]
            if number == 15:
                content = data.draw(st.text("abc", min_size=2, max_size=2)).encode()
            elif number in (10, 11):
                content = varint(data.draw(st.integers(128, 16383)))
            else:
                content = data.draw(VALUES[number][1].filter(lambda raw: len(raw) != 2))
            stamp = varint(START_MS + (0 if together else count + data.draw(st.integers(0, 9))))
            who = field(1, LENGTH, f"m{place}".encode()) if place == len(TYPES) - 1 else field(2, VARINT, varint(place))
            parts.append(field(2, LENGTH, who + field(3, VARINT, stamp) + field(number, VALUES[number][0], content)))
        return b"".join(parts) + field(3, VARINT, varint(data.draw(st.integers(0, 127))))

    known = learnt(born, message())
    assert known is not None
    layout, memory = known
    assert (layout.pieces is None) == any(TYPES[place] is DataType.UNKNOWN for place in places)
    for _ in range(3):
        again = message()
        found = memory.read(again)
        if found is None:
            assert not together and layout.first_at, "only time stamps that are no longer equal make it another layout"
            continue
        assert bits(layout.readings(found[1][2], found[1][3])) == bits(long_way(born, again)[1])


# The same through a session: one that learns beside one that has no room for layouts, and one that leaves messages packed.


class Three:
    """Three hosts that hear the same."""

    def __init__(self) -> None:
        self.hosts = [HostSession("scada", chance=Random(0), packs=place == 2) for place in range(3)]
        self.hosts[1]._room.left = 0
        self.now_ms = START_MS
        for host in self.hosts:
            host.connecting(self.now_ms)
            host.connected(self.now_ms)

    def hear(self, topic: str, payload: bytes) -> list[HostEvent]:
        self.now_ms += 10
        quick, plain, packed = (host.message(topic, payload, self.now_ms) for host in self.hosts)
        for others in (plain, packed):
            bare = [event._replace(readings=(), packed=None) for event in others]
            assert [event._replace(readings=()) for event in quick] == bare
            assert [bits(event.readings) for event in quick] == [bits(event.read()) for event in others]
        self.compare()
        return quick

    def tick(self, by_ms: int) -> None:
        self.now_ms += by_ms
        quick, *others = (repr(host.tick(self.now_ms)) for host in self.hosts)
        assert others == [quick, quick]

    def compare(self) -> None:
        quick, *others = self.hosts
        for other in others:
            assert quick.counts == other.counts
            assert quick.actions == other.actions

    def compare_pictures(self) -> None:
        known = []
        for host in self.hosts:
            born = host.picture(NODE)
            assert born is not None
            known.append([(device, owner.online, bits(tuple(owner.readings.values()))) for device, owner in born.owners()])
        assert known[0] == known[1] == known[2]


def birth(*, device: str | None, seq: int, stamp_ms: int, first_alias: int, turned: bool) -> bytes:
    """A birth; `turned` gives the aliases to the metrics in another order."""
    aliases = list(range(first_alias, first_alias + len(TYPES)))
    if turned:
        aliases = aliases[-1:] + aliases[:-1]
    declared = [Metric(f"m{i}", None, t, stamp_ms, a) for (i, t), a in zip(enumerate(TYPES), aliases, strict=True)]
    if device is None:
        declared.append(Metric("bdSeq", 0, DataType.INT64, stamp_ms))
    return encode(Payload(stamp_ms, tuple(declared), seq=seq))


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=60)
@given(st.integers(0, 2**32))
def test_hosts_with_layouts_say_what_a_host_without_says(seed: int) -> None:
    chance, hosts, seq = Random(seed), Three(), 0
    stamp_ms = START_MS
    known: list[tuple[int, ...]] = [tuple(chance.sample(range(9), chance.randint(1, 4))) for _ in range(3)]

    def counted() -> int:
        nonlocal seq
        seq = (seq + 1) % 256
        return seq

    def born(verb: str) -> None:
        nonlocal seq
        turned = chance.random() < 0.5
        if verb == "NBIRTH":
            seq = 0
            hosts.hear("spBv1.0/cnc/NBIRTH/edge", birth(device=None, seq=0, stamp_ms=stamp_ms, first_alias=0, turned=turned))
        for device in ("a", "b"):
            # Now and then with aliases of the node or of the other device.
            first = chance.choice((5, 35)) if chance.random() < 0.2 else {"a": 20, "b": 40}[device]
            data = birth(device=device, seq=counted(), stamp_ms=stamp_ms, first_alias=first, turned=turned)
            hosts.hear(f"spBv1.0/cnc/DBIRTH/edge/{device}", data)

    born("NBIRTH")
    for _ in range(120):
        stamp_ms += chance.choice((0, 10, 10, 100))
        what = chance.random()
        if what < 0.02:
            born(chance.choice(("NBIRTH", "DBIRTH")))
            continue
        if what < 0.03:
            hosts.hear("spBv1.0/cnc/NDEATH/edge", encode(Payload(stamp_ms, (Metric("bdSeq", 0, DataType.INT64, stamp_ms),))))
            continue
        if what < 0.04:
            hosts.hear("spBv1.0/cnc/DDEATH/edge/a", encode(Payload(stamp_ms, (), seq=counted())))
            continue
        if what < 0.06:
            hosts.tick(chance.choice((100, 3000)))
            hosts.compare_pictures()
            continue
        device = chance.choice((None, "a", "a", "b"))
        first = {None: 0, "a": 20, "b": 40}[device]
        message = []
        for place in chance.choice(known):
            value: Any = chance.choice((None, True, 3, 1000, -0.0, 2.5, float("nan"), "abc", "größer"))
            datatype = {bool: 11, int: 3, float: 10, str: 12}.get(type(value), 10)
            old = chance.random() < 0.02
            message.append(Metric(None, value, DataType(datatype), stamp_ms, first + place, is_historical=old))
        number = counted()
        if chance.random() < 0.02:
            number = counted()  # a hole
        payload = encode(Payload(stamp_ms - (5000 if chance.random() < 0.02 else 0), tuple(message), seq=number))
        topic = "spBv1.0/cnc/NDATA/edge" if device is None else f"spBv1.0/cnc/DDATA/edge/{device}"
        hosts.hear(topic, payload)
        if chance.random() < 0.02:
            hosts.hear(topic, payload)
    hosts.compare_pictures()
