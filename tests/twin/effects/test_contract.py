"""The contract of effects. A new effect is one file and gets these tests without writing any."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.twin.axes import constants, reference, with_effect
from tests.twin.effects.made_with import between, diagnosed, outcome
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On, Recorded, called
from twin.errors import EffectError
from twin.gap.labels import AXIS
from twin.heat.run import HEAT
from twin.kernels.weave import quantities
from twin.machine import Program
from twin.motion.control import LENGTH_OVER_FEED, QUANTITIES, changed
from twin.motion.limits import Limits
from twin.motion.path import path_from_moves
from twin.motion.plan import Plan
from twin.motion.sampling import sampled
from twin.process.kernel import CUT
from twin.programs import interpret
from twin.sensor.clock import looked_at, stamped
from twin.sensor.sensing import SENSOR
from twin.servo.kernel import AXES, axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.sites import Site
from twin.spindle.load import SPINDLE

EFFECTS = list(catalogue().values())
ON_AXES = [effect for effect in EFFECTS if set(effect.changes) & set(axis_quantities())]
ON_PROGRAMS = [effect for effect in EFFECTS if set(effect.changes) & set(QUANTITIES)]
MARKED = {
    **{name: site for stage in (AXES, CUT, SPINDLE, HEAT, SENSOR) for name, site in stage.quantities().items()},
    **quantities((looked_at, stamped)),
}
"""Quantity → the member of Site at which the physics marks it."""
REFERENCE = reference(1500)
PATH = path_from_moves(
    interpret(
        "T1 M6\nS6000 M3\nG0 X20 Y5\nG1 Z-1 F3000\n"
        + "\n".join(f"G1 X{20 + k} Y{5 + k % 2}" for k in range(1, 20))
        + "\n"
        + "\n".join(f"G1 X{39 + 0.2 * k:.1f}" for k in range(1, 51))
        + "\nG2 X59 Y16 I5 J5 F2000\nG1 X200 F6000\nG0 Z20\nT2 M6\nG0 X0\nM30\n"
    )
)
STATED = Limits.of(
    Program(rapid_mm_min=30000.0, acceleration_mm_s2=4000.0, jerk_mm_s3=90000.0, corner_speed_difference_mm_min=900.0)
)
OUTPUTS = ("position_mm", "torque_a", "table_mm")


def run_with(values: dict[str, dict[str, float]], *, reference_run: bool = False) -> AxisRun:
    """The three axes with these effects; the reference run gives the same bits, and compiles nothing."""
    given = constants()
    for name, own in values.items():
        given = with_effect(given, name, own)
    return run_axes(
        given, AxisInput(REFERENCE, np.arange(3)), effects=tuple(values), outputs=OUTPUTS, reference_run=reference_run
    )


def difference(one: AxisRun, other: AxisRun) -> float:
    """The largest over all outputs."""
    return max(float(np.abs(one.outputs[name] - other.outputs[name]).max()) for name in OUTPUTS)


def plan_with(values: dict[str, dict[str, float]], limits: Limits) -> Plan:
    """The plan of a program with corners, arcs, rapids and tool changes, on a control with these effects."""
    return changed(limits, values).plan(PATH)


def seconds_between(one: Plan, other: Plan) -> float:
    return float(np.abs(one.seconds_by_line() - other.seconds_by_line()).max())


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_says_itself_in_plain_words(effect: Effect) -> None:
    said = effect.says.format(on="Z")
    assert said and "_" not in said and not said.endswith(".")
    assert ("Z" in said) is (effect.on is not On.MACHINE), "it says what it is on, where it is on something"


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_it_changes_quantities_that_its_site_has(effect: Effect) -> None:
    for quantity in effect.changes:
        has = sorted(QUANTITIES) if effect in ON_PROGRAMS else sorted(name for name in MARKED if MARKED[name] == effect.site.name)
        assert quantity in has, f"{quantity!r} is no quantity of the {effect.site} site, which has: {', '.join(has)}"


FOUND = ("backlash", "cutting_coefficient", "coolant_cooling", "sensor_bias", "tool_change_time")
"""One of each kind of stage, and cheap; `benchmarks/gap/effects_found.py` asks it of all."""


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
    bare = run_with({})
    sizes = [difference(bare, run_with({effect.name: between(effect, part)})) for part in (1.0, 0.1, 0.01)]
    assert sizes[2] < 0.35 * sizes[0] + 1e-6, sizes


@pytest.mark.parametrize("limits", [LENGTH_OVER_FEED, STATED], ids=["length over feed", "a stated control"])
@pytest.mark.parametrize("effect", ON_PROGRAMS, ids=named)
def test_at_its_null_value_a_program_is_planned_as_without_it_bit_for_bit(effect: Effect, limits: Limits) -> None:
    bare, null = plan_with({}, limits), plan_with({effect.name: effect.null_values()}, limits)
    assert bare.total_s == null.total_s
    for one, other in ((bare.start_s, null.start_s), (bare.peak_mm_s, null.peak_mm_s), (bare.event_start_s, null.event_start_s)):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(sampled(bare, 0.01).spindle_rpm, sampled(null, 0.01).spindle_rpm)


@pytest.mark.parametrize("limits", [LENGTH_OVER_FEED, STATED], ids=["length over feed", "a stated control"])
@pytest.mark.parametrize("effect", ON_PROGRAMS, ids=named)
def test_at_a_typical_value_a_program_takes_another_time_and_at_its_null_value_continuously_none(
    effect: Effect, limits: Limits
) -> None:
    bare = plan_with({}, limits)
    parts = [plan_with({effect.name: between(effect, part)}, limits) for part in (1.0, 0.1, 0.01)]
    sizes = [seconds_between(bare, one) for one in parts]
    assert sizes[0] > 0.005
    assert sizes[2] < 0.35 * sizes[0] + 1e-6, sizes


def test_effects_on_programs_compose_without_knowing_of_each_other() -> None:
    typical = {effect.name: effect.typical_values() for effect in ON_PROGRAMS}
    together = plan_with(typical, LENGTH_OVER_FEED)
    for effect in ON_PROGRAMS:
        without = plan_with({name: values for name, values in typical.items() if name != effect.name}, LENGTH_OVER_FEED)
        nulled = plan_with(typical | {effect.name: effect.null_values()}, LENGTH_OVER_FEED)
        assert seconds_between(without, nulled) == 0.0, f"{effect.name} is not nothing beside the others"
        assert seconds_between(together, nulled) > 0.0


def test_no_effect_acts_on_programs_and_on_something_else() -> None:
    for effect in ON_PROGRAMS:
        assert effect.site is Site.PROGRAM
        assert set(effect.changes) <= set(QUANTITIES)
        assert effect not in ON_AXES
    assert {effect.name for effect in EFFECTS if effect.site is Site.PROGRAM} == {effect.name for effect in ON_PROGRAMS}


def test_effects_compose_without_knowing_of_each_other() -> None:
    typical = {effect.name: effect.typical_values() for effect in ON_AXES}
    together = run_with(typical, reference_run=True)
    for effect in ON_AXES:
        others = {name: values for name, values in typical.items() if name != effect.name}
        without = run_with(others, reference_run=True)
        nulled = run_with(typical | {effect.name: effect.null_values()}, reference_run=True)
        assert difference(without, nulled) == 0.0, f"{effect.name} is not nothing beside the others"
        assert difference(together, nulled) > 0.0


@pytest.mark.parametrize("effect", [effect_named(name) for name in FOUND], ids=named)
def test_a_machine_made_with_it_is_diagnosed_as_it_or_as_a_class_that_holds_it(effect: Effect) -> None:
    found, size = diagnosed(effect, 10.0)
    assert size > 5.0
    assert outcome(effect, found) in ("named", "in the class"), found.sentence


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_what_it_declares_for_the_diagnosis_is_of_this_effect_and_of_its_kind(effect: Effect) -> None:
    parameters = {p.name for p in effect.parameters}
    assert set(effect.carried) <= set(effect.states)
    assert {*effect.lowers.values(), *effect.multiplies.values()} <= parameters
    assert set(effect.at_rest) <= {"load_n", "bristle_mm"}
    assert set(effect.likely_in) <= {*(name.rstrip(" -+") for name in AXIS), "table"}
    assert effect.on is On.AXIS or not (effect.likely_in or effect.at_rest or effect.carried or effect.usual_on)
    assert effect.on is On.SIGNAL or effect.undo is None
    assert effect.site in (Site.REFERENCE, Site.CLOCK) or effect.late_s is None
    guesses = effect.first_guesses(Recorded(0.001, lambda _: 10.0, lambda: 25.4))
    assert all(set(guess) <= parameters for guess in guesses)
    assert all(effect.checked(guess) for guess in guesses)
    assert effect.first_guesses(Recorded(0.001)) in ((), guesses), "what is not recorded suggests nothing"


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e.undo is not None], ids=named)
def test_what_a_sensor_at_rest_reads_is_taken_back(effect: Effect) -> None:
    given = {name: np.array([value]) for name, value in between(effect, 0.5).items()}
    read = called(effect.changes["reading"], given, np.array([21.5]))
    assert called(effect.undo, given, read) == pytest.approx(21.5)  # type: ignore[arg-type]


def test_an_unknown_effect_is_named_with_those_that_there_are() -> None:
    with pytest.raises(EffectError, match=r"no effect 'wind'; known are .*backlash"):
        effect_named("wind")


def test_an_effect_of_another_site_does_not_run_on_an_axis() -> None:
    elsewhere = [effect for effect in EFFECTS if effect not in ON_AXES]
    if not elsewhere:
        pytest.skip("all effects act on axes")
    with pytest.raises(EffectError, match="does not act on the loops"):
        run_axes(constants(), AxisInput(REFERENCE, np.arange(3)), effects=(elsewhere[0].name,))
