"""The thermal processor on a machine's description: its constants, its effects, and what a new description does to the heat."""

import math
import random
from typing import Any

import numpy as np
import pytest

from processors.thermal import BASIS, PROCESSOR, RESIDUAL, RISE, TEMPERATURE, Config
from tests.processors.machines import THERMAL, Fold, described_as
from twin.simulator.response import RunInput, respond

RUNNING = {"spindle_rpm": 6000.0, "spindle_load_pct": 50.0, "ambient_temp_c": 20.0}
SECOND = {"effect": "second_thermal_mass", "parameters": {"conductance_w_per_k": 4.0, "capacity_j_per_k": 40_000.0}}
COOLANT = {"effect": "coolant_cooling", "parameters": {"gain": 0.42}}
BIAS = {"effect": "sensor_bias", "on": "spindle_temp_c", "parameters": {"bias": 2.0}}


def settled_k(cooling: float = 1.0) -> float:
    """The rise at 6,000 rev/min and 50 %."""
    heat = THERMAL["alpha_w_per_pct_rpm2"] * 50.0 * 6000.0**2 + THERMAL["beta_w_per_rpm"] * 6000.0
    return heat * THERMAL["resistance_k_per_w"] / cooling


def test_a_described_machine_has_the_constants_of_its_file_whatever_old_tables_say() -> None:
    fold = Fold(PROCESSOR, described_as(thermal=THERMAL), resistance_k_per_w=9.0)
    fold.at(0.0, **RUNNING)
    assert fold.tick(1e6)[RISE] == pytest.approx(settled_k(), abs=0.001)
    basis = fold.tick(1e6 + 1)[BASIS]
    assert "assumed" not in basis.removeprefix("started from ambient (an assumption")
    assert f"description {described_as(thermal=THERMAL).version}" in basis


def test_effects_act_and_are_said() -> None:
    fold = Fold(PROCESSOR, described_as(COOLANT, BIAS, thermal=THERMAL))
    fold.at(0.0, **RUNNING, coolant_on=True)
    shown = fold.tick(1e6)
    assert shown[RISE] == pytest.approx(settled_k(1.42), abs=0.001)
    assert shown[TEMPERATURE] == pytest.approx(22.0 + settled_k(1.42), abs=0.001)
    assert shown[BASIS].endswith("with coolant_cooling gain 0.42; with sensor_bias bias 2 on spindle_temp_c")
    fold.at(1e6, coolant_on=False)
    assert fold.tick(2e6)[RISE] == pytest.approx(settled_k(), abs=0.001)


def test_a_coolant_that_nobody_tells_of_is_taken_to_be_off_and_said_where_it_matters() -> None:
    for effects, said in (((COOLANT,), True), ((), False)):
        fold = Fold(PROCESSOR, described_as(*effects, thermal=THERMAL))
        fold.at(0.0, **RUNNING)
        shown = fold.tick(1e6)
        assert shown[RISE] == pytest.approx(settled_k(), abs=0.001)
        assert ("coolant_on is not told, and taken to be off" in shown[BASIS]) is said


def test_a_day_of_the_fold_is_what_the_simulator_makes_of_it() -> None:
    """Irregular messages, ticks between them: the temperature at each tick to a thousandth, as it is published."""
    description = described_as(SECOND, COOLANT, BIAS, thermal=THERMAL)
    chance, fold = random.Random(4), Fold(PROCESSOR, description)
    times, inputs, shown = [], [], []
    for at_s in range(0, 7200, 10):
        if chance.random() < 0.1 or not at_s:
            told = {
                "spindle_rpm": chance.choice((0.0, 3000.0, 8000.0)),
                "spindle_load_pct": chance.uniform(0.0, 90.0),
                "ambient_temp_c": chance.uniform(19.0, 22.0),
                "coolant_on": chance.random() < 0.5,
            }
            fold.at(at_s, **told, **({} if at_s else {"spindle_temp_c": 26.0}))
        times.append(float(at_s))
        inputs.append([float(value) for value in told.values()])
        shown.append(fold.tick(at_s)[TEMPERATURE])
    rpm, load, ambient, coolant = np.array(inputs).T
    run = RunInput(np.array(times), spindle_rpm=rpm, ambient_temp_c=ambient, coolant_on=coolant, start_temp_c=24.0)
    expected = respond(description.machine, run, recorded={"spindle_load_pct": load}, reference_run=True).columns[
        "spindle_temp_c"
    ]
    assert shown == pytest.approx(expected.tolist(), abs=0.0005 + 1e-9)
    assert shown[0] == 26.0  # what a biased sensor shows of 24 °C


def test_a_new_description_takes_the_heat_over_and_closes_the_gap_from_then_on() -> None:
    fold = Fold(PROCESSOR, described_as(thermal=THERMAL))
    fold.at(0.0, **RUNNING)
    before = fold.tick(1800.0)
    fold.describe(described_as(SECOND, COOLANT, thermal=THERMAL))
    after = fold.tick(1800.0)
    assert after[TEMPERATURE] == before[TEMPERATURE]
    assert fold.state.heat.effects == (fold.state.heat.temperature_c,)
    assert fold.tick(1e7)[RISE] == pytest.approx(settled_k(), abs=0.001)
    fold.describe(described_as(COOLANT, thermal=THERMAL))
    fold.at(1e7, coolant_on=True)
    assert fold.tick(2e7)[RISE] == pytest.approx(settled_k(1.42), abs=0.001)
    fold.describe(None)
    assert fold.tick(2e7)[RISE] == pytest.approx(settled_k(1.42), abs=0.001)
    assert fold.tick(2e7 + 1)[BASIS].endswith("heat constants assumed")


def test_a_description_that_comes_while_there_is_no_estimate_changes_nothing_of_that() -> None:
    fold = Fold(PROCESSOR, described_as(thermal=THERMAL))
    fold.describe(described_as(SECOND, thermal=THERMAL))
    assert fold.tick(0.0)[RISE] == "spindle_rpm is not offered"
    fold.at(1.0, **RUNNING)
    assert fold.tick(2.0)[RISE] == pytest.approx(0.0, abs=0.1)


def test_an_ambient_that_becomes_known_shifts_all_temperatures_and_no_rise() -> None:
    known, late = (Fold(PROCESSOR, described_as(SECOND, thermal=THERMAL)) for _ in range(2))
    speed_and_load = {name: RUNNING[name] for name in ("spindle_rpm", "spindle_load_pct")}
    known.at(0.0, **RUNNING)
    late.at(0.0, **speed_and_load)
    assert late.tick(900.0)[RISE] == known.tick(900.0)[RISE]
    assert late.tick(900.0)[TEMPERATURE].startswith("ambient_temp_c is not offered")
    late.at(900.0, ambient_temp_c=20.0)
    assert late.tick(4000.0)[TEMPERATURE] == known.tick(4000.0)[TEMPERATURE]


def test_a_learned_term_over_the_temperature_needs_the_ambient() -> None:
    table = {"temperature_c": [20.0, 40.0], "value": [0.0, 30.0]}
    term = {"effect": "learned", "site": "heat_loss", "table": table}
    fold = Fold(PROCESSOR, described_as(term, thermal=THERMAL))
    fold.at(0.0, spindle_rpm=6000.0, spindle_load_pct=50.0)
    assert fold.tick(1.0)[RISE].startswith("ambient_temp_c is not known")
    fold.at(2.0, ambient_temp_c=20.0)
    risen_k = [fold.tick(2.0 + 60.0 * number)[RISE] for number in range(1, 400)]
    assert 0.7 * settled_k() < risen_k[-1] < 0.95 * settled_k()


def test_what_is_assumed_is_said() -> None:
    for description, table, said in (
        (None, {}, "heat constants assumed"),
        (None, {"resistance_k_per_w": 0.2, "beta_w_per_rpm": 0.01}, "alpha_w_per_pct_rpm2, capacity_j_per_k assumed"),
        (None, THERMAL, ""),
        (described_as(), {}, "heat constants assumed"),
        (described_as(machine={"assumed": ["thermal"]}, thermal=THERMAL), {}, "heat constants assumed"),
        (described_as(machine={"assumed": ["thermal.beta_w_per_rpm"]}, thermal=THERMAL), {}, "beta_w_per_rpm assumed"),
    ):
        fold = Fold(PROCESSOR, description, **table)
        fold.at(0.0, **RUNNING, spindle_temp_c=21.0)
        basis = fold.tick(1.0)[BASIS]
        assert basis.endswith(said)
        assert ("assumed" in basis) is bool(said)


def test_constants_in_a_table_of_old_are_named_with_where_they_belong() -> None:
    assert Config(resistance_k_per_w=0.2).belongs_elsewhere("thermal") == (
        "[thermal] resistance_k_per_w belongs in machines/<name>.toml, [thermal]; it is used until a machine has a file",
    )
    assert Config(ambient_temp_c=22.0).belongs_elsewhere("thermal") == ()


@pytest.mark.parametrize("value", [1, "on", None, math.nan])
def test_a_coolant_that_is_no_yes_or_no_is_not_told(value: Any) -> None:
    fold = Fold(PROCESSOR, described_as(COOLANT, thermal=THERMAL))
    fold.at(0.0, **RUNNING, coolant_on=value)
    assert "coolant_on is not told" in fold.tick(1.0)[BASIS]


def test_the_residual_is_against_what_the_sensor_would_show() -> None:
    fold = Fold(PROCESSOR, described_as(BIAS, thermal=THERMAL))
    fold.at(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=20.0, spindle_temp_c=22.0)
    assert fold.tick(60.0) | {BASIS: ""} == {TEMPERATURE: 22.0, RESIDUAL: 0.0, RISE: 0.0, BASIS: ""}
