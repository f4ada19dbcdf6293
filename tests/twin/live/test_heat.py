"""The live heat is the simulator's: sample for sample, with every effect, however irregular the samples."""

import math
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.depth import examples
from twin.effects.catalogue import catalogue
from twin.effects.effect import Effect, On
from twin.errors import EffectError, MachineError
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.live.heat import HeatInput, HeatState, LiveHeat
from twin.machine import MachineFile
from twin.sensor.sensing import sensor_quantities
from twin.simulator.response import RunInput, respond

THERMAL = {
    "alpha_w_per_pct_rpm2": 2.2e-8,
    "beta_w_per_rpm": 1.6e-2,
    "resistance_k_per_w": 0.12,
    "capacity_j_per_k": 9000.0,
}
ON_HEAT = [one for one in catalogue().values() if set(one.changes) & set(thermal_quantities())]
ON_SENSOR = [one for one in catalogue().values() if set(one.changes) & set(sensor_quantities()) and one.on is On.SIGNAL]
LOAD_TABLE = {"load_pct": [0.0, 40.0, 90.0], "value": [0.0, 25.0, -10.0]}
WARM = HeatInput(30.0, 5000.0, 20.0, 1.0)


def machine(*effects: dict[str, Any]) -> MachineFile:
    return MachineFile.model_validate({"machine": {"name": "vmc"}, "thermal": THERMAL, "effects": list(effects)})


def drawn(effect: Effect, chance: random.Random, on: str = "") -> dict[str, Any]:
    """An effect of a size that a machine may have."""
    sizes = {p.name: min(max(p.typical * chance.uniform(0.3, 3.0), p.low), p.high) for p in effect.parameters}
    return {"effect": effect.name, "on": on, "parameters": sizes}


def course(chance: random.Random, samples: int) -> tuple[list[float], list[HeatInput]]:
    """Irregular times, and inputs that change between them."""
    times, told, at_s = [], [], 0.0
    for _ in range(samples):
        coolant = float(chance.random() < 0.5)
        told.append(HeatInput(chance.uniform(-20.0, 130.0), chance.uniform(-9000.0, 9000.0), chance.uniform(15.0, 30.0), coolant))
        times.append(at_s)
        at_s += 10.0 ** chance.uniform(-2.0, 3.0)
    return times, told


def stepped(heat: LiveHeat, start_c: float, times: list[float], told: list[HeatInput]) -> tuple[list[float], list[float]]:
    """Temperatures and readings at the samples."""
    state = heat.started(start_c, told[0])
    temperatures, readings = [state.temperature_c], [heat.reading(state, told[0])]
    for number in range(1, len(times)):
        state = heat.step(state, told[number - 1], times[number] - times[number - 1])
        temperatures.append(state.temperature_c)
        readings.append(heat.reading(state, told[number]))
    return temperatures, readings


def responded(made: MachineFile, start_c: float, times: list[float], told: list[HeatInput], **options: Any) -> list[float]:
    load, rpm, ambient, coolant = (np.array(column) for column in zip(*told, strict=True))
    run = RunInput(np.array(times), spindle_rpm=rpm, ambient_temp_c=ambient, coolant_on=coolant, start_temp_c=start_c)
    return respond(made, run, recorded={"spindle_load_pct": load}, **options).columns["spindle_temp_c"].tolist()


@pytest.mark.parametrize("seed", range(examples(40, 12)))
def test_random_machines_with_any_effects_on_heat_and_sensor_read_what_the_simulator_reads(seed: int) -> None:
    chance = random.Random(seed)
    on_heat = chance.sample(ON_HEAT, chance.randint(0, len(ON_HEAT)))
    on_sensor = chance.sample(ON_SENSOR, chance.randint(0, len(ON_SENSOR)))
    made = machine(*(drawn(e, chance) for e in on_heat), *(drawn(e, chance, "spindle_temp_c") for e in on_sensor))
    times, told = course(chance, 80)
    _, readings = stepped(LiveHeat.of(made), 24.0, times, told)
    expected = responded(made, 24.0, times, told, reference_run=True)
    size = max(1.0, *(abs(value) for value in expected))  # a scale of another unit makes thousands of degrees
    assert max(abs(a - b) for a, b in zip(readings, expected, strict=True)) < 1e-9 * size


@pytest.mark.parametrize("effect", [*ON_HEAT, *ON_SENSOR], ids=lambda effect: effect.name)
def test_each_effect_alone_makes_a_difference_and_the_same_one(effect: Effect) -> None:
    chance = random.Random(effect.name)
    on = "spindle_temp_c" if effect in ON_SENSOR else ""
    typical = {"effect": effect.name, "on": on, "parameters": {p.name: p.typical for p in effect.parameters}}
    if "delay_s" in typical["parameters"] or "time_constant_s" in typical["parameters"]:
        typical["parameters"] = dict.fromkeys(typical["parameters"], 60.0)
    times, told = course(chance, 60)
    _, readings = stepped(LiveHeat.of(machine(typical)), 24.0, times, told)
    _, plain = stepped(LiveHeat.of(machine()), 24.0, times, told)
    expected = responded(machine(typical), 24.0, times, told)  # compiled
    assert readings == pytest.approx(expected, abs=1e-9)
    assert max(abs(a - b) for a, b in zip(readings, plain, strict=True)) > 0.05


def test_learned_terms_at_all_three_sites_do_what_they_do_in_the_simulator() -> None:
    flow = {"effect": "learned", "site": "heat_input", "table": LOAD_TABLE}
    loss = {"effect": "learned", "site": "heat_loss", "table": {"spindle_rpm": [0.0, 8000.0], "value": [0.0, 40.0]}}
    shown = {"temperature_c": [20.0, 40.0], "coolant_on": [0.0, 1.0]}
    table = {
        "temperature_c": [20.0, 20.0, 40.0, 40.0],
        "coolant_on": [0.0, 1.0, 0.0, 1.0],
        "value": [0.0, 0.5, 1.0, -2.0],
    }
    assert set(shown) < set(table)
    reading = {"effect": "learned", "site": "temperature_reading", "on": "spindle_temp_c", "table": table}
    made = machine(flow, loss, reading)
    times, told = course(random.Random(3), 60)
    _, readings = stepped(LiveHeat.of(made), 24.0, times, told)
    assert readings == pytest.approx(responded(made, 24.0, times, told), abs=1e-9)


def test_a_term_over_the_temperature_that_it_makes_is_solved_sample_by_sample() -> None:
    """The simulator goes through the whole run until the term changes no more; the live fold has it at once."""
    table = {"temperature_rise_k": [0.0, 5.0, 20.0], "value": [40.0, 10.0, 0.0]}
    made = machine({"effect": "learned", "site": "heat_loss", "table": table})
    heat = LiveHeat.of(made)
    times, told = course(random.Random(5), 60)
    temperatures, _ = stepped(heat, 24.0, times, told)
    load, rpm, ambient, coolant = (np.array(column) for column in zip(*told, strict=True))
    term = made.learned[0].term
    added = -term.at({"temperature_rise_k": np.array(temperatures) - ambient})
    assert made.thermal is not None
    expected = spindle_temperature_c(
        thermal_constants(made.thermal), Warming(times, load, rpm, ambient, coolant), 24.0, added_w=added
    )[0]
    assert temperatures == pytest.approx(expected.tolist(), abs=1e-9)


def test_how_a_constant_stretch_is_cut_into_steps_changes_nothing() -> None:
    heat = LiveHeat.of(machine(*(drawn(e, random.Random(1)) for e in ON_HEAT)))
    once = heat.step(heat.started(24.0, WARM), WARM, 3600.0)
    often = heat.started(24.0, WARM)
    for _ in range(3600):
        often = heat.step(often, WARM, 1.0)
    assert often.temperature_c == pytest.approx(once.temperature_c, abs=1e-9)
    assert often.effects == pytest.approx(once.effects, abs=1e-9)


RISES, WATTS, TIMES = st.floats(-50.0, 200.0), st.floats(0.0, 1e4), st.floats(0.0, 1e5)
FRICTION = LiveHeat.of(MachineFile.model_validate({"machine": {"name": "vmc"}, "thermal": {**THERMAL, "beta_w_per_rpm": 1.0}}))
"""A watt by rev/min, so that a speed is a heat."""


def risen_k(rise_k: float, heat_w: float, duration_s: float) -> float:
    told = HeatInput(0.0, heat_w, 20.0)
    return FRICTION.step(FRICTION.started(20.0 + rise_k, told), told, duration_s).temperature_c - 20.0


def test_after_one_time_constant_63_2_percent_of_the_rise_is_there_and_after_many_all_of_it() -> None:
    assert risen_k(0.0, 100.0, 0.12 * 9000.0) == pytest.approx(100.0 * 0.12 * (1 - math.exp(-1)))
    assert risen_k(3.0, 250.0, 1e6) == pytest.approx(30.0)
    assert risen_k(8.0, 0.0, math.log(2) * 0.12 * 9000.0) == pytest.approx(4.0)


@given(RISES, WATTS, TIMES, TIMES)
def test_two_steps_are_one_step(rise: float, heat: float, first: float, second: float) -> None:
    in_two = risen_k(risen_k(rise, heat, first), heat, second)
    assert in_two == pytest.approx(risen_k(rise, heat, first + second), abs=1e-9, rel=1e-9)


@given(RISES, WATTS, TIMES)
def test_the_rise_moves_towards_the_steady_state_and_never_past_it(rise: float, heat: float, duration: float) -> None:
    final, after = heat * 0.12, risen_k(rise, heat, duration)
    assert min(rise, final) - 1e-9 <= after <= max(rise, final) + 1e-9
    assert risen_k(rise, heat, 0.0) == pytest.approx(rise, abs=1e-9)


def test_small_euler_steps_approach_the_exact_one() -> None:
    rise, step_s = 0.0, 0.01
    for _ in range(60_000):
        rise += step_s * (200.0 - rise / 0.12) / 9000.0
    assert risen_k(0.0, 200.0, 600.0) == pytest.approx(rise, abs=1e-4)


def test_heat_ignores_the_sense_of_rotation_and_braking() -> None:
    heat = LiveHeat.of(machine())
    warm = [heat.step(heat.started(24.0, told), told, 60.0) for told in (WARM, WARM._replace(spindle_rpm=-5000.0))]
    assert warm[0] == warm[1]
    braking = [WARM._replace(spindle_load_pct=load_pct) for load_pct in (-20.0, 0.0)]
    cool = [heat.step(heat.started(24.0, told), told, 60.0) for told in braking]
    assert cool[0] == cool[1] != warm[0]


def test_it_starts_from_what_the_sensor_shows() -> None:
    chance = random.Random(7)
    biased = {"effect": "sensor_bias", "on": "spindle_temp_c", "parameters": {"bias": 2.5}}
    scaled = {"effect": "sensor_scale", "on": "spindle_temp_c", "parameters": {"scale": 1.8}}
    for effects in ((), (biased,), (scaled,), (biased, scaled), tuple(drawn(e, chance, "spindle_temp_c") for e in ON_SENSOR)):
        heat = LiveHeat.of(machine(*effects, *(drawn(e, chance) for e in ON_HEAT)))
        state = heat.started_at_reading(57.0, WARM)
        assert state is not None
        assert heat.reading(state, WARM) == pytest.approx(57.0, abs=1e-9)
        assert all(value == state.temperature_c for value in state.effects)


def test_a_sensor_that_shows_the_same_at_any_temperature_says_nothing_of_the_start() -> None:
    dead = {"effect": "sensor_scale", "on": "spindle_temp_c", "parameters": {"scale": 0.0}}
    assert LiveHeat.of(machine(dead)).started_at_reading(57.0, WARM) is None


def test_another_description_takes_the_heat_over_and_what_is_new_starts_as_declared() -> None:
    bare, second = LiveHeat.of(machine()), LiveHeat.of(machine(drawn(ON_HEAT[1], random.Random(1))))
    assert second.names
    hot = bare.step(bare.started(24.0, WARM), WARM, 3600.0)
    taken = second.continued(hot, WARM)
    assert (taken.temperature_c, taken.effects) == (hot.temperature_c, (hot.temperature_c,))
    warm = second.step(taken, WARM, 600.0)
    assert second.continued(warm, WARM) == warm
    assert bare.continued(warm, WARM) == HeatState(warm.temperature_c, warm.time_s)


def test_where_the_zero_of_the_temperatures_is_changes_no_rise() -> None:
    heat = LiveHeat.of(machine(*(drawn(e, random.Random(2)) for e in ON_HEAT)))
    told = WARM._replace(ambient_c=0.0)
    relative = heat.step(heat.started(5.0, told), told, 900.0)
    absolute = heat.step(heat.shifted(heat.started(5.0, told), 20.0), WARM, 900.0)
    assert absolute.temperature_c == pytest.approx(relative.temperature_c + 20.0, abs=1e-9)
    assert not heat.needs_ambient


def test_what_no_live_signal_tells_is_left_out_and_said() -> None:
    table = {"axial_depth_mm": [0.0, 2.0], "value": [0.0, 50.0]}
    heat = LiveHeat.of(machine({"effect": "learned", "site": "heat_input", "table": table}))
    assert heat.in_words == ("without the learned term at heat_input: no live signal tells axial_depth_mm",)
    bare = LiveHeat.of(machine())
    assert heat.step(heat.started(24.0, WARM), WARM, 60.0) == bare.step(bare.started(24.0, WARM), WARM, 60.0)


def test_effects_are_said_in_words() -> None:
    heat = LiveHeat.of(machine({"effect": "coolant_cooling", "parameters": {"gain": 0.42}}))
    assert heat.in_words == ("with coolant_cooling gain 0.42",)


def test_a_machine_without_heat_or_with_an_effect_that_does_not_fit_is_refused() -> None:
    with pytest.raises(MachineError, match=r"vmc has no \[thermal\]"):
        LiveHeat.of(MachineFile.model_validate({"machine": {"name": "vmc"}}))
    with pytest.raises(EffectError, match="gain is -3"):
        LiveHeat.of(machine({"effect": "coolant_cooling", "parameters": {"gain": -3.0}}))
