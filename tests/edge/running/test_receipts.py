"""An edge that waits for a memory's receipts: whatever is killed, the memory has every row, and the edge forgets no other."""

import random
from pathlib import Path

import pytest

from edge.config import StoreSection
from edge.errors import StoreError
from edge.running.forwarder import Forwarder
from edge.running.receipts import REPEAT_S, Receipts, spans_of
from edge.running.ring import Ring
from tests.edge.running.test_forwarder import NAMES, Wire, World

LIMITS = StoreSection(free_bytes_min=0, history_rows_per_s=2_000, await_receipt=True)


class Memory:
    """A historian: what it has heard is safe once it is committed, and only then it is told."""

    def __init__(self) -> None:
        self.is_alive = True
        self.heard: list[int] = []
        self.kept: set[int] = set()
        self.repeated = 0

    def hear(self, sequence: int) -> None:
        if self.is_alive:
            self.heard.append(sequence)

    def commit(self) -> str:
        """The receipt."""
        self.repeated += len(self.kept.intersection(self.heard))
        self.kept.update(self.heard)
        told, self.heard = " ".join(map(str, self.heard)), []
        return told

    def kill(self) -> None:
        self.is_alive, self.heard = False, []


class HeardWire(Wire):
    """The same broker, with a memory that listens to it."""

    def __init__(self, chance: random.Random) -> None:
        super().__init__(chance)
        self.memory = Memory()

    def deliver(self, packets: int) -> None:
        before = len(self.got)
        super().deliver(packets)
        for message in self.got[before:]:
            self.memory.hear(message.sequence)


class RememberedWorld(World):
    """The same world, in which the memory is killed too."""

    def __init__(self, file: Path, seed: int) -> None:
        super().__init__(file, seed)
        self.wire: HeardWire = HeardWire(self.chance)
        self.begin()

    def begin(self) -> None:
        ring = Ring(self.file, LIMITS, wall_ms=lambda: 0, clock=lambda: self.seconds, free_bytes=lambda _: 10**12)
        self.forwarder = self.wire.forwarder = Forwarder(ring, self.wire, "vmc", LIMITS, lambda: self.seconds)
        self.forwarder.declare(NAMES)

    def pump(self) -> None:
        super().pump()
        what = self.chance.random()
        memory = self.wire.memory
        if what < 0.05:
            memory.kill()
        elif what < 0.15:
            memory.is_alive = True
        elif what < 0.6 and memory.is_alive:
            told = memory.commit()
            if what < 0.55:  # else it is killed before it could tell
                self.forwarder.receipt(told)


@pytest.mark.parametrize("seed", range(15))
def test_whatever_is_killed_the_memory_has_every_row(tmp_path: Path, seed: int) -> None:
    world = RememberedWorld(tmp_path / "edge.store", seed)
    for _ in range(400):
        world.chapter()
    world.to_the_end()
    assert world.wire.memory.kept == set(range(1, world.taken + 1))
    assert not world.dropped
    world.forwarder.close()


def test_without_a_fault_the_memory_hears_each_row_once(tmp_path: Path) -> None:
    world = RememberedWorld(tmp_path / "edge.store", 1)
    world.wire.lost_acknowledgements = 0.0
    for _ in range(200):
        world.take(5)
        World.pump(world)
        world.seconds += 0.1
        world.wire.deliver(1_000)
        world.forwarder.receipt(world.wire.memory.commit())
    assert world.wire.memory.kept == set(range(1, 1_001))
    assert world.wire.memory.repeated == 0


def test_while_nobody_gives_receipts_nothing_is_told_again(tmp_path: Path) -> None:
    world = RememberedWorld(tmp_path / "edge.store", 1)
    world.wire.lost_acknowledgements = 0.0
    world.wire.memory.kill()
    for _ in range(100):
        world.take(1)
        World.pump(world)
        world.seconds += 1.0
        world.wire.deliver(1_000)
    assert [message.sequence for message in world.wire.got] == list(range(1, 101))
    assert world.forwarder.observations == 100, "and nothing is forgotten"


def test_a_receipt_may_come_before_the_broker_has_acknowledged() -> None:
    receipts = Receipts()
    receipts.hear("1-3 7")
    assert receipts.settle(0.0) == ([], [])
    receipts.wait([(1, 5)], 0.0)
    assert receipts.settle(1.0) == ([(1, 3)], [])
    receipts.hear("6")
    assert receipts.settle(REPEAT_S + 0.1) == ([], [(4, 5)])


def test_a_day_without_a_memory_is_one_stretch_that_waits() -> None:
    receipts = Receipts()
    for number in range(1, 2_001):
        receipts.wait([(number, number)], number * 0.5)
        receipts.settle(number * 0.5)
    assert len(receipts._waiting) == 1
    receipts.hear("7")
    assert receipts.settle(1_001.0) == ([(7, 7)], [])
    receipts.hear("")
    assert receipts.settle(1_000.0 + REPEAT_S + 0.1) == ([], [(1, 6), (8, 2_000)])


def test_a_disk_that_cannot_forget_for_a_while_forgets_later_and_tells_what_was_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = RememberedWorld(tmp_path / "edge.store", 1)
    world.wire.lost_acknowledgements = 0.0
    world.take(10)
    for _ in range(10):
        World.pump(world)
        world.seconds += 0.5
        world.wire.deliver(1_000)

    def full(*_: object) -> int:
        raise StoreError("the disk is full")

    with monkeypatch.context() as failing:
        failing.setattr(world.forwarder._ring, "forget", full)
        world.forwarder.receipt("1-4 6-10")
        world.seconds += REPEAT_S
        World.pump(world)
    for _ in range(10):
        World.pump(world)
        world.seconds += 0.5
        world.wire.deliver(1_000)
    assert [message.sequence for message in world.wire.got] == [*range(1, 11), 5]
    assert world.forwarder._ring.spans() == [(5, 5)]


@pytest.mark.parametrize("text", ["", "x", "-5", "9-3", "1e5", "1–2", "1.5", "9" * 5_000, "1-" + "9" * 5_000])
def test_what_names_no_row_is_no_receipt(text: str) -> None:
    assert spans_of(text) == []
