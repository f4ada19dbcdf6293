"""A second name for what the first explains."""

import numpy as np
import pytest

from twin.gap.fitting import Left
from twin.gap.naming.siblings import above, only_completes


def left(rms: float) -> Left:
    """Return the remainder of one signal in ten blocks of ten samples."""
    squares = np.full((10, 1), 10.0 * rms**2)
    cells = np.zeros((1, 8))
    return Left(("z_torque_a",), squares, np.full((10, 1), 10.0), cells, cells)


@pytest.mark.parametrize(
    ("second", "is_another_name"),
    [
        (3.0, True),  # alone as near as the first, it only mends the form beside it
        (19.9, False),  # alone it closes nothing of what the first does: it is another effect, if a small one
    ],
)
def test_a_second_name_looks_like_the_first_and_takes_next_to_nothing_by_itself(second: float, is_another_name: bool) -> None:
    assert only_completes(left(20.0), left(1.4), left(second), left(1.0)) is is_another_name


def test_two_that_each_take_their_part_are_two() -> None:
    base, first, second, both = left(20.0), left(14.0), left(14.0), left(1.0)
    assert not only_completes(base, first, second, both)


def test_what_is_at_the_floor_has_nothing_above_it() -> None:
    assert above(left(1.0)) == pytest.approx(0.0, abs=1e-12)
    assert above(left(3.0)) == pytest.approx(8.0)
