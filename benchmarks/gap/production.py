#!/usr/bin/env python3
"""The diagnosis of production recordings, blind: answers by effect and by the length of the recording.

    .venv/bin/python benchmarks/gap/production.py [--cases 4] [--seed 1] [--windows 2min 30min 8h 5d] [--only EFFECT …]

A reference machine (`cnctwin/standins/reference_machine`, which shares no code with the twin) works through its production with
one effect that its file does not have. A window of what its control shows once a second is diagnosed, its first 60 % to learn
from and the rest to judge on. Loads come in whole percents or tenths, temperatures in tenths, and some rows are lost. A row of
the table is printed for each effect and window:

    named    it is a cause by its name                     class    it is in the class of a cause
    wrong    something else is named, and it is not        unknown  there is a gap without a name
    missed   it is called healthy

Two healthy machines, and two that differ by what no catalogue has, are asked as often.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import exp

import numpy as np

from cnctwin.standins.reference_machine.physics import Physics, physics_of
from cnctwin.standins.reference_machine.production import (
    RAPID_MM_MIN,
    TOOL_CHANGE_S,
    Production,
    Shown,
    production_of,
    recorded,
)
from cnctwin.standins.reference_machine.stated import MachineFigures, NoiseFigures, drawn_machine, machine_toml, scattered
from twin.case import Case, RunAtHand, RunEntry, RunKind
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis
from twin.machine import machine_from_toml
from twin.runlog import run_log

Chance = np.random.Generator
WINDOWS = {"2min": 120.0, "30min": 1800.0, "8h": 28800.0, "5d": 432000.0}
LEAD_S = 3000.0
"""The machine has run so long before a window of less than a shift begins."""
LEARNT = 0.6
PROGRAM = f"""
[program]
rapid_mm_min = {RAPID_MM_MIN}
acceleration_mm_s2 = 4000.0
tool_change_s = {TOOL_CHANGE_S}
"""


@dataclass(frozen=True, slots=True)
class Hidden:
    """An effect that is hidden in the machine. on: the signal that it is on; change_s: that each tool change takes longer"""

    name: str
    on: str = ""
    acts: Callable[[Physics, Chance, float], Physics] = lambda physics, _chance, _size: physics
    change_s: float = 0.0


def _sign(chance: Chance) -> float:
    return float(chance.choice([-1.0, 1.0]))


TEMPERATURE, LOAD = "spindle_temp_c", "spindle_load_pct"
HIDDEN = (
    Hidden("healthy"),
    Hidden("speed_convection", acts=lambda x, c, a: x.with_part("heat", turning=0.5 * a, turning_exponent=c.uniform(0.5, 0.8))),
    Hidden("coolant_cooling", acts=lambda x, _, a: x.with_part("heat", coolant=0.6 * a)),
    Hidden(
        "second_thermal_mass",
        acts=lambda x, c, a: x.with_part("heat", column_w_per_k=5.0 * a, column_capacity=float(c.uniform(2e4, 8e4))),
    ),
    Hidden("sensor_bias", TEMPERATURE, lambda x, c, a: x.with_sensor(TEMPERATURE, bias=2.0 * a * _sign(c))),
    Hidden("sensor_scale", TEMPERATURE, lambda x, c, a: x.with_sensor(TEMPERATURE, scale=exp(0.12 * a * _sign(c)))),
    Hidden("sensor_lag", TEMPERATURE, lambda x, _, a: x.with_sensor(TEMPERATURE, lag_s=90.0 * a)),
    Hidden("rated_power", acts=lambda x, c, a: x.with_part("meter", rated_kw=x.meter.rated_kw * exp(0.35 * a * _sign(c)))),
    Hidden("idle_speed_power", acts=lambda x, _, a: x.with_part("meter", turning_kw=0.4 * a)),
    Hidden("sensor_bias", LOAD, lambda x, c, a: x.with_sensor(LOAD, bias=4.0 * a)),
    Hidden("sensor_scale", LOAD, lambda x, c, a: x.with_sensor(LOAD, scale=exp(0.4 * a * _sign(c)))),
    Hidden("tool_change_time", change_s=2.5),
    Hidden("(a cabinet that heats)", acts=lambda x, _, a: x.with_part("heat", cabinet_w=25.0 * a)),
    Hidden("(a bearing that gets tight)", acts=lambda x, _, a: x.with_part("heat", tight=0.3 * a)),
)


def case_of(hidden: Hidden, window_s: float, seed: int) -> Case:
    """Return a production of a machine with something hidden in it, as a case."""
    chance = np.random.default_rng([seed, 20])
    stated = replace(drawn_machine(chance), noise=NoiseFigures(spindle_load_pct=0.2, spindle_temp_c=0.04))
    size = float(exp(chance.uniform(-0.4, 0.7)))
    physics = hidden.acts(physics_of(scattered(stated, chance)), chance, size)
    lead_s = LEAD_S + float(chance.uniform(0.0, 600.0)) if window_s < 4.0 * LEAD_S else 0.0
    told = production_of(chance, lead_s + window_s, stated.spindle.rated_power_kw, hidden.change_s * size)
    return _case(physics, told, stated, (lead_s, window_s), chance)


def _case(physics: Physics, told: Production, stated: MachineFigures, window: tuple[float, float], chance: Chance) -> Case:
    shown = Shown(load_step_pct=float(chance.choice([0.1, 1.0])))
    begin, middle = int(window[0]), int(window[0] + LEARNT * window[1])
    runs = []
    for role, part in (("fit", slice(begin, middle)), ("check", slice(middle, int(sum(window))))):
        columns = recorded(physics, told, part, chance, shown)
        entry = RunEntry(file=f"runs/{role}.parquet", kind=RunKind.WARMUP, role=role)
        runs.append(RunAtHand(entry, None, run_log(columns)))  # type: ignore[arg-type]
    machine = machine_from_toml(machine_toml(stated) + PROGRAM)
    return Case("production", machine.model_copy(update={"axes": {}}), tuple(runs))


def outcome(hidden: Hidden, told: Diagnosis) -> str:
    """Return what a diagnosis made of it."""
    mine = (hidden.name, hidden.on)
    named = [(cause.effect, cause.on) for cause in told.causes]
    classes = [(e.effect, e.on) for cause in told.causes for e in cause.indistinguishable_from]
    is_named_otherwise = hidden.name == "healthy" or hidden.name.startswith("(")
    if named and mine not in named + classes:
        return "wrong"
    if hidden.name == "healthy":
        return "healthy" if told.verdict.value == "healthy" else "unknown"
    if not named:
        constant = bool(told.constants) and told.verdict.value == "explained"
        return "missed" if told.verdict.value == "healthy" else "constants" if constant else "unknown"
    assert not is_named_otherwise
    return ("named" if mine in named else "class") + ("" if len(named) == 1 else " and more")


def main() -> None:
    """Print a row for each effect and window."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--windows", nargs="+", default=list(WINDOWS), choices=WINDOWS)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    for name in given.windows:
        for number, hidden in enumerate(HIDDEN):
            if given.only and hidden.name not in given.only:
                continue
            counts, seconds = Counter[str](), 0.0
            for case in range(given.cases):
                began = time.process_time()
                told = diagnose(case_of(hidden, WINDOWS[name], 1000 * given.seed + 20 * case + number)).diagnosis
                seconds = max(seconds, time.process_time() - began)
                counts[outcome(hidden, told)] += 1
                if given.verbose:
                    print(
                        "   ",
                        outcome(hidden, told),
                        *_causes(told),
                        f"{told.gap.as_stated:.2f} → {told.gap.before:.2f} →",
                        f"{told.gap.after:.2f}",
                        flush=True,
                    )
            print(f"| {name} | `{hidden.name}` {hidden.on} | {_row(counts)} | {seconds:.0f} s |", flush=True)


def _causes(told: Diagnosis) -> list[str]:
    return [f"{c.effect} {c.on} (or {', '.join(map(str, c.indistinguishable_from))})" for c in told.causes]


def _row(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))


if __name__ == "__main__":
    main()
