"""The contract of effects. A new effect is one file and gets these tests without writing any."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.twin.axes import constants, reference, with_effect
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On
from twin.errors import EffectError
from twin.servo.kernel import axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes

EFFECTS = list(catalogue().values())
ON_AXES = [effect for effect in EFFECTS if set(effect.changes) & set(axis_quantities())]
REFERENCE = reference(1500)
OUTPUTS = ("position_mm", "torque_a", "table_mm")


def run_with(values: dict[str, dict[str, float]]) -> AxisRun:
    """The three axes with these effects."""
    given = constants()
    for name, own in values.items():
        given = with_effect(given, name, own)
    return run_axes(given, AxisInput(REFERENCE, np.arange(3)), effects=tuple(values), outputs=OUTPUTS)


def difference(one: AxisRun, other: AxisRun) -> float:
    """The largest over all outputs."""
    return max(float(np.abs(one.outputs[name] - other.outputs[name]).max()) for name in OUTPUTS)


def named(effect: Effect) -> str:
    return effect.name


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_it_states_what_it_is(effect: Effect) -> None:
    module = Path(f"twin/effects/{effect.name}.py")
    assert module.exists() or Path(__file__).parents[3].joinpath(module).exists()
    assert effect.parameters and effect.equation and effect.reference and effect.changes
    assert effect.shows_in, "an effect that no signal shows cannot be found"
    assert all(p.meaning for p in effect.parameters)
    assert ("{a}" in "".join(effect.shows_in)) == (effect.on is On.AXIS)


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_it_has_a_null_value_at_which_it_is_nothing(effect: Effect) -> None:
    assert any(p.null is not None for p in effect.parameters)
    assert effect.is_null(effect.null_values())
    assert not effect.is_null(effect.typical_values())


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_its_parameters_are_checked(effect: Effect) -> None:
    first = effect.parameters[0]
    with pytest.raises(EffectError, match="has no parameter 'colour'"):
        effect.checked({"colour": 1.0})
    for wrong in (math.nan, first.high * 2 + 1e9, first.low - 1e9):
        with pytest.raises(EffectError, match=first.name):
            effect.checked({first.name: wrong})


@pytest.mark.parametrize("effect", ON_AXES, ids=named)
def test_at_its_null_value_the_axes_run_as_without_it_bit_for_bit(effect: Effect) -> None:
    bare = run_with({})
    null = run_with({effect.name: effect.null_values()})
    for name in OUTPUTS:
        np.testing.assert_array_equal(bare.outputs[name], null.outputs[name])


@pytest.mark.parametrize("effect", ON_AXES, ids=named)
def test_at_a_typical_value_it_shows(effect: Effect) -> None:
    assert difference(run_with({}), run_with({effect.name: effect.typical_values()})) > 1e-4


@pytest.mark.parametrize("effect", ON_AXES, ids=named)
def test_it_is_continuous_at_its_null_value(effect: Effect) -> None:
    def at(part: float) -> dict[str, float]:
        values = effect.typical_values()
        for p in effect.parameters:
            if p.null is not None:
                values[p.name] = p.typical / part if math.isinf(p.null) else p.null + part * (p.typical - p.null)
        return {p.name: min(max(values[p.name], p.low), p.high) for p in effect.parameters}

    bare = run_with({})
    sizes = [difference(bare, run_with({effect.name: at(part)})) for part in (1.0, 0.1, 0.01)]
    assert sizes[2] < 0.35 * sizes[0] + 1e-6, sizes


def test_effects_compose_without_knowing_of_each_other() -> None:
    typical = {effect.name: effect.typical_values() for effect in ON_AXES}
    together = run_with(typical)
    for effect in ON_AXES:
        without = run_with({name: values for name, values in typical.items() if name != effect.name})
        nulled = run_with(typical | {effect.name: effect.null_values()})
        assert difference(without, nulled) == 0.0, f"{effect.name} is not nothing beside the others"
        assert difference(together, nulled) > 0.0


def test_an_unknown_effect_is_named_with_those_that_there_are() -> None:
    with pytest.raises(EffectError, match=r"no effect 'wind'; known are .*backlash"):
        effect_named("wind")


def test_an_effect_of_another_site_does_not_run_on_an_axis() -> None:
    elsewhere = [effect for effect in EFFECTS if effect not in ON_AXES]
    if not elsewhere:
        pytest.skip("all effects act on axes")
    with pytest.raises(EffectError, match="does not act on the loops"):
        run_axes(constants(), AxisInput(REFERENCE, np.arange(3)), effects=(elsewhere[0].name,))
