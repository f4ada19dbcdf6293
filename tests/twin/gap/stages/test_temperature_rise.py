"""The rise of the spindle's temperature, quieter than its sensor."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.twin.gap.small_case import HOT
from twin.case import Run, RunAtHand, RunEntry, RunKind
from twin.gap.stages.temperature_rise import temperature_rise
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.runlog import run_log

Floats = NDArray[np.float64]
NOISE_K = HOT.noise["spindle_temp_c"]


def warmed(seconds: float, seed: int, *, driven: bool = True, heat: float = 1.05) -> tuple[Run, Floats]:
    """A run at 100 Hz beside a spindle that warms up, its temperature read each second, and its true rise."""
    t_s = np.arange(0.0, seconds, 0.01)
    load, rpm, ambient = (np.full(len(t_s), value) for value in (2.0, 7000.0, 19.0))
    assert HOT.thermal is not None
    warming = Warming(t_s, load, rpm, ambient)
    true = spindle_temperature_c(thermal_constants(HOT.thermal) | {"beta_w_per_rpm": heat * 0.016}, warming, 21.0)[0]
    read = np.full(len(t_s), np.nan)
    read[::100] = true[::100] + NOISE_K * np.random.default_rng(seed).standard_normal(len(read[::100]))
    columns = {"t_s": t_s, "spindle_temp_c": read}
    columns |= {"spindle_load_pct": load, "spindle_rpm": rpm, "ambient_temp_c": ambient} if driven else {}
    entry = RunEntry(file=f"run {seed}", kind=RunKind.AIR, role="fit")
    return RunAtHand(entry, Path(), run_log(columns)), true - true[0]


@pytest.mark.parametrize("seed", range(4))
def test_over_a_short_run_the_heat_that_was_recorded_says_more_than_the_sensor(seed: int) -> None:
    run, true = warmed(22.0, seed)
    rise = temperature_rise(HOT, [run])
    assert rise is not None
    assert true[-1] < 4.0 * NOISE_K, "a rise within the noise"
    assert rise.rise_k[-1] == pytest.approx(true[-1], rel=0.08)
    assert 0.01 < rise.error < 0.08


def test_over_a_long_run_the_readings_correct_the_heat_that_the_file_states() -> None:
    run, true = warmed(900.0, 1, heat=1.3)
    rise = temperature_rise(HOT, [run])
    assert rise is not None
    assert rise.rise_k[-1] == pytest.approx(true[-1], rel=0.03)


def test_without_what_heats_it_a_rise_is_a_parabola_and_its_error_says_how_little_that_is() -> None:
    run, true = warmed(60.0, 1, driven=False)
    rise = temperature_rise(HOT, [run])
    assert rise is not None
    assert abs(rise.rise_k[-1] - true[-1]) < 3.0 * max(rise.error, 0.05) * true[-1]
    bare, _ = warmed(60.0, 1)
    told = temperature_rise(HOT, [bare])
    assert told is not None and told.error < rise.error


def test_repeated_runs_are_read_together() -> None:
    runs = [warmed(60.0, seed) for seed in range(6)]
    alone, together = temperature_rise(HOT, [runs[0][0]]), temperature_rise(HOT, [run for run, _ in runs])
    assert alone is not None and together is not None
    assert together.error < alone.error


def test_a_run_without_a_temperature_has_no_rise() -> None:
    entry = RunEntry(file="run", kind=RunKind.AIR, role="fit")
    assert temperature_rise(HOT, [RunAtHand(entry, Path(), run_log({"t_s": np.arange(3.0), "x_pos_mm": np.zeros(3)}))]) is None
