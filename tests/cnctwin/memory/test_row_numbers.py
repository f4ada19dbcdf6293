"""Rows that are missing in the store are found by their numbers, and named with the machine and since when."""

import random

import pytest

from cnctwin.memory.row_numbers import EVICTED, HOLE_KEPT_MS, JUMP_MAX, SPANS_MAX, RowNumbers, hole_text, holes_text
from cnctwin.memory.store.contract import Message
from edge.running.forwarder import SEQUENCE
from edge.running.receipts import RECEIPT
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from sparkplug.topics import NodeId

EDGE = NodeId("cnc", "edge-okuma")
T0_MS, HOLE_MS = 1_772_438_400_000, 60_000


def message(kind: EventKind, at_ms: int, *, device: str | None = "okuma", is_history: bool = False, **values: object) -> Message:
    readings = tuple(
        Reading(name.replace("__", "/"), value, at_ms, Quality.GOOD, None, None, is_history)  # type: ignore[arg-type]
        for name, value in values.items()
    )
    return Message(at_ms, HostEvent(kind, EDGE, device, at_ms, readings))


def birth(*, is_awaiting: bool = True) -> Message:
    names = {SEQUENCE: None, RECEIPT: ""} if is_awaiting else {SEQUENCE: None}
    readings = tuple(Reading(name, value, T0_MS, Quality.GOOD, None, None, False) for name, value in names.items())
    return Message(T0_MS, HostEvent(EventKind.BIRTH, EDGE, "okuma", T0_MS, readings))


def row(number: int, at_ms: int, *, is_history: bool = False) -> Message:
    return message(EventKind.DATA, at_ms, is_history=is_history, spindle_rpm=1.0, edge_sequence=number)


def numbers(*rows: Message) -> RowNumbers:
    made = RowNumbers()
    made.note([birth(), *rows])
    return made


def spans(made: RowNumbers, at_ms: int) -> list[tuple[int, int]]:
    return [(hole.first, hole.last) for hole in made.holes(at_ms)]


def test_a_hole_that_nothing_fills_is_named_with_the_machine_and_since_when() -> None:
    made = numbers(row(371, T0_MS), row(442, T0_MS + 1000))
    assert spans(made, T0_MS + 1000 + HOLE_MS - 1) == [], "its rows may yet follow as history"
    (hole,) = made.holes(T0_MS + 1000 + HOLE_MS)
    assert hole_text(hole) == "okuma: 372–441 missing since 2026-03-02 08:00 UTC"


def test_rows_that_follow_as_history_close_it() -> None:
    made = numbers(row(1, T0_MS), row(9, T0_MS + 1000))
    made.note([row(number, T0_MS + 2000, is_history=True) for number in range(2, 9)])
    assert spans(made, T0_MS + 10 * HOLE_MS) == []


def test_while_history_comes_no_hole_is_named() -> None:
    made = numbers(row(1, T0_MS), row(1000, T0_MS + 1000))
    for minute in range(1, 20):
        made.note([row(1 + minute, T0_MS + minute * 50_000, is_history=True)])
        assert spans(made, T0_MS + minute * 50_000 + 40_000) == []
    assert spans(made, T0_MS + 20 * 50_000 + HOLE_MS) == [(21, 999)]


def test_a_hole_that_is_filled_in_its_middle_is_two_that_are_as_old() -> None:
    made = numbers(row(1, T0_MS), row(20, T0_MS + 1000), row(30, T0_MS + 5000))
    made.note([row(10, T0_MS + 9000, is_history=True)])
    found = {(hole.first, hole.last): hole.since_ms - T0_MS for hole in made.holes(T0_MS + 10 * HOLE_MS)}
    assert found == {(2, 9): 1000, (11, 19): 1000, (21, 29): 5000}


def test_holes_outlive_a_restart() -> None:
    made = numbers(row(1, T0_MS), row(5, T0_MS + 1000), row(9, T0_MS + 2000))
    again = RowNumbers()
    again.restore(made.saved())
    again.note([row(5, T0_MS + 1000), row(9, T0_MS + 2000), row(10, T0_MS + 3000)])  # read again, then new
    assert again.holes(T0_MS + 10 * HOLE_MS) == made.holes(T0_MS + 10 * HOLE_MS) != []
    assert again.noted_ms == T0_MS + 3000


@pytest.mark.parametrize("saved", [b"", b"{}", b"[]", b'{"noted_ms":1,"devices":[[1]]}', b'{"noted_ms":1,"devices":null}'])
def test_what_cannot_be_read_is_begun_anew(saved: bytes) -> None:
    made = RowNumbers()
    made.restore(saved)
    assert made.holes(T0_MS) == []


@pytest.mark.parametrize("number", [1, 500 + JUMP_MAX + 1])
def test_an_edge_that_counts_anew_has_no_hole(number: int) -> None:
    made = numbers(row(500, T0_MS), row(number, T0_MS + 1000), row(number + 1, T0_MS + 2000))
    assert spans(made, T0_MS + 10 * HOLE_MS) == []


def test_rows_that_the_edges_own_limit_took_are_named_so() -> None:
    made = numbers(row(1, T0_MS), row(20, T0_MS + 1000), row(30, T0_MS + 2000))
    made.note([Message(T0_MS, HostEvent(EventKind.DATA, EDGE, None, T0_MS, message(EventKind.DATA, T0_MS, x=1).event.readings))])
    told = Reading(EVICTED, "2-19 age", T0_MS, Quality.GOOD, None, None, False)
    made.note([Message(T0_MS + 3000, HostEvent(EventKind.DATA, EDGE, None, T0_MS, (told,)))])
    assert [hole.why for hole in made.holes(T0_MS + 10 * HOLE_MS)] == ["", "the edge's store passed its limit: age"]


def test_an_edge_that_asks_for_no_receipts_gets_none_and_its_holes_are_found() -> None:
    made = RowNumbers()
    made.note([birth(is_awaiting=False), row(1, T0_MS), row(5, T0_MS)])
    assert made.receipts(with_silent=True) == []
    assert spans(made, T0_MS + HOLE_MS) == [(2, 4)]


def test_a_hole_is_forgotten_after_a_week_and_the_oldest_where_there_are_too_many() -> None:
    made = numbers(*(row(2 * number, T0_MS + number) for number in range(SPANS_MAX + 50)))
    made.saved()
    found = made.holes(T0_MS + HOLE_MS + 1000)
    assert len(found) == SPANS_MAX - 1
    assert found[0].first == 2 * (SPANS_MAX + 49) - 1, "the newest come first"
    assert holes_text(found).endswith(f"; and {SPANS_MAX - 4} more")
    assert made.holes(T0_MS + 1000 + HOLE_KEPT_MS) == []


@pytest.mark.parametrize("seed", range(20))
def test_whatever_comes_in_whatever_order_the_holes_are_what_did_not_come(seed: int) -> None:
    chance = random.Random(seed)
    all_rows = range(1, 200)
    came = sorted({1, 199} | set(chance.sample(all_rows, chance.randint(100, 190))))
    live = [number for number in came if chance.random() < 0.7 or number in (1, 199)]
    late = sorted(set(came) - set(live), key=lambda _: chance.random())
    made = numbers(*(row(number, T0_MS + number) for number in live))
    made.note([row(number, T0_MS + 1000 + at, is_history=True) for at, number in enumerate(late)])
    found = {number for first, last in spans(made, T0_MS + 10 * HOLE_MS) for number in range(first, last + 1)}
    assert found == set(all_rows) - set(came)
