"""Sections: steady stretches, and the edges between them."""

from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.sectioning import starts_of
from twin.anomaly.parts.usual import Sums

KINDS = (int(Kind.LOAD), int(Kind.SPEED))


def told(load: float, speed: float | None) -> Sums:
    """A stretch of one tick."""
    known = 0.0 if speed is None else speed
    return Sums((1, 0 if speed is None else 1), (load, known), (load * load, known * known))


def test_a_speed_that_changes_while_it_is_not_told_ends_a_section() -> None:
    """The spindle runs up unsettled, which tells nothing of its speed; afterwards it is another section."""
    stretches = [told(3.0, 8.16)] * 6 + [told(3.0, None)] * 2 + [told(3.0, 8.19)] * 6
    assert starts_of(stretches, KINDS, 1.0) == [0, 7, 9]
    assert len(starts_of(stretches, KINDS, 1.0, most=2)) == 2
    assert starts_of(stretches, KINDS, 1.0, most=2)[1] >= 7


def test_there_are_never_more_sections_than_are_asked_for() -> None:
    """A long operation whose load goes up and down has as many as fit, the first of them at its beginning."""
    stretches = [told(3.0 + (at // 3 % 2), 8.0) for at in range(250)]
    starts = starts_of(stretches, KINDS, 1.0)
    assert starts[0] == 0
    assert len(starts) <= 64
    assert starts == sorted(set(starts))
