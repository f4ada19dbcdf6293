"""Names beside a remainder: what is certain stays, what is only the next best shape of something else does not."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.gap.learned.pushed import stage_with
from twin.gap.diagnosis import Effected, Verdict
from twin.gap.search import explain
from twin.gap.verdict import judged
from twin.learned.words import LearnedSite
from twin.machine import AddedEffect

Floats = NDArray[np.float64]
GRAVITY = AddedEffect(effect="gravity", on="z", parameters={"force_n": 400.0})
AT_MM = np.linspace(0.0, 45.0, 46)
SPEEDS_MM_S = np.linspace(-300.0, 300.0, 61)


def rough_place(x: Floats) -> Floats:
    """Friction around 15 mm."""
    return np.asarray(250.0 * np.exp(-(((x - 15.0) / 2.0) ** 2)))


def drag(v: Floats) -> Floats:
    """Friction with the square of the speed, as far as it is more than a viscous one."""
    return np.asarray(0.02 * v * v)


def test_a_load_is_named_beside_a_rough_place_that_no_catalogue_has() -> None:
    found = explain(stage_with(LearnedSite.FRICTION, {"position_mm": AT_MM}, rough_place, GRAVITY))
    assert found.best.effects == (Effected("gravity", "z"),)
    assert found.best.values[Effected("gravity", "z")]["force_n"] == pytest.approx(400.0, rel=0.1)
    assert judged(found).verdict is Verdict.PARTLY


@pytest.mark.parametrize(
    ("column", "knots", "shape"), [("position_mm", AT_MM, rough_place), ("velocity_mm_s", SPEEDS_MM_S, drag)]
)
def test_what_is_in_no_catalogue_gets_no_name(column: str, knots: Floats, shape: Callable[[Floats], Floats]) -> None:
    found = explain(stage_with(LearnedSite.FRICTION, {column: knots}, shape))
    assert found.best is found.base
    assert found.evidence == {}
    assert judged(found).verdict is Verdict.UNKNOWN
