"""The live load meter is the simulator's, and its inverse undoes it."""

import random
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.depth import examples
from twin.effects.catalogue import catalogue
from twin.effects.effect import Effect
from twin.live.spindle import LiveSpindle, mean_tangential_n
from twin.machine import MachineFile
from twin.sensor.reading import readings
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

DRIVE = {"rated_power_kw": 11.0, "efficiency": 0.85, "idle_power_kw": 0.25}
ON_LOAD = [one for one in catalogue().values() if set(one.changes) & set(spindle_quantities())]
SENSOR = ("sensor_bias", "sensor_scale")
HELD = {"effect": "load_peak_hold", "parameters": {"hold_s": 2.0}}


def machine(*effects: dict[str, Any]) -> MachineFile:
    return MachineFile.model_validate({"machine": {"name": "vmc"}, "spindle": DRIVE, "effects": list(effects)})


def drawn(effect: Effect, chance: random.Random, on: str = "") -> dict[str, Any]:
    sizes = {p.name: min(max(p.typical * chance.uniform(0.3, 1.7), p.low), p.high) for p in effect.parameters}
    return {"effect": effect.name, "on": on, "parameters": sizes}


def simulated(made: MachineFile, power_kw: float, rpm: float) -> float:
    """The load in the middle of a long cut, by the simulator: long after its start, with its sensor settled."""
    assert made.spindle is not None
    on_load = {e.effect: e.parameters for e in made.effects if not e.on}
    on_sensor = {e.effect: e.parameters for e in made.effects if e.on}
    constants = spindle_constants(made.spindle)
    constants |= {f"{e}__{k}": v for e, given in on_load.items() for k, v in catalogue()[e].checked(given).items()}
    power_w = np.full(3, 1000.0 * power_kw)
    shown = spindle_load_pct(constants, power_w, rpm, period_s=1.0, effects=tuple(on_load), reference_run=True)[0]
    return float(readings(shown, np.array([0.0, 1.0, 1.0]), on_sensor, reference_run=True)[-1])


@pytest.mark.parametrize("seed", range(examples(60, 20)))
def test_random_machines_show_what_the_simulator_shows_and_the_inverse_finds_the_power(seed: int) -> None:
    chance = random.Random(seed)
    on_load = [drawn(e, chance) for e in chance.sample(ON_LOAD, chance.randint(0, len(ON_LOAD)))]
    on_sensor = [drawn(catalogue()[e], chance, "spindle_load_pct") for e in chance.sample(SENSOR, chance.randint(0, 2))]
    made = machine(*on_load, *on_sensor)
    spindle = LiveSpindle.of(made)
    for _ in range(20):
        power_kw, rpm = chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 30.0))), chance.uniform(-9000.0, 9000.0)
        shown_pct = simulated(made, power_kw, rpm)
        assert spindle.load_pct(power_kw, rpm) == pytest.approx(shown_pct, abs=1e-9)
        assert spindle.cutting_power_kw(shown_pct, rpm) == pytest.approx(power_kw, rel=1e-9, abs=1e-9)


def test_what_does_not_bend_the_meter_is_undone_in_closed_form() -> None:
    straight = ("rated_power", "idle_speed_power")
    for effect in ON_LOAD:
        spindle = LiveSpindle.of(machine(drawn(effect, random.Random(1))))
        assert spindle.is_straight is (effect.name in straight)
    assert LiveSpindle.of(machine()).is_straight


def test_a_load_of_air_or_less_is_no_cut() -> None:
    for effect in ON_LOAD:
        spindle = LiveSpindle.of(machine(drawn(effect, random.Random(1))))
        for rpm in (0.0, 1000.0, 8000.0):
            idle_pct = spindle.idle_load_pct(rpm)
            assert spindle.cutting_power_kw(idle_pct, rpm) == 0.0
            assert spindle.cutting_power_kw(0.5 * idle_pct, rpm) == 0.0


def test_idle_load_grows_with_the_speed_where_the_machine_says_so() -> None:
    effect = {"effect": "idle_speed_power", "parameters": {"power_kw": 0.55, "exponent": 2.0}}
    spindle = LiveSpindle.of(machine(effect))
    assert spindle.idle_load_pct(0.0) == pytest.approx(100.0 * 0.25 / 11.0)
    assert spindle.idle_load_pct(5000.0) == spindle.idle_load_pct(-5000.0) == pytest.approx(100.0 * 0.80 / 11.0)
    assert spindle.in_words == ("with idle_speed_power exponent 2, power_kw 0.55",)


def test_a_learned_term_of_the_power_is_over_the_load_without_it_as_in_the_simulator() -> None:
    table = {"load_pct": [0.0, 20.0, 60.0], "value": [0.0, 0.6, 1.5]}
    made = machine({"effect": "learned", "site": "spindle_power", "table": table})
    spindle = LiveSpindle.of(made)
    bare = LiveSpindle.of(machine())
    for power_kw in (0.0, 0.8, 3.0, 9.0):
        without = bare.load_pct(power_kw, 3000.0)
        shown = without + 100.0 * np.interp(without, table["load_pct"], table["value"]) / 11.0
        assert spindle.load_pct(power_kw, 3000.0) == pytest.approx(shown, abs=1e-9)
        assert spindle.cutting_power_kw(shown, 3000.0) == pytest.approx(power_kw, rel=1e-9, abs=1e-9)
    assert spindle.in_words == ("with a learned term at spindle_power over load_pct",)


def test_a_load_that_a_peak_has_fallen_to_is_known_as_such() -> None:
    spindle = LiveSpindle.of(machine(HELD))
    assert spindle.holds
    assert not LiveSpindle.of(machine()).holds
    fallen_pct = 60.0 * np.exp(-0.5 / 2.0)
    assert spindle.is_held(fallen_pct, 3000.0, 60.0, 0.5)
    assert spindle.is_held(0.9 * fallen_pct, 3000.0, 60.0, 0.5)
    assert not spindle.is_held(1.1 * fallen_pct, 3000.0, 60.0, 0.5)
    assert not spindle.is_held(60.0, 3000.0, 60.0, 0.5)
    assert not spindle.is_held(fallen_pct, 3000.0, 60.0, 20.0)
    assert not LiveSpindle.of(machine()).is_held(fallen_pct, 3000.0, 60.0, 0.5)


def test_what_the_simulated_meter_shows_while_it_holds_a_peak_is_called_held_and_a_cut_above_it_is_not() -> None:
    """A cut of 5 kW, none, then one of 2 kW: unknown from the fall until the meter shows the second cut."""
    made = machine(HELD)
    assert made.spindle is not None
    spindle, constants = LiveSpindle.of(made), spindle_constants(made.spindle) | {"load_peak_hold__hold_s": 2.0}
    power_w = np.repeat([5000.0, 0.0, 2000.0], [10, 10, 40])
    shown = spindle_load_pct(constants, power_w, 3000.0, period_s=0.1, effects=("load_peak_hold",), reference_run=True)[0]
    held = [spindle.is_held(float(b), 3000.0, float(a), 0.1) for a, b in pairwise(shown)]
    second_pct = spindle.load_pct(2.0, 3000.0)
    first_known = next(i for i in range(10, 60) if shown[i] <= second_pct + 1e-9)
    assert not any(held[:9])
    assert all(held[9 : first_known - 1])
    assert not any(held[first_known + 1 :])
    known = [spindle.cutting_power_kw(float(shown[i]), 3000.0) for i in (5, 59)]
    assert known == pytest.approx([5.0, 2.0], rel=1e-9)


def test_a_sensor_that_shows_the_same_at_any_load_says_nothing_of_the_cut() -> None:
    dead = {"effect": "sensor_scale", "on": "spindle_load_pct", "parameters": {"scale": 0.0}}
    assert LiveSpindle.of(machine(dead)).cutting_power_kw(30.0, 3000.0) is None


def test_a_load_that_no_power_shows_says_nothing() -> None:
    table = {"load_pct": [0.0, 20.0, 60.0], "value": [0.0, 0.0, 0.0]}
    spindle = LiveSpindle.of(machine({"effect": "learned", "site": "spindle_power", "table": table}))
    assert spindle.cutting_power_kw(1e9, 3000.0) is None


def test_force_and_power_are_one_over_the_speed_of_the_edge() -> None:
    assert mean_tangential_n(4.0, 20.0, -3000.0) == pytest.approx(4000.0 / (np.pi * 0.020 * 50.0))
