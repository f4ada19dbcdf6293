"""The free numbers of a hypothesis."""

import math

import numpy as np
import pytest

from twin.effects.catalogue import catalogue, effect_named
from twin.gap.diagnosis import Effected
from twin.gap.stages.free import Form, constant, effect_parameters
from twin.gap.stages.stage import Model


@pytest.mark.parametrize("name", list(catalogue()))
def test_nothing_free_is_no_effect_and_every_typical_value_comes_back(name: str) -> None:
    effect = effect_named(name)
    for free, parameter in zip(effect_parameters(effect), effect.parameters, strict=True):
        assert free.low <= free.theta_of(parameter.typical) <= free.high
        assert float(free.value(np.array(free.theta_of(parameter.typical)))) == pytest.approx(parameter.typical)
        if parameter.null is not None:
            assert float(free.value(np.array(0.0))) == parameter.null


@pytest.mark.parametrize("name", list(catalogue()))
def test_no_effect_at_a_bound_is_one_that_a_machine_cannot_have(name: str) -> None:
    effect = effect_named(name)
    for free, parameter in zip(effect_parameters(effect), effect.parameters, strict=True):
        for end in (free.low, free.high):
            value = float(free.value(np.array(end)))
            assert value == parameter.null or effect.checked({parameter.name: np.clip(value, parameter.low, parameter.high)})
            assert value == parameter.null or value == pytest.approx(np.clip(value, parameter.low, parameter.high), rel=1e-9)


def test_a_constant_may_not_go_further_than_three_deviations() -> None:
    mass = constant("mass_kg", 0.03)
    assert mass.form is Form.FACTOR
    assert float(mass.value(np.array(mass.high))) == pytest.approx(math.exp(0.09))
    assert float(mass.value(np.array(0.0))) == 1.0


def test_a_sensor_in_another_unit_is_not_kept_away_by_its_prior() -> None:
    (scale,) = effect_parameters(effect_named("sensor_scale"))
    assert abs(scale.theta_of(1000.0)) < 3.0 * scale.sigma


def test_places_and_values_of_a_model_belong_together() -> None:
    model = Model((constant("mass_kg", 0.03),), (Effected("gravity", "z"), Effected("servo_gain", "z")))
    places = dict(model.places())
    assert places[Effected("gravity", "z")] == slice(1, 2)
    assert places[Effected("servo_gain", "z")] == slice(2, 5)
    theta = model.null_theta()
    theta[1] = effect_parameters(effect_named("gravity"))[0].theta_of(-310.0)
    assert model.values(theta[None, :])[Effected("gravity", "z")]["force_n"][0] == pytest.approx(-310.0)
    assert model.with_effect(Effected("payload", "z")).without(Effected("payload", "z")) == model
