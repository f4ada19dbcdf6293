#!/usr/bin/env python3
"""Time of a step of the live twin beside the plain formula that it is without any effect, in one run.

    .venv/bin/python benchmarks/live_step.py [--steps N]

Each step has a new load, so nothing is held over. The formula is given its numbers; the step has to find them in the row, and to
say why where there are none. Read the ratios, not the microseconds.
"""

import argparse
import math
import time
from collections.abc import Callable
from types import MappingProxyType

from processors.description import Description
from processors.discovery import find
from processors.sample import Sample, SampleKind
from sparkplug.metric import Reading
from sparkplug.quality import Quality

RPM, AMBIENT_C, DIAMETER_MM, PERIOD_S = 4000.0, 21.0, 10.0, 0.1
ALPHA, BETA, RESISTANCE, CAPACITY = 2.2e-8, 1.6e-2, 0.12, 9000.0
RATED_KW, EFFICIENCY, IDLE_KW = 11.0, 0.85, 0.25
TOML = f"""
[machine]
name = "vmc"
[tool]
diameter_mm = {DIAMETER_MM}
teeth = 4
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.4
[spindle]
rated_power_kw = {RATED_KW}
efficiency = {EFFICIENCY}
idle_power_kw = {IDLE_KW}
[thermal]
alpha_w_per_pct_rpm2 = {ALPHA}
beta_w_per_rpm = {BETA}
resistance_k_per_w = {RESISTANCE}
capacity_j_per_k = {CAPACITY}
"""
REPEATS = 60


def heat(temperature_c: float, load_pct: float) -> float:
    """Return the temperature after a step, exact in it."""
    settled_c = AMBIENT_C + RESISTANCE * (ALPHA * load_pct * RPM**2 + BETA * RPM)
    return settled_c + (temperature_c - settled_c) * math.exp(-PERIOD_S / (RESISTANCE * CAPACITY))


def force(_: float, load_pct: float) -> float:
    """Return the force, N."""
    power_kw = EFFICIENCY * (load_pct / 100.0 * RATED_KW - IDLE_KW)
    return 6e7 * max(power_kw, 0.0) / (math.pi * DIAMETER_MM * RPM)


def formula_s(formula: Callable[[float, float], float], steps: int) -> float:
    """Return the shortest time of a step by the formula, s."""
    best = math.inf
    loads, value = [20.0 + step % 7 for step in range(steps)], AMBIENT_C
    for _ in range(REPEATS):
        began = time.perf_counter()
        for load_pct in loads:
            value = formula(value, load_pct)
        best = min(best, (time.perf_counter() - began) / steps)
    return best


def step_s(name: str, steps: int) -> float:
    """Return the shortest time of a step of a processor, s."""
    processor = find(name)
    assert processor.described is not None
    given, step = processor.described(processor.config(), Description.from_toml(TOML)), processor.step
    loads = [_reading("spindle_load_pct", 20.0 + number % 7) for number in range(steps)]
    row = {one.name: one for one in (_reading("spindle_rpm", RPM), _reading("ambient_temp_c", AMBIENT_C), loads[0])}
    view, best = MappingProxyType(row), math.inf
    samples = [Sample("vmc", SampleKind.DATA, PERIOD_S * number, view) for number in range(steps)]
    for _ in range(REPEATS):
        state = processor.initial(processor.config())
        began = time.perf_counter()
        for sample, load in zip(samples, loads, strict=True):
            row["spindle_load_pct"] = load
            state, _outputs = step(given, state, sample)
        best = min(best, (time.perf_counter() - began) / steps)
    return best


def _reading(name: str, value: float) -> Reading:
    return Reading(name, value, 0, Quality.GOOD, None, None, is_historical=False)


def main() -> None:
    """Print a line for each processor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=2_000)
    steps = parser.parse_args().steps
    for name, formula in (("thermal", heat), ("cutting_force", force)):
        plain, ours = formula_s(formula, steps), step_s(name, steps)
        print(f"{name:14} step {ours * 1e6:5.2f} µs, formula {plain * 1e6:5.2f} µs: {ours / plain:.1f} times")


if __name__ == "__main__":
    main()
