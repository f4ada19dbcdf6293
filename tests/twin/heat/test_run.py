"""The spindle's temperature: exact steps, laws, and recordings of an independent reference machine."""

import math

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from tests.recordings import recording
from twin.errors import EffectError, TwinError
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.machine import Thermal, read_machine

THERMAL = Thermal(alpha_w_per_pct_rpm2=2.2e-8, beta_w_per_rpm=0.016, resistance_k_per_w=0.12, capacity_j_per_k=9000.0)
CONSTANTS = thermal_constants(THERMAL)
MASS = {"second_thermal_mass__conductance_w_per_k": 4.0, "second_thermal_mass__capacity_j_per_k": 40000.0}
NULL = {
    "second_thermal_mass": {"conductance_w_per_k": 0.0, "capacity_j_per_k": 40000.0},
    "speed_convection": {"gain": 0.0, "exponent": 0.7},
    "coolant_cooling": {"gain": 0.0},
}


def a_shift(samples: int = 200, step_s: float = 10.0) -> Warming:
    t = np.arange(samples) * step_s
    rpm = np.where(np.sin(t / 400.0) > 0.0, 6000.0, 1500.0)
    return Warming(t, 30.0 + 20.0 * np.sin(t / 300.0), rpm, 22.0 + 0.5 * np.cos(t / 900.0), (t % 700.0 > 350.0).astype(float))


@given(st.lists(st.floats(0.1, 5000.0), min_size=1, max_size=20), st.floats(0.0, 100.0), st.floats(0.0, 8000.0))
def test_each_step_is_the_closed_form_of_one_mass(steps: list[float], load: float, rpm: float) -> None:
    final_k = 0.12 * (2.2e-8 * load * rpm * rpm + 0.016 * rpm)
    rise, expected = 3.0, [3.0]
    for step in steps:
        rise = final_k + (rise - final_k) * math.exp(-step / (0.12 * 9000.0))
        expected.append(rise)
    warming = Warming(np.concatenate([[0.0], np.cumsum(steps)]), load, rpm, 20.0)
    assert spindle_temperature_c(CONSTANTS, warming, 23.0)[0] - 20.0 == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("effects", [{}, MASS], ids=["one mass", "two masses"])
def test_a_constant_stretch_may_be_cut_anywhere(effects: dict[str, float]) -> None:
    names = ("second_thermal_mass",) if effects else ()
    whole = Warming([0.0, 5000.0], 40.0, 5000.0, 20.0)
    cut = Warming([0.0, 1.0, 700.0, 701.5, 4000.0, 5000.0], 40.0, 5000.0, 20.0)
    one, other = (spindle_temperature_c(CONSTANTS | effects, warming, 21.0, effects=names)[0, -1] for warming in (whole, cut))
    assert one == pytest.approx(other, abs=1e-10)


def test_it_settles_where_heat_goes_off_as_fast_as_it_comes() -> None:
    """2.2e-8 · 40 · 5000² + 0.016 · 5000 = 102 W behind 0.12 K/W are 12.24 K."""
    assert spindle_temperature_c(CONSTANTS, Warming([0.0, 1e6], 40.0, 5000.0, 20.0), 50.0)[0, -1] == pytest.approx(32.24)


def test_a_sample_that_an_input_has_not_got_is_the_last_one_it_had() -> None:
    gaps = Warming([0.0, 1.0, 2.0, 3.0], [math.nan, 50.0, math.nan, 0.0], 6000.0, [20.0, math.nan, math.nan, math.nan])
    full = Warming([0.0, 1.0, 2.0, 3.0], [50.0, 50.0, 50.0, 0.0], 6000.0, 20.0)
    assert np.array_equal(spindle_temperature_c(CONSTANTS, gaps, 20.0), spindle_temperature_c(CONSTANTS, full, 20.0))


def test_null_effects_and_plain_python_change_no_bit() -> None:
    null = {f"{effect}__{name}": value for effect, values in NULL.items() for name, value in values.items()}
    bare = spindle_temperature_c(CONSTANTS, a_shift(), 22.0)
    assert np.array_equal(bare, spindle_temperature_c(CONSTANTS | null, a_shift(), 22.0, effects=tuple(NULL)))
    given_ = CONSTANTS | null | MASS | {"speed_convection__gain": 0.4, "coolant_cooling__gain": 0.3}
    kernel = spindle_temperature_c(given_, a_shift(), 22.0, effects=tuple(NULL))
    assert np.array_equal(kernel, spindle_temperature_c(given_, a_shift(), 22.0, effects=tuple(NULL), reference_run=True))
    assert np.abs(kernel - bare).max() > 1.0


def test_lanes_are_machines_of_their_own() -> None:
    lanes = spindle_temperature_c(CONSTANTS | {"resistance_k_per_w": [0.1, 0.12]}, a_shift(), [20.0, 22.0])
    assert np.array_equal(lanes[1], spindle_temperature_c(CONSTANTS, a_shift(), 22.0)[0])


def test_wrong_input_is_named() -> None:
    with pytest.raises(TwinError, match="does not after sample 1"):
        spindle_temperature_c(CONSTANTS, Warming([0.0, 1.0, 1.0], 0.0, 0.0, 20.0), 20.0)
    with pytest.raises(TwinError, match="ambient_c has no sample"):
        spindle_temperature_c(CONSTANTS, Warming([0.0, 1.0], 0.0, 0.0, [math.nan, math.nan]), 20.0)
    with pytest.raises(TwinError, match=r"spindle_rpm has the shape \(3,\)"):
        spindle_temperature_c(CONSTANTS, Warming([0.0, 1.0], 0.0, [0.0, 1.0, 2.0], 20.0), 20.0)
    with pytest.raises(EffectError, match="beta_w_per_rpm of the spindle's heat is missing"):
        spindle_temperature_c({"alpha_w_per_pct_rpm2": 0.0}, Warming([0.0], 0.0, 0.0, 20.0), 20.0)
    with pytest.raises(EffectError, match="helix does not act on the spindle's heat"):
        spindle_temperature_c(CONSTANTS, Warming([0.0], 0.0, 0.0, 20.0), 20.0, effects=["helix"])


NOMINAL = ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w")


@pytest.mark.parametrize(
    ("case", "effect", "start"),
    [
        ("case_16", "", {}),
        ("case_18", "", {}),
        ("case_13", "second_thermal_mass", MASS),
        ("case_14", "coolant_cooling", {"coolant_cooling__gain": 0.1}),
    ],
)
def test_it_explains_the_warm_up_of_a_recorded_machine_to_the_noise_of_the_sensor(
    case: str, effect: str, start: dict[str, float]
) -> None:
    logs = [
        pq.read_table(recording(f"../cases/{case}/runs/{name}.parquet")).to_pydict() for name in ("warmup_fit", "warmup_fit_2")
    ]
    machine = read_machine(recording(f"../cases/{case}/machine.toml"))
    assert machine.thermal is not None
    constants = thermal_constants(machine.thermal)
    inputs = ("t_s", "spindle_load_pct", "spindle_rpm", "ambient_temp_c", "coolant_on")
    runs = [Warming(*[np.array(log[name], dtype=float)[::5] for name in inputs]) for log in logs]
    measured = [np.array(log["spindle_temp_c"], dtype=float)[::5] for log in logs]

    def rms(effects: dict[str, float]) -> tuple[float, dict[str, float]]:
        names = (*NOMINAL, *effects)
        starts = [float(m[np.isfinite(m)][0]) for m in measured]
        first = np.array([*(constants[name] for name in NOMINAL), *effects.values(), *starts])

        def residual(values: np.ndarray) -> np.ndarray:
            told = constants | dict(zip(names, values.tolist(), strict=False))
            acting = (effect,) if effects else ()
            starts = values[len(names) :]
            return np.concatenate(
                [
                    spindle_temperature_c(told, warming, start_c, effects=acting)[0] - m
                    for warming, start_c, m in zip(runs, starts, measured, strict=True)
                ]
            )

        found = least_squares(residual, first, x_scale=np.abs(first))
        return float(np.sqrt(np.mean(found.fun**2))), dict(zip(names, found.x.tolist(), strict=False))

    noise = np.sqrt(np.mean(np.diff(np.array(logs[0]["spindle_temp_c"], dtype=float)) ** 2) / 2.0)
    assert rms(start)[0] < 1.06 * noise
    if effect:
        assert rms({})[0] > 2.0 * noise
    if effect == "coolant_cooling":
        assert rms(start)[1]["coolant_cooling__gain"] == pytest.approx(0.2711, rel=0.03)
