"""The size effect: hand figures at the reference chip and at a sixteenth of it."""

import pytest

from twin.effects.size_effect import tangential_coefficient_n_per_mm2


def test_the_stated_coefficient_is_that_of_a_chip_of_fifty_micrometres() -> None:
    assert tangential_coefficient_n_per_mm2(900.0, 0.05, 0.25) == 900.0


def test_a_chip_of_a_sixteenth_takes_twice_the_coefficient() -> None:
    """16^0.25 = 2."""
    assert tangential_coefficient_n_per_mm2(900.0, 0.05 / 16, 0.25) == pytest.approx(1800.0)


def test_no_chip_no_say() -> None:
    assert tangential_coefficient_n_per_mm2(900.0, 0.0, 0.25) == 900.0
