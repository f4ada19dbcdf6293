"""The store on the disk: numbers that are given once, limits that hold, and a file that outlives its process."""

import logging
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from edge.config import StoreSection
from edge.errors import StoreError
from edge.place import Place
from edge.running.ring import Ring
from edge.running.ring_file import Eviction

PLENTY = 10**12


class Clock:
    """Time that a test moves, and a disk that it fills."""

    def __init__(self) -> None:
        self.wall_ms, self.seconds, self.free = 1_000_000, 0.0, PLENTY

    def ring(self, file: Path, limits: StoreSection | None = None) -> Ring:
        return Ring(
            file,
            limits or StoreSection(),
            wall_ms=lambda: self.wall_ms,
            clock=lambda: self.seconds,
            free_bytes=lambda _: self.free,
        )


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def open_ring(clock: Clock, tmp_path: Path) -> Iterator[Callable[..., Ring]]:
    opened: list[Ring] = []

    def make(limits: StoreSection | None = None) -> Ring:
        opened.append(clock.ring(tmp_path / "edge.store", limits))
        return opened[-1]

    yield make
    for ring in opened:
        ring.close()


OpenRing = Callable[..., Ring]


def test_rows_come_back_in_order_with_what_they_hold(open_ring: OpenRing) -> None:
    ring = open_ring()
    assert ring.append([(2, "a"), (3, "b")], Place("x", 7)) == 1
    assert ring.append([(1, "c")]) == 3
    assert [(row.sequence, row.observations, row.body) for row in ring.read(2, 9)] == [(2, 3, "b"), (3, 1, "c")]
    assert (ring.rows, ring.observations, ring.place()) == (3, 6, Place("x", 7))
    ring.delete(1, 2, 5)
    assert (ring.rows, ring.observations, ring.spans()) == (1, 1, [(3, 3)])


def test_the_place_and_the_memory_are_those_of_the_last_row_whatever_goes_first(open_ring: OpenRing) -> None:
    ring = open_ring()
    ring.append([(1, "a")], Place("x", 1), "one")
    ring.append([(1, "b")], Place("x", 2))
    ring.append([(1, "c")])
    assert (ring.place(), ring.memory()) == (Place("x", 2), "one")
    ring.delete(2, 2, 1)
    ring.delete(1, 1, 1)
    assert (ring.place(), ring.memory()) == (Place("x", 2), "one"), "an older row that goes later takes nothing back"
    ring.keep(Place("x", 3), "two")
    assert (ring.place(), ring.memory()) == (Place("x", 3), "two")
    ring.delete(3, 3, 1)
    ring.close()
    again = open_ring()
    assert (again.place(), again.memory()) == (Place("x", 3), "two")
    again.append([(1, "d")], Place("x", 4))
    assert (again.place(), again.memory()) == (Place("x", 4), "two")


def test_a_place_without_a_row_is_later_than_that_of_the_last_row(open_ring: OpenRing) -> None:
    ring = open_ring()
    ring.append([(1, "a")], Place("x", 1), "one")
    ring.keep(Place("x", 5), None)
    assert (ring.place(), ring.memory()) == (Place("x", 5), "one")
    ring.delete(1, 1, 1)
    assert (ring.place(), ring.memory()) == (Place("x", 5), "one")


def test_a_store_that_kept_the_place_at_each_row_goes_on_where_it_was(open_ring: OpenRing, tmp_path: Path) -> None:
    open_ring().close()
    older = sqlite3.connect(tmp_path / "edge.store", isolation_level=None)
    older.executescript(
        "DROP TRIGGER keep_place_of_gone; DROP TRIGGER keep_memory_of_gone;"
        "CREATE TRIGGER keep_place AFTER INSERT ON rows WHEN NEW.place IS NOT NULL"
        " BEGIN INSERT OR REPLACE INTO kept VALUES ('place', NEW.place); END;"
        "CREATE TRIGGER keep_memory AFTER INSERT ON rows WHEN NEW.memory IS NOT NULL"
        " BEGIN INSERT OR REPLACE INTO kept VALUES ('memory', NEW.memory); END;"
        """INSERT INTO rows VALUES (1, 0, 1, 'a', '["x", 1]', 'one'), (2, 0, 1, 'b', '["x", 2]', NULL);"""
        """INSERT OR REPLACE INTO kept VALUES ('place', '["x", 3]');"""  # after the last row, without one
    )
    older.close()
    ring = open_ring()
    assert (ring.place(), ring.memory(), ring.rows) == (Place("x", 3), "one", 2)
    ring.delete(1, 2, 2)
    assert (ring.place(), ring.memory()) == (Place("x", 3), "one")
    ring.append([(1, "c")], Place("x", 4), "two")
    ring.close()
    assert (open_ring().place(), ring.file.name) == (Place("x", 4), "edge.store")


def test_a_number_is_never_given_twice_not_even_when_its_row_is_gone(open_ring: OpenRing) -> None:
    ring = open_ring()
    ring.append([(1, "a"), (1, "b")])
    ring.delete(1, 2, 2)
    ring.close()
    again = open_ring()
    assert (again.rows, again.append([(1, "c")])) == (0, 3)


def test_a_second_edge_on_the_same_store_gives_no_number_again(open_ring: OpenRing) -> None:
    ring, other = open_ring(), open_ring()
    ring.append([(1, "a")])
    ring.delete(1, 1, 1)
    with pytest.raises(StoreError, match="another edge writes this store too"):
        other.append([(1, "b")])


def test_what_was_stored_and_is_gone_is_given_back_to_the_disk(open_ring: OpenRing, tmp_path: Path, clock: Clock) -> None:
    ring = open_ring()
    for _ in range(300):
        ring.append([(1, "x" * 1_000)] * 100)
    ring.delete(1, ring.last - 1, ring.last - 1)
    clock.free = 490_000_000
    for _ in range(12):
        ring.look()
        assert ring.evict(ring.last) is None, "the file itself holds what the disk lacks"
        clock.free = PLENTY
        ring.append([(1, "y")])
    assert (tmp_path / "edge.store").stat().st_size < 10_000_000


def test_a_disk_that_somebody_else_fills_costs_no_more_rows_than_it_lacks(clock: Clock, tmp_path: Path) -> None:
    file = tmp_path / "edge.store"
    ring = clock.ring(file, StoreSection(free_bytes_min=1_000_000))
    for _ in range(300):
        ring.append([(1, "x" * 1_000)] * 100)
    room = file.stat().st_size - 3_000_000  # so it is 4 MB too much, and what is not checkpointed yet
    ring._free_bytes = lambda _: room - file.stat().st_size
    ring.look()
    evicted = 0
    while (gone := ring.evict(ring.last)) is not None:
        assert gone.reason is Eviction.DISK
        evicted += gone.rows
    assert 3_000 < evicted < 9_000, "of 30,000, a kilobyte each"
    ring.close()


def test_a_disk_that_cannot_be_asked_is_an_error_of_the_store(open_ring: OpenRing, monkeypatch: pytest.MonkeyPatch) -> None:
    ring = open_ring()
    ring.append([(1, "a")])

    def gone(_: Path) -> int:
        raise FileNotFoundError("no such folder")

    monkeypatch.setattr(ring, "_free_bytes", gone)
    with pytest.raises(StoreError, match="no such folder"):
        ring.evict(1)


def test_stored_numbers_are_told_as_spans(open_ring: OpenRing) -> None:
    ring = open_ring()
    ring.append([(1, "x")] * 9)
    ring.delete(4, 4, 1)
    ring.delete(8, 9, 2)
    assert ring.spans() == [(1, 3), (5, 7)]


def test_what_is_too_old_goes_and_nothing_else(open_ring: OpenRing, clock: Clock) -> None:
    ring = open_ring(StoreSection(age_s_max=60.0))
    ring.append([(1, "old"), (2, "old")])
    clock.seconds = 50.0
    ring.append([(3, "new")])
    ring.look()
    assert ring.evict(ring.last) is None
    clock.seconds = 61.0
    ring.look()
    assert ring.evict(ring.last) == (Eviction.AGE, 2, 1, 2, 3)
    assert ring.evict(ring.last) is None
    assert [row.body for row in ring.read(1, 3)] == ["new"]


def test_a_wall_clock_that_is_set_makes_no_row_older(open_ring: OpenRing, clock: Clock) -> None:
    ring = open_ring(StoreSection(age_s_max=60.0))
    ring.append([(1, "in 1970")])
    clock.wall_ms = 1_900_000_000_000
    ring.look()
    assert ring.evict(ring.last) is None


def test_what_is_too_much_goes_oldest_first(open_ring: OpenRing) -> None:
    ring = open_ring(StoreSection(bytes_max=1_000_000))
    for _ in range(30):
        ring.append([(1, "x" * 1_000)] * 100)
    gone = 0
    ring.look()
    while (evicted := ring.evict(ring.last)) is not None:
        assert evicted.reason is Eviction.BYTES
        gone = evicted.last
    assert ring.bytes <= 1_000_000
    assert 0 < gone < ring.last
    assert ring.spans() == [(gone + 1, 3_000)]


def test_rows_that_are_on_their_way_are_not_evicted(open_ring: OpenRing, clock: Clock) -> None:
    ring = open_ring()
    ring.append([(1, "x")] * 5)
    clock.free = 0
    assert ring.evict(3) == (Eviction.DISK, 3, 1, 3, 3)
    assert ring.evict(3) is None


def test_a_damaged_file_is_put_aside_and_the_edge_goes_on(
    open_ring: OpenRing, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "edge.store").write_bytes(b"no database at all" * 1_000)
    with caplog.at_level(logging.WARNING):
        ring = open_ring()
    assert "is damaged" in caplog.text
    assert ring.append([(1, "a")]) == 1_000_001, "no number that the damaged store may have given"
    ring.close()
    assert open_ring().last == 1_000_001
    assert len(list(tmp_path.glob("edge.store.damaged-*"))) == 1


def test_a_file_that_another_edge_writes_is_an_error_in_one_line(open_ring: OpenRing, tmp_path: Path) -> None:
    ring = open_ring()
    other = sqlite3.connect(tmp_path / "edge.store", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreError, match=r"edge\.store: cannot be written: database is locked"):
        ring.append([(1, "a")])
    other.execute("ROLLBACK")
    other.close()
    assert ring.append([(1, "a")]) == 1


WRITER = """
import sys, time
from pathlib import Path
from edge.config import StoreSection
from edge.place import Place
from edge.running.ring import Ring
ring = Ring(Path(sys.argv[1]), StoreSection(free_bytes_min=0), wall_ms=lambda: time.time_ns() // 10**6, clock=time.monotonic)
while True:
    first = ring.append([(1, "row")] * 7, Place("control", ring.last + 8))
    print(first + 6, flush=True)
"""


def test_kill_9_loses_no_row_that_was_taken_and_leaves_rows_and_place_in_step(open_ring: OpenRing, tmp_path: Path) -> None:
    told = 0
    for kill_after in (1, 40, 333):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path / "edge.store")],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[3],
        )
        assert writer.stdout is not None
        for _ in range(kill_after):
            told = int(writer.stdout.readline())
        os.kill(writer.pid, signal.SIGKILL)
        rest = writer.stdout.read().split()
        told = int(rest[-1]) if rest and len(rest[-1]) >= len(str(told)) else told
        writer.stdout.close()
        writer.wait(10)
    ring = open_ring()
    assert ring.last >= told
    assert ring.spans() == [(1, ring.last)]
    assert ring.place() == Place("control", ring.last + 1)
