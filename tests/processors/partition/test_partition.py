"""A partition that is killed anywhere comes to the states, and tells the results, of one that never was."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from processors.actions import Action
from processors.discovery import AnyProcessor, discover
from processors.partition.partition import Partition
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.records.record import Origin, Record, RecordReader, RecordWriter
from tests.depth import examples
from tests.processors.describing import DESCRIBING, message
from tests.processors.streams import T0_MS, birth, data, death, wild_stream

Kept = dict[str, bytes]
Told = list[tuple[int, str, Action]]
every_processor = pytest.mark.parametrize("processor", discover().values(), ids=discover().keys())
quickly = settings(
    max_examples=examples(40, 12), deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def through_bytes(events: Sequence[HostEvent | None], writer_of: Callable[[int], str] = lambda _: "bridge") -> list[Record]:
    """The records of events as a reader of the log has them; None is a watermark. A second passes between two. `writer_of`: the
    bridge that writes the record of a number."""
    reader = RecordReader()
    records = []
    for place, event in enumerate(events):
        writer = RecordWriter(writer_of(place))
        at_ms = T0_MS + 1000 * place
        if event is None:
            records.append(reader.read(writer.watermark(at_ms), None))
        else:
            records.append(reader.read(*writer.written(event, at_ms, Origin(0, 1, place % 256))))
    return records


def log_of(length: int, seed: int) -> list[Record]:
    """A log of anything that two bridges could ever write."""
    chance = Random(seed)
    events: list[HostEvent | None] = []
    for event in wild_stream(length, seed):
        if event.device is not None or event.kind is EventKind.HOLE:
            events.append(event if event.device is not None else event._replace(device="okuma"))
        if chance.random() < 0.3:
            events.append(None)
    return through_bytes(events, lambda _: chance.choice(("bridge-0", "bridge-1")))


def partition_of(processor: AnyProcessor) -> Partition:
    return Partition("test", [(processor, processor.configured({}))])


def saved(partition: Partition, kept: Kept) -> None:
    for key, payload in partition.cut():
        if payload is None:
            kept.pop(key, None)
        else:
            kept[key] = payload


def states(partition: Partition) -> dict[str, bytes]:
    """The states of all units as they are saved, whether they have changed or not."""
    return {
        f"{seat.name}/{unit}": seat.state_of(unit).replace(b'"births_are_old":true', b'"births_are_old":false')
        for seat in partition.seats
        for unit in seat.engine.known_units
    }


def run(processor: AnyProcessor, records: Sequence[Record], chance: Random | None = None) -> tuple[Told, dict[str, bytes]]:
    """Fold a log; with `chance` commit, cut and be killed now and then. What was told counts once it is committed."""
    partition, kept, told, waiting = partition_of(processor), dict[str, bytes](), Told(), Told()
    offset = partition.restore(kept)
    while offset < len(records):
        waiting += [(offset, r.seat.name, action) for r in partition.take(offset, records[offset]) for action in r.actions]
        offset += 1
        fate = 1.0 if chance is None else chance.random()
        if fate < 0.4:  # a transaction
            if fate < 0.15:
                saved(partition, kept)
            key, marker = partition.mark()
            kept[key] = marker
            told += waiting
            waiting = []
        elif fate < 0.55:  # a kill
            partition, waiting = partition_of(processor), []
            offset = partition.restore(kept)
    return told + waiting, states(partition)


@every_processor
@quickly
@given(length=st.integers(0, 25), seed=st.integers(0, 2**32), kills=st.integers(0, 2**32))
def test_killed_anywhere_it_tells_the_same_and_comes_to_the_same(
    processor: AnyProcessor, length: int, seed: int, kills: int
) -> None:
    records = log_of(length, seed)
    assert run(processor, records, Random(kills)) == run(processor, records)


def test_of_several_bridges_the_one_that_hears_a_machine_tells_its_silence() -> None:
    """While that bridge is down the machine's clock stands still, so data that the bridge delivers later is not late."""
    start = birth(0.0, spindle_rpm=0.0, ambient_temp_c=21.5, spindle_temp_c=24.0)
    told = [data(1.0 + i, spindle_rpm=4000.0) for i in range(3)]
    writer_of = lambda place: "other" if 4 <= place < 60 else "own"  # noqa: E731
    records = through_bytes([start, *told, *[None] * 100], writer_of)
    partition = partition_of(discover()["thermal"])
    partition.restore({})
    clocks_ms = []
    for place, record in enumerate(records):
        partition.take(place, record)
        clocks_ms.append(partition.seats[0].engine.known_units["okuma"].machines["okuma"].live.clock_ms)
    assert set(clocks_ms[3:60]) == {T0_MS + 3000}
    assert clocks_ms[60] > T0_MS + 50_000, "its own bridge tells the silence at once"
    kept: Kept = {}
    saved(partition, kept)
    key, marker = partition.mark()
    again = partition_of(discover()["thermal"])
    again.restore(kept | {key: marker})
    assert again._writers == partition._writers == {"okuma": "own"}


def shift() -> list[Record]:
    """A shift in short, with silence in it."""
    start = birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=21.5, spindle_temp_c=24.0, tool_number=1)
    cuts = [data(1.0 + i, spindle_rpm=4000.0 + 10 * i, spindle_load_pct=20.0 + i % 7) for i in range(60)]
    again = [death(100.0), birth(130.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=21.6, tool_number=2)]
    return through_bytes([start, *cuts, *[None] * 40, *again, data(150.3, spindle_rpm=100.0), *[None] * 5])


@every_processor
@pytest.mark.parametrize("kills", range(5))
def test_a_shift_with_kills_is_the_shift_without(processor: AnyProcessor, kills: int) -> None:
    told, state = run(processor, shift())
    assert (told, state) == run(processor, shift(), Random(kills))


@every_processor
@quickly
@given(length=st.integers(0, 40), seed=st.integers(0, 2**32))
def test_the_shortest_ways_tell_the_same_and_come_to_the_same(processor: AnyProcessor, length: int, seed: int) -> None:
    records = [*shift()[:30], *log_of(length, seed), *shift()]
    named = [record for record in records if record.event is not None and record.event.names]
    assert len(named) > 20, "the log holds no data that could take a short way"
    without = [record if record.event is None else record._replace(event=record.event._replace(names=())) for record in records]
    assert run(processor, records) == run(processor, without)


@every_processor
def test_silent_machines_are_told_in_one_order_however_they_were_restored(processor: AnyProcessor) -> None:
    events: list[HostEvent | None] = []
    for place, machine in enumerate(("okuma", "haas", "dmg")):
        born = birth(0.1 * place, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=21.5, spindle_temp_c=24.0)
        said = [data(1.0 + number, spindle_rpm=4000.0, spindle_load_pct=20.0 + number) for number in range(3)]
        events += [one._replace(device=machine, node=NodeId("cnc", machine)) for one in (born, *said)]
    records = through_bytes([*events, *[None] * 40])
    straight, kept = partition_of(processor), Kept()
    for offset, record in enumerate(records[:20]):
        straight.take(offset, record)
    saved(straight, kept)
    kept |= [straight.mark()]
    restored = partition_of(processor)
    assert restored.restore(dict(reversed(kept.items()))) == 20
    for offset, record in enumerate(records[20:], start=20):
        assert [one.actions for one in straight.take(offset, record)] == [one.actions for one in restored.take(offset, record)]


def test_what_a_second_writer_says_again_is_folded_once() -> None:
    processor = discover()["thermal"]
    records = shift()
    twice = [copy for record in records for copy in ((record, record) if record.event is not None else (record,))]
    once, again = partition_of(processor), partition_of(processor)
    for offset, record in enumerate(records):
        list(once.take(offset, record))
    for offset, record in enumerate(twice):
        list(again.take(offset, record))
    assert states(once) == states(again)
    assert again.repeated == len(twice) - len(records)


def test_a_state_of_another_version_is_rebuilt_from_the_log_and_nothing_is_told_twice() -> None:
    processor = discover()["thermal"]
    partition, kept = partition_of(processor), dict[str, bytes]()
    for offset, record in enumerate(shift()[:50]):
        list(partition.take(offset, record))
    saved(partition, kept)
    kept.update([partition.mark()])
    key = "thermal/okuma"
    kept[key] = kept[key].replace(b'"version":', b'"version":9')
    upgraded = partition_of(processor)
    assert upgraded.restore(kept) == 0
    assert "rebuilt" in upgraded.faults()[0]
    told = [result for offset, record in enumerate(shift()[:50]) for result in upgraded.take(offset, record)]
    assert told == []
    assert states(upgraded) == states(partition)


def test_a_description_holds_after_a_restart() -> None:
    machine = [birth(0.0, spindle_rpm=0.0), message(11.0), *[data(1.0 + i, spindle_rpm=100.0 * i) for i in range(30)]]
    records = through_bytes(machine)
    told, state = run(DESCRIBING, records)
    assert any("version" in str(action) for _, _, action in told)
    for kills in range(5):
        assert run(DESCRIBING, records, Random(kills)) == (told, state)


def test_topics_of_one_reader_do_not_write_over_each_other() -> None:
    """Their partitions of one number are kept in the same place."""
    kept: Kept = {}
    folded = {"readings": ("thermal", [birth(0.0), data(1.0)]), "cells": ("alerts", [birth(0.0)])}
    for topic, (name, events) in folded.items():
        partition = _of_topic(name, topic)
        for offset, record in enumerate(through_bytes(events)):
            list(partition.take(offset, record))
        kept |= {key: value for key, value in partition.cut() if value is not None}
        kept |= [partition.mark()]
    assert {topic: _of_topic(name, topic).restore(kept) for topic, (name, _) in folded.items()} == {"readings": 2, "cells": 1}


def _of_topic(name: str, topic: str) -> Partition:
    processor = discover()[name]
    return Partition("runners", [(processor, processor.configured({}))], topic)


def test_a_description_that_another_reader_has_come_to_is_not_taken_up_early() -> None:
    """Two sets of processors read one log, and keep what they know in one place; each has come to another record."""
    machine = [birth(0.0, spindle_rpm=0.0), message(11.0), *[data(float(i), spindle_rpm=float(i)) for i in range(1, 6)]]
    machine.insert(1, machine.pop(2))  # it is described after its first message
    records, kept = through_bytes(machine), dict[str, bytes]()
    other = replace(DESCRIBING, name="other")
    pair = (DESCRIBING, DESCRIBING.configured({}))
    ahead, behind = Partition("ahead", [(other, other.configured({}))]), Partition("behind", [pair])
    for partition, so_far in ((behind, 2), (ahead, 7)):
        for offset, record in enumerate(records[:so_far]):
            partition.take(offset, record)
        saved(partition, kept)
        kept.update([partition.mark()])
    again = Partition("behind", [pair])
    assert again.restore(kept) == 2
    assert states(again) == states(behind)
    taken = [result for offset in range(2, 7) for result in again.take(offset, records[offset])]
    assert any("version" in str(result.actions) for result in taken)


def test_a_cell_answers_from_the_partition_of_its_messages_alone() -> None:
    """Plain messages and silence come to all: each that had the cell as well would tell of a plant without machines."""
    processor = discover()["alerts"]
    pairs = [(processor, processor.configured({}))]
    records = through_bytes([None, None])
    for number in range(3):
        partition = Partition("alerts", pairs, "cells", lambda _, number=number: number == 1)  # type: ignore[misc]
        told = [result for offset, record in enumerate(records) for result in partition.take(offset, record)]
        assert bool(told) == (number == 1)
    everywhere = Partition("everywhere", pairs, "cells")
    kept: Kept = {}
    for offset, record in enumerate(records):
        everywhere.take(offset, record)
    saved(everywhere, kept)
    kept.update([everywhere.mark()])
    assert "alerts/all" in kept
    elsewhere = Partition("everywhere", pairs, "cells", lambda _: False)
    elsewhere.restore(kept)
    assert elsewhere.seats[0].engine.known_units == {}
    saved(elsewhere, kept)
    assert "alerts/all" not in kept, "what was saved there once is taken back"
