"""The assembly that the five stages with kernels share: effects that act, constants that are missing, the call of a kernel."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import twin
from tests.twin.axes import reference
from twin.errors import EffectError
from twin.heat.run import Warming, spindle_temperature_c
from twin.kernels.assembly import Assembly, Scalars, kernel_function, kernel_text
from twin.kernels.weave import weave
from twin.process.milling import peak_force
from twin.sensor.reading import readings
from twin.servo.run import AxisInput, run_axes
from twin.sites import Site, at
from twin.spindle.load import spindle_load_pct


def mass(value_c: float, capacity: float) -> float:
    """A mass that warms."""
    next_c = at(Site.THERMAL, value_c + 1.0 / capacity)
    return next_c  # noqa: RET504 - quantities have names


MASS = Assembly((mass,), acts_on="a mass", owner="the mass")
STAGES: dict[str, Callable[[dict[str, float], list[str]], object]] = {
    "the axes": lambda constants, effects: run_axes(
        {name: np.full(3, value) for name, value in constants.items()},
        AxisInput(reference(10), np.arange(3)),
        effects=effects,
        reference_run=True,
    ),
    "the cut": lambda constants, effects: peak_force(
        constants, 2, 3000.0, 300.0, 1.0, 0.0, 1.0, effects=effects, reference_run=True
    ),
    "the spindle": lambda constants, effects: spindle_load_pct(constants, [1.0], 1.0, effects=effects, reference_run=True),
    "the spindle's heat": lambda constants, effects: spindle_temperature_c(
        constants, Warming([0.0, 1.0], 0.0, 0.0, 20.0), 20.0, effects=effects, reference_run=True
    ),
}
ELSEWHERE = {
    "the axes": ("size_effect", "the loops or the mechanics of an axis"),
    "the cut": ("backlash", "the cut"),
    "the spindle": ("backlash", "the spindle"),
    "the spindle's heat": ("backlash", "the spindle's heat"),
}


@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_names_a_constant_that_is_missing(stage: str) -> None:
    with pytest.raises(EffectError, match=rf"the constant \w+ of {stage} is missing"):
        STAGES[stage]({}, [])


@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_names_an_effect_that_acts_elsewhere(stage: str) -> None:
    effect, here = ELSEWHERE[stage]
    with pytest.raises(EffectError, match=rf"^{effect} does not act on {here}; it acts at the [a-z ]+ site$"):
        STAGES[stage]({}, [effect])


def test_a_sensor_names_an_effect_that_acts_elsewhere() -> None:
    with pytest.raises(EffectError, match=r"^backlash does not act on a sensor; it acts at the [a-z ]+ site$"):
        readings(np.zeros(3), np.zeros(3), {"backlash": {}}, reference_run=True)


def test_constants_come_in_the_order_asked_for_and_the_first_one_missing_is_named() -> None:
    assert MASS.taken({"a": 1.0, "b": 2.0}, ["b", "a"]) == [2.0, 1.0]
    with pytest.raises(EffectError, match="the constant c of the mass is missing"):
        MASS.taken({"a": 1.0}, ["a", "c", "d"])


def test_a_kernel_of_a_series_takes_what_the_loop_does_not_feed() -> None:
    scalars = Scalars.of(weave(MASS.physics), (), ("value_c",))
    assert scalars.constants == ("capacity",)
    assert scalars.before_loop() == ["given__capacity = constants[0]"]
    assert scalars.in_loop() == ["capacity = given__capacity"]


def test_a_reference_run_fills_the_arrays_that_the_kernel_fills_and_no_other() -> None:
    text = kernel_text(
        "from math import sqrt", [], ["def roots(given, out):\n    for k in range(2):\n        out[k] = sqrt(given[k])"]
    )
    given, out = np.array([4.0, np.nan]), np.empty(2)
    given.flags.writeable = False
    kernel_function(text, "roots", reference_run=True)(given, out)
    assert out[0] == 2.0
    assert np.isnan(out[1])


def test_kernels_are_declared_and_called_in_the_assembly_alone() -> None:
    package = Path(twin.__file__).parent
    own = package / "kernels"
    texts = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py") if path.parent != own}
    assert [path for path, text in texts.items() if re.search(r"error_model=|kernels\.generated import", text)] == []
