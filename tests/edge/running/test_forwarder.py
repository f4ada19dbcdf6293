"""Store and forward against a broker that comes and goes, and an edge that is killed: nothing lost, nothing twice, in order."""

import random
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from edge.config import StoreSection
from edge.errors import StoreError
from edge.place import Place
from edge.running.forwarder import FLIGHTS_MAX, SEQUENCE, Forwarder
from edge.running.ring import Ring, StoredRow
from edge.sample import Drop, EdgeSample
from sparkplug.metric import Change

LIMITS = StoreSection(free_bytes_min=0, history_rows_per_s=200)
NAMES = ("spindle_rpm", SEQUENCE)


class Message:
    """What a broker has got: which row, and whether as history."""

    def __init__(self, changes: Sequence[Change]) -> None:
        by_name = {change.name: change for change in changes}
        self.sequence = int(str(by_name[SEQUENCE].value))
        self.value = by_name["spindle_rpm"].value
        self.is_history = all(change.is_historical for change in changes)
        assert self.is_history or not any(change.is_historical for change in changes)


class Wire:
    """An edge node and its broker: packets of a session arrive in order; those after a cut never do."""

    def __init__(self, chance: random.Random) -> None:
        self.online, self.session = True, 1
        self.got: list[Message] = []
        self._way: list[Message | int] = []
        self._chance, self.lost_acknowledgements = chance, 0.1
        self.forwarder: Forwarder

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        assert device == "vmc"
        if self.online:
            self._way.append(Message(changes))
        return self.online

    def barrier(self, token: int, session: int) -> bool:
        if not self.online or session != self.session:
            return False
        self._way.append(token)
        return True

    def deliver(self, packets: int) -> None:
        for _ in range(min(packets, len(self._way))):
            packet = self._way.pop(0)
            if isinstance(packet, Message):
                self.got.append(packet)
            elif self._chance.random() >= self.lost_acknowledgements:  # else the cut comes before it
                self.forwarder.confirmed(packet)
            else:
                self.cut()
                return

    def cut(self) -> None:
        self.online, self._way = False, []

    def back(self) -> None:
        if not self.online:
            self.online, self.session = True, self.session + 1


class World:
    """One edge with its store, its broker and a clock, run by chance."""

    def __init__(self, file: Path, seed: int) -> None:
        self.chance = random.Random(seed)
        self.wire, self.seconds, self.file = Wire(self.chance), 0.0, file
        self.taken, self.emitted, self.recovered = 0, 0, 0
        self.dropped = Counter[Drop]()
        self.begin()

    def begin(self) -> None:
        ring = Ring(self.file, LIMITS, wall_ms=lambda: 0, clock=lambda: self.seconds, free_bytes=lambda _: 10**12)
        self.forwarder = self.wire.forwarder = Forwarder(ring, self.wire, "vmc", LIMITS, lambda: self.seconds)
        self.forwarder.declare(NAMES)

    def take(self, rows: int) -> None:
        """A frame of the control; its place says how many rows are taken."""
        stamped = [[EdgeSample("spindle_rpm", float(self.taken + i + 1), 1_000 + i)] for i in range(rows)]
        self.forwarder.put(stamped, Place("control", self.taken + rows))
        self.taken += rows

    def pump(self) -> None:
        emitted, dropped = self.forwarder.pump()
        self.emitted += emitted
        self.dropped += dropped

    def kill(self) -> None:
        """As kill -9: nothing is told to anybody, and what the kernel has of the file stays."""
        self.forwarder._ring._db.close()
        self.wire.cut()
        place_rows = self.taken
        self.begin()
        place = self.forwarder.place()
        assert place is None or place.next_sequence == place_rows, "rows and place are one transaction"

    def chapter(self) -> None:
        what = self.chance.random()
        if what < 0.35:
            self.take(self.chance.randint(1, 30))
        elif what < 0.8:
            self.seconds += self.chance.choice((0.01, 0.1, 0.6))
            self.pump()
            self.wire.deliver(self.chance.choice((0, 1, 5, 40, 400)))
        elif what < 0.88:
            self.wire.cut()
        elif what < 0.98:
            self.wire.back()
        else:
            self.kill()

    def to_the_end(self) -> None:
        for _ in range(20_000):
            self.wire.back()
            self.wire.deliver(10_000)
            self.seconds += 0.1
            self.pump()
            if self.forwarder.observations == 0:
                return
        raise AssertionError(f"{self.forwarder.observations} observations never arrive")


@pytest.mark.parametrize("seed", range(25))
def test_whatever_happens_each_row_arrives_and_is_told_apart_by_its_number(tmp_path: Path, seed: int) -> None:
    world = World(tmp_path / "edge.store", seed)
    for _ in range(400):
        world.chapter()
    world.to_the_end()
    got = world.wire.got
    assert {message.sequence for message in got} == set(range(1, world.taken + 1))
    assert all(message.value == float(message.sequence) for message in got), "a number stands for one row and no other"
    assert not world.dropped
    assert world.forwarder._waiting._spans == []
    live = [message.sequence for message in got if not message.is_history]
    assert live == sorted(set(live)), "what is live is in order, and live once only"
    world.forwarder.close()


def test_without_a_fault_nothing_is_sent_twice_and_history_is_in_order(tmp_path: Path) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.wire.online = False
    for _ in range(100):
        world.take(10)
        world.seconds += 1.0
        world.pump()
    world.wire.back()
    world.take(1)
    world.wire.deliver(1)
    assert (world.wire.got[0].sequence, world.wire.got[0].is_history) == (1_001, False), "live goes first"
    world.wire.lost_acknowledgements = 0.0
    for _ in range(55):
        world.seconds += 0.1
        world.take(1)
        world.pump()
        before = len(world.wire.got)
        world.wire.deliver(10_000)
        assert len(world.wire.got) - before <= 22, "200 rows a second, and what is live"
    history = [message.sequence for message in world.wire.got if message.is_history]
    assert history == list(range(1, 1_001))
    assert world.emitted >= 1_000
    world.forwarder.close()


def test_history_waits_while_the_device_is_dead_and_goes_on_after_its_birth(tmp_path: Path) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.wire.online = False
    world.take(3)
    world.wire.back()
    world.forwarder.declare(())
    world.seconds = 5.0
    world.pump()
    world.wire.deliver(100)
    assert world.wire.got == []
    world.forwarder.declare(NAMES)
    world.seconds += 0.1
    world.pump()
    world.wire.deliver(100)
    assert [message.sequence for message in world.wire.got] == [1, 2, 3]
    world.forwarder.close()


def test_what_the_machine_does_not_have_any_more_is_counted(tmp_path: Path) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.wire.online = False
    world.take(3)
    world.wire.back()
    world.forwarder.declare(("feed_mm_min", SEQUENCE))
    world.seconds = 5.0
    world.pump()
    assert world.dropped == {Drop.UNDECLARED: 3}
    assert world.forwarder.observations == 0
    world.forwarder.close()


def test_a_disk_that_takes_nothing_stops_no_live_value(tmp_path: Path) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.forwarder._ring._db.close()

    class Plain(Wire):
        def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
            plain.append(changes[0].value)
            return True

    plain: list[object] = []
    world.wire.__class__ = Plain
    world.take(2)
    assert plain == [1.0, 2.0]
    assert "cannot be written" in world.forwarder.error
    assert world.forwarder.observations == 2, "buffered until the ledger has heard of them"
    world.pump()
    assert world.emitted == 2


def test_what_one_session_took_is_not_confirmed_by_the_barrier_of_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World(tmp_path / "edge.store", 1)
    wire, ring, world.wire.lost_acknowledgements = world.wire, world.forwarder._ring, 0.0
    world.take(1)
    world.seconds = 0.6
    world.pump()  # the row and its barrier are on their way
    wire.online = False
    world.take(1)
    wire.online = True

    def reads_while_the_connection_is_made_anew(first: int, last: int) -> list[StoredRow]:
        wire.cut()
        wire.back()
        return Ring.read(ring, first, last)

    monkeypatch.setattr(ring, "read", reads_while_the_connection_is_made_anew)
    world.seconds = 1.2
    world.pump()
    monkeypatch.undo()
    world.to_the_end()
    assert {message.sequence for message in wire.got} == {1, 2}
    world.forwarder.close()


@pytest.mark.parametrize("what", ["read", "delete"])
def test_a_disk_that_fails_for_a_while_leaves_no_row_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.wire.lost_acknowledgements = 0.0
    world.take(3)
    world.wire.online = False
    world.take(3)
    world.wire.back()

    def fails(*_: object) -> None:
        raise StoreError("the disk is full")

    monkeypatch.setattr(world.forwarder._ring, what, fails)
    for _ in range(5):
        world.seconds += 0.6
        world.pump()
        world.wire.deliver(100)
    assert (world.forwarder.error, world.forwarder.observations + world.emitted) == ("the disk is full", 6)
    monkeypatch.undo()
    world.to_the_end()
    assert (world.emitted, world.forwarder._ring.rows) == (6, 0)
    assert {message.sequence for message in world.wire.got} == set(range(1, 7))
    world.forwarder.close()


def test_a_broker_that_confirms_nothing_does_not_make_the_store_grow_for_ever(tmp_path: Path) -> None:
    world = World(tmp_path / "edge.store", 1)
    world.wire.lost_acknowledgements = 0.0
    world.forwarder.confirmed = lambda token: None  # type: ignore[method-assign]
    for _ in range(FLIGHTS_MAX + 50):
        world.take(1)
        world.seconds += 0.6
        world.pump()
        world.wire.deliver(10)
    assert len(world.forwarder._flights) <= FLIGHTS_MAX
    assert min(first for flight in world.forwarder._flights for first, _ in flight.spans) > 1, "the oldest may be evicted"
    world.forwarder.close()
