"""The comparison of a replay with what a run has left: what is lost, doubled, different or out of order is found."""

from array import array

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from benchmarks.kafka.replay import Difference, digest, results_compared, states_compared

TOLD = array("Q", [1, 2, 3, 3, 4])
RESULTS = {
    "the same": ([1, 2, 3, 3, 4], (0, 0, 0)),
    "one lost": ([1, 2, 3, 3], (1, 0, 0)),
    "one of two that are equal lost": ([1, 2, 3, 4], (1, 0, 0)),
    "one doubled": ([1, 2, 2, 3, 3, 4], (0, 1, 0)),
    "one foreign": ([1, 2, 3, 3, 4, 9], (0, 1, 0)),
    "one different": ([1, 2, 9, 3, 4], (1, 1, 0)),
    "out of order": ([2, 1, 3, 3, 4], (0, 0, 1)),
    "none": ([], (5, 0, 0)),
}
STATES = {"gap/m-0": b"zero", "gap/m-1": b"one"}
LEFT = {
    "the same": ({}, (0, 0, 0)),
    "one different": ({"gap/m-1": b"onE"}, (0, 0, 1)),
    "one longer": ({"gap/m-1": b"one "}, (0, 0, 1)),
    "one lost": ({"gap/m-1": None}, (1, 0, 0)),
    "one foreign": ({"gap/m-2": b"two"}, (0, 1, 0)),
}


@pytest.mark.parametrize(("stands", "expected"), RESULTS.values(), ids=list(RESULTS))
def test_results_that_differ_are_counted(stands: list[int], expected: tuple[int, int, int]) -> None:
    found = results_compared(TOLD, array("Q", stands), "here")
    assert (found.lost, found.extra, found.different) == expected
    assert (found.expected, found.total, found.first) == (5, sum(expected), "here" if any(expected) else "")


@pytest.mark.parametrize(("change", "expected"), LEFT.values(), ids=list(LEFT))
def test_states_that_differ_are_counted_and_the_first_is_named(
    change: dict[str, bytes | None], expected: tuple[int, int, int]
) -> None:
    left = {key: value for key, value in (STATES | change).items() if value is not None}
    found = states_compared(STATES, left, 3)
    assert (found.lost, found.extra, found.different) == expected
    assert found.expected == 2 and bool(found.first) == any(expected)
    assert not any(expected) or next(iter(change)) in found.first


def test_a_difference_of_the_parts_is_one_of_the_whole() -> None:
    whole = Difference()
    for part in (Difference(3), Difference(2, lost=1, first="this"), Difference(1, extra=2, different=1, first="that")):
        whole.add(part)
    assert (whole.expected, whole.lost, whole.extra, whole.different) == (6, 1, 2, 1)
    assert (whole.total, whole.first) == (4, "this")


def test_the_digest_is_of_all_but_the_writer() -> None:
    headers = [("version", b"1"), ("writer", b"r0"), ("at", b"1 2 3 4")]
    own = digest(b"m-0", headers, b"value")
    assert digest("m-0", [("version", b"1"), ("at", b"1 2 3 4"), ("writer", b"r1")], b"value") == own
    others = [
        digest(b"m-1", headers, b"value"),
        digest(b"m-0", headers, b"other"),
        digest(b"m-0", [*headers[:2], ("at", b"2 2 3 4")], b"value"),
        digest(b"m-0", headers[:2], b"value"),
    ]
    assert own not in others and len(set(others)) == len(others)
