"""Effects that cannot be told apart share one class, led by one that machines are known to have."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.gap.one_line import BIAS, OneLine
from twin.effects.catalogue import catalogue, effect_named
from twin.gap.diagnosis import Effected
from twin.gap.fitting import fitted
from twin.gap.naming.twins import with_twins
from twin.gap.search import Explained, bare_fit, explain
from twin.gap.stages.free import Free
from twin.gap.stages.stage import Model

Floats = NDArray[np.float64]
DELAY = Effected("sensor_delay", "z_pos_mm")
POLLED_S, UNHEARD_OF_S = 2.0, 63.0


@dataclass(frozen=True, eq=False)
class LateLine(OneLine):
    """The same line, of a slope of 1, read with a bias or late: the two are one and the same."""

    candidates: tuple[Effected, ...] = (DELAY, BIAS)
    constants: tuple[Free, ...] = ()

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The line at each row of θ, (lanes, n)."""
        values = model.values(theta)
        late = values[DELAY]["delay_s"] if DELAY in values else np.zeros(len(theta))
        return np.asarray(super().predict(model, theta, run) - late[:, None])


@pytest.mark.parametrize(("seconds", "leader"), [(POLLED_S, DELAY), (UNHEARD_OF_S, BIAS)])
def test_of_two_that_are_one_the_first_stays_unless_no_machine_is_known_to_have_so_much_of_it(
    seconds: float, leader: Effected
) -> None:
    stage = LateLine(bias=-seconds)
    model = Model((), (DELAY,))
    best = fitted(stage, model, model.null_theta())
    assert best.values[DELAY]["delay_s"] == pytest.approx(seconds, rel=0.01)
    found = with_twins(stage, Explained(stage, bare_fit(stage), best, (), {}, {}))
    assert found.best.effects == (leader,)
    assert set(found.rivals[leader]) == {DELAY, BIAS} - {leader}


def test_the_search_names_what_machines_are_known_to_have_first() -> None:
    found = explain(LateLine(bias=-UNHEARD_OF_S))
    assert found.best.effects == (BIAS,)
    assert found.rivals[BIAS] == (DELAY,)


def test_a_size_that_is_too_large_stays_named_where_nothing_else_does_the_same() -> None:
    found = explain(LateLine(bias=-UNHEARD_OF_S, candidates=(DELAY,)))
    assert found.best.effects == (DELAY,)


def test_machines_are_known_to_have_every_effect_of_its_typical_size() -> None:
    assert all(effect.is_known_of(effect.typical_values()) for effect in catalogue().values())
    assert not effect_named("sensor_delay").is_known_of({"delay_s": UNHEARD_OF_S})
