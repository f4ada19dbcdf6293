"""Spans behave like the sets that they stand for."""

from hypothesis import given
from hypothesis import strategies as st

from edge.running.spans import Spans


def numbers(spans: Spans) -> list[int]:
    return [n for first, last in spans for n in range(first, last + 1)]


@given(st.permutations(list(range(12))), st.integers(0, 12), st.integers(1, 5), st.integers(-1, 13))
def test_spans_are_a_sorted_set_in_the_fewest_pieces(order: list[int], cut: int, number_max: int, upto: int) -> None:
    spans, plain = Spans(), set[int]()
    for number in order[:cut]:
        spans.add(number, number)
        plain.add(number)
    assert numbers(spans) == sorted(plain)
    assert len(spans) == len(plain)
    assert len(list(spans)) == sum(n - 1 not in plain for n in plain), "neighbours are one span"
    spans.cut(upto)
    plain = {n for n in plain if n > upto}
    assert numbers(spans) == sorted(plain)
    taken = spans.take(number_max)
    if not plain:
        assert taken is None
        return
    assert taken is not None
    assert taken[0] == min(plain)
    assert 1 <= taken[1] - taken[0] + 1 <= number_max
    assert numbers(spans) == sorted(plain - set(range(taken[0], taken[1] + 1)))
