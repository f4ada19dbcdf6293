"""Messages are put back in order; what is missing is counted, once."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.sequence import Delivery, Numbered, SequenceWindow, Verdict

TIMEOUT_MS = 2000


class Line:
    """A window after a birth, and messages numbered from 1 on, each a millisecond after the one before."""

    def __init__(self) -> None:
        self.window = SequenceWindow(TIMEOUT_MS)
        self.window.begin(0, 0)
        self.seen: list[int] = []
        self.lost = 0

    def take(self, number: int, now_ms: int = 0) -> Verdict:
        """The message with this number arrives."""
        if self.window.is_next(number % 256, number):
            self.seen.append(number)
            return Verdict.TAKEN
        return self.note(self.window.take(Numbered(number % 256, number, number), now_ms))

    def note(self, delivery: Delivery) -> Verdict:
        """Keep what is delivered."""
        self.seen += [numbered.message for numbered in delivery.messages]
        self.lost += delivery.lost
        return delivery.verdict

    def expire(self, now_ms: int) -> bool:
        """Time passes."""
        delivery = self.window.expire(now_ms)
        if delivery is not None:
            self.note(delivery)
        return delivery is not None


def test_messages_in_order_go_straight_through_and_the_count_begins_again() -> None:
    line = Line()
    assert {line.take(number) for number in range(1, 600)} == {Verdict.TAKEN}
    assert line.seen == list(range(1, 600))


def test_what_came_too_early_is_held_until_the_missing_one_comes() -> None:
    line = Line()
    assert [line.take(number) for number in (2, 3, 1)] == [Verdict.HELD, Verdict.HELD, Verdict.TAKEN]
    assert (line.seen, line.lost) == ([1, 2, 3], 0)
    assert not line.expire(10 * TIMEOUT_MS)


def test_the_wait_ends_with_the_timeout_and_the_missing_ones_are_counted() -> None:
    line = Line()
    for number, now_ms in ((1, 0), (3, 100), (6, 1900)):
        line.take(number, now_ms)
    assert not line.expire(100 + TIMEOUT_MS - 1)
    assert line.expire(100 + TIMEOUT_MS)
    assert (line.seen, line.lost) == ([1, 3, 6], 3)
    assert line.take(7) is Verdict.TAKEN
    assert line.take(2) is Verdict.LATE
    assert line.seen == [1, 3, 6, 7]


def test_a_second_hole_has_its_own_wait() -> None:
    line = Line()
    line.take(2, now_ms=0)
    line.take(1, now_ms=1500)
    line.take(4, now_ms=1600)
    assert not line.expire(TIMEOUT_MS)
    assert line.expire(1600 + TIMEOUT_MS)
    assert (line.seen, line.lost) == ([1, 2, 4], 1)


def test_a_repetition_is_dropped_whether_it_was_delivered_or_is_held() -> None:
    line = Line()
    assert [line.take(number) for number in (1, 1, 3, 3, 2, 3)] == [
        Verdict.TAKEN,
        Verdict.LATE,
        Verdict.HELD,
        Verdict.LATE,
        Verdict.TAKEN,
        Verdict.LATE,
    ]
    assert line.seen == [1, 2, 3]


def test_a_birth_ends_every_wait_and_counts_what_never_came() -> None:
    line = Line()
    for number in (2, 5):
        line.take(number)
    assert line.window.begin(0, 100) == 3
    assert not line.expire(10 * TIMEOUT_MS)
    assert line.take(1 + 256) is Verdict.TAKEN


@pytest.mark.parametrize("birth_seq", [0, 7, 255])
def test_a_birth_may_begin_with_any_number(birth_seq: int) -> None:
    window = SequenceWindow(TIMEOUT_MS)
    window.begin(birth_seq, 0)
    assert window.is_next((birth_seq + 1) % 256, 1)


def test_a_peer_that_repeats_its_number_with_new_data_is_believed() -> None:
    window = SequenceWindow(TIMEOUT_MS)
    window.begin(0, 0)
    deliveries = [window.take(Numbered(seq, stamp, stamp), 0) for seq, stamp in ((1, 1), (1, 2), (1, 3), (2, 4))]
    assert [d.verdict for d in deliveries] == [Verdict.TAKEN, Verdict.SLOPPY, Verdict.SLOPPY, Verdict.TAKEN]
    assert [n.message for d in deliveries for n in d.messages] == [1, 2, 3, 4]
    assert sum(d.lost for d in deliveries) == 0


@pytest.mark.parametrize("missing", [1, 2, 126, 127, 128, 200, 239])
def test_every_hole_up_to_239_messages_is_seen_and_counted(missing: int) -> None:
    line = Line()
    line.take(1)
    line.take(2 + missing)
    line.expire(TIMEOUT_MS)
    assert (line.seen, line.lost) == ([1, 2 + missing], missing)


@pytest.mark.parametrize("missing", [240, 255])
def test_a_hole_of_nearly_a_whole_count_looks_like_a_sloppy_peer(missing: int) -> None:
    line = Line()
    line.take(1)
    assert line.take(2 + missing) is Verdict.SLOPPY
    assert line.seen == [1, 2 + missing]


@given(st.data(), st.integers(1, 400), st.integers(1, 60))
def test_any_disorder_within_a_window_comes_out_in_order_and_whole(data: st.DataObject, count: int, width: int) -> None:
    line = Line()
    numbers = list(range(1, count + 1))
    for start in range(0, count, width):
        numbers[start : start + width] = data.draw(st.permutations(numbers[start : start + width]))
    for number in numbers:
        line.take(number)
    assert (line.seen, line.lost) == (list(range(1, count + 1)), 0)


@given(st.lists(st.integers(1, 120), max_size=80), st.lists(st.integers(0, 3000), max_size=80))
def test_whatever_comes_nothing_is_delivered_twice_and_little_is_held(arrivals: list[int], pauses: list[int]) -> None:
    line, now_ms = Line(), 0
    for number, pause_ms in zip(arrivals, [*pauses, *[0] * 80], strict=False):
        now_ms += pause_ms
        line.expire(now_ms)
        line.take(number, now_ms)
    line.expire(now_ms + TIMEOUT_MS)
    assert line.lost >= 0
    assert len(line.seen) == len(set(line.seen))
    assert not line.expire(now_ms + 10 * TIMEOUT_MS), "nothing is held for longer than the timeout"


@given(st.sets(st.integers(2, 100), max_size=60))
def test_what_is_delivered_and_what_is_lost_is_all_there_was(missing: set[int]) -> None:
    line = Line()
    arrivals = [number for number in range(1, 102) if number not in missing]
    for number in arrivals:
        line.take(number)
    line.expire(TIMEOUT_MS)
    assert (line.seen, line.lost) == (arrivals, len(missing))
