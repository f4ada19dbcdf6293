"""The memory of layouts is bounded; a layout is learnt where it pays."""

from random import Random

from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.host_session import HostSession
from sparkplug.layouts.memory import AT_ONCE_MAX, HITS_A_LAYOUT, LAYOUTS_A_LENGTH_MAX, LENGTHS_MAX, MISSES_A_LAYOUT, Memory, Room
from sparkplug.metric import NodeId
from sparkplug.values import Metric, Payload

NODE = NodeId("cnc", "edge")
START_MS = 1_790_000_000_000
NAMES = tuple(f"m{i}" for i in range(60))


class Plant:
    """A host, and an edge node with sixty metrics."""

    def __init__(self) -> None:
        self.host = HostSession("scada", chance=Random(0))
        self.host.connected(START_MS)
        self.stamp_ms = START_MS
        self.born()

    def born(self) -> None:
        self.seq, self.stamp_ms = 0, self.stamp_ms + 1
        declared = tuple(Metric(name, 0.0, DataType.DOUBLE, self.stamp_ms, alias) for alias, name in enumerate(NAMES))
        bd_seq = Metric("bdSeq", 0, DataType.INT64, self.stamp_ms)
        self.host.message("spBv1.0/cnc/NBIRTH/edge", encode(Payload(self.stamp_ms, (*declared, bd_seq), seq=0)), self.stamp_ms)

    def say(self, *aliases: int) -> tuple[str, ...]:
        """A message of these metrics; hands back the names of its event."""
        self.seq, self.stamp_ms = (self.seq + 1) % 100, self.stamp_ms + 1
        if not self.seq:
            self.born()
            self.seq = 1
        message = tuple(Metric(None, 1.5, DataType.DOUBLE, self.stamp_ms, alias) for alias in aliases)
        (event,) = self.host.message(
            "spBv1.0/cnc/NDATA/edge", encode(Payload(self.stamp_ms, message, seq=self.seq)), self.stamp_ms
        )
        assert [reading.name for reading in event.readings] == [NAMES[alias] for alias in aliases]
        assert (event.oldest_ms, event.newest_ms) == (self.stamp_ms, self.stamp_ms)
        return event.names

    @property
    def memory(self) -> Memory:
        return self.host._routes["spBv1.0/cnc/NDATA/edge"].layouts


def sizes(memory: Memory) -> list[int]:
    return [len(layouts) for layouts in memory._by_length.values()]


def test_messages_of_one_layout_share_their_names_however_they_were_read() -> None:
    plant = Plant()
    first = plant.say(1, 2)
    other = plant.say(3, 4)
    assert plant.memory._hits == 0
    assert plant.say(1, 2) is first and plant.say(3, 4) is other
    assert plant.memory._hits == 2


def test_layouts_of_one_length_are_few_and_the_one_that_matched_last_is_first() -> None:
    plant = Plant()
    for alias in range(AT_ONCE_MAX):
        plant.say(alias)
    assert sizes(plant.memory) == [LAYOUTS_A_LENGTH_MAX]
    plant.say(AT_ONCE_MAX - 2)
    (layouts,) = plant.memory._by_length.values()
    assert layouts[0].names == (NAMES[AT_ONCE_MAX - 2],)
    assert len(layouts) == LAYOUTS_A_LENGTH_MAX


def test_lengths_are_bounded_and_their_room_is_given_back() -> None:
    plant = Plant()
    empty = Room().left
    for count in range(1, LENGTHS_MAX + 9):
        for _ in range(2 + HITS_A_LAYOUT):
            plant.say(*range(count))
        memory = plant.memory
        assert len(memory._by_length) <= LENGTHS_MAX
        held = sum(layout.size for layouts in memory._by_length.values() for layout in layouts)
        assert plant.host._room.left == empty - held
    plant.born()
    assert sizes(plant.memory) == []
    assert plant.host._room.left == empty


def test_a_stream_that_never_repeats_is_seldom_learnt() -> None:
    plant, chance = Plant(), Random(0)
    plant.say(1)
    memory, learnt = plant.memory, 0
    for _ in range(90):
        before = memory._learnt
        plant.say(*chance.sample(range(60), 20))
        learnt += memory._learnt - before
    assert memory._hits == 0
    assert AT_ONCE_MAX <= learnt + 1 <= AT_ONCE_MAX + 90 // MISSES_A_LAYOUT


def test_without_room_nothing_is_learnt_and_all_is_read() -> None:
    plant = Plant()
    plant.host._room.left = 0
    for _ in range(5):
        plant.say(1, 2)
    assert sizes(plant.memory) == []
    assert plant.host.counts["data"] == 5


def test_a_dead_node_keeps_no_layouts() -> None:
    plant = Plant()
    plant.say(1, 2)
    assert sizes(plant.memory) == [1]
    plant.host.message("spBv1.0/cnc/NDEATH/edge", encode(Payload(plant.stamp_ms, (Metric("bdSeq", 0, DataType.INT64, 1),))), 1)
    assert sizes(plant.memory) == []
    assert plant.host._room.left == Room().left


def test_an_alias_that_another_birth_takes_too_is_still_the_nodes_in_its_own_messages() -> None:
    plant = Plant()
    for _ in range(3):
        plant.say(1)
    assert plant.memory._hits == 2
    birth = encode(Payload(plant.stamp_ms, (Metric("taken", 0.0, DataType.DOUBLE, plant.stamp_ms, alias=1),), seq=plant.seq + 1))
    plant.host.message("spBv1.0/cnc/DBIRTH/edge/a", birth, plant.stamp_ms)
    data = encode(Payload(plant.stamp_ms, (Metric(None, 1.5, DataType.DOUBLE, plant.stamp_ms, 1),), seq=plant.seq + 2))
    (event,) = plant.host.message("spBv1.0/cnc/NDATA/edge", data, plant.stamp_ms)
    assert [(reading.name, reading.value) for reading in event.readings] == [("m1", 1.5)]
    data = encode(Payload(plant.stamp_ms, (Metric(None, 2.5, DataType.DOUBLE, plant.stamp_ms, 1),), seq=plant.seq + 3))
    (event,) = plant.host.message("spBv1.0/cnc/DDATA/edge/a", data, plant.stamp_ms)
    assert [(reading.name, reading.value) for reading in event.readings] == [("taken", 2.5)]
    assert plant.host.counts["sloppy_aliases"] == 1
    assert plant.host.counts["unknown_metrics"] == 0
