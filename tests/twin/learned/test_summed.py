"""Terms of one place, added up."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.learned.small_axis import columns, learned, same
from twin.learned.section import LearnedSection
from twin.learned.summed import summed

KNOTS = st.lists(st.integers(-20, 20).map(float), min_size=1, max_size=5, unique=True)
DIRECTION = [-1.0, 1.0]


@settings(max_examples=examples(30), deadline=None)
@given(one=KNOTS, other=KNOTS, seed=st.integers(0, 2**32))
def test_the_sum_is_the_sum_everywhere(one: list[float], other: list[float], seed: int) -> None:
    chance = np.random.default_rng(seed)
    terms = [learned("friction", "position_mm", at, chance.normal(size=len(at)).round(3).tolist()) for at in (one, other)]
    (total,) = summed(terms)
    at = {"position_mm": chance.uniform(-30.0, 30.0, 50)}
    np.testing.assert_allclose(total.term.at(at), sum(term.term.at(at) for term in terms), atol=1e-5)


def test_the_sum_of_tables_over_two_arguments_in_any_order() -> None:
    one = {"position_mm": [0.0, 0.0, 9.0, 9.0], "direction": DIRECTION * 2, "value": [1.0, 2.0, 3.0, 4.0]}
    other = {"direction": DIRECTION, "position_mm": [5.0, 5.0], "value": [10.0, 20.0]}
    terms = [LearnedSection.model_validate({"site": "friction", "on": "x", "table": table}) for table in (one, other)]
    (total,) = summed(terms)
    at = {"position_mm": np.array([0.0, 4.5, 9.0]), "direction": np.array([1.0, -1.0, 1.0])}
    assert total.term.at(at).tolist() == pytest.approx([22.0, 12.0, 24.0])


def test_others_and_recordings_stay_as_they_are() -> None:
    recorded = LearnedSection.model_validate({"site": "axis_force", "on": "x", "table": {"t_s": [0.0], "value": [1.0]}})
    apart = (
        learned("friction", "position_mm", [0.0], [1.0]),
        learned("friction", "velocity_mm_s", [0.0], [1.0]),
        recorded,
        recorded,
    )
    assert summed(apart) == apart
    same(columns(*summed(apart)), columns(*apart))
