#!/usr/bin/env python3
"""Time of the simulated machine over 30 s of three axes at 1 kHz, beside a plain C loop of the same servo model.

    .venv/bin/python benchmarks/simulator.py [--seconds S] [--repeats N] [--json]

The yardstick is benchmarks/simulator.c, axis after axis, gcc -O3; both are checked against each other to 1e-9 mm. All contenders
of a group are taken in turn, and each counts with its least CPU time, since a machine is never quiet. Read the ratios, not the
milliseconds. Two motions go through everything: a contour on which all axes move all the time, and a program that moves axis by
axis as one does to identify a machine; what sticks there costs a plain loop next to nothing, and a loop over lanes as much as
ever.

* single: run_axes on the three axes of one machine, position and torque at each tick; C writes the same
* batch, traces: 64 machines on the same motion, time for one of them, position and torque at each tick
* batch, sums: the same without traces, only root mean squares and peaks, beside C that keeps only these
* limit: the same C with -march=native -ffast-math, which is free to compute something else
* axis effects: batches with and without all effects of the catalogue that act on an axis; the table is kept too, since some show
  there only
* chain, batch: 64 machines with a cut: force, the axes under it, load, temperature, each by its batch call, one after another;
  sensors and clock have no batch. Each candidate has a cutting force of its own, so no two lanes share an input
* chain, single: `respond`, everything that a machine records, with every effect of the catalogue on every axis, and those of
  sensors on a position and the load. The helix cuts each tooth into 16 slices, so the chain without it is shown too
* stages: one candidate, from a path whose geometry and engagement are known: what a search pays for another feed
"""

import argparse
import json
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.plain_loop import PERIOD_S, Motion, PlainLoop, Run, motion_of
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.machine import AddedEffect, MachineFile, machine_from_toml
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.process.kernel import process_quantities
from twin.process.milling import milling_force, tool_constants
from twin.servo.constants import axis_constants, effect_constants
from twin.servo.kernel import axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.simulator.response import RunInput, milling_of, respond
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
BATCH = 64
PLAIN = ("-O3",)
LIMIT = ("-O3", "-march=native", "-ffast-math")
TRACES = ("position_mm", "torque_a")
AGREEMENT_MM = 1e-9

HERE = Path(__file__)
MACHINE = HERE.with_name("simulator_machine.toml").read_text(encoding="utf-8")
CONTOUR = HERE.with_name("contour.nc").read_text(encoding="utf-8")
AXIS_BY_AXIS = HERE.with_name("axis_by_axis.nc").read_text(encoding="utf-8")
MOTIONS = {"contour": CONTOUR, "axis by axis": AXIS_BY_AXIS}


def interleaved(runs: Mapping[str, Run], repeats: int) -> dict[str, float]:
    """Least CPU time of each, ms, taken in turn, so that what else the machine does meets them all; none uses threads."""
    best = dict.fromkeys(runs, math.inf)
    for run in runs.values():
        run()
    for _ in range(repeats):
        for name, run in runs.items():
            start = time.thread_time()
            run()
            best[name] = min(best[name], 1000.0 * (time.thread_time() - start))
    return best


def spread(count: int) -> Floats:
    """Factors of the candidates: the machine itself first."""
    return np.concatenate([[1.0], np.linspace(0.9, 1.1, count)[1:]]) if count > 1 else np.ones(1)


def acting_on(known: Mapping[str, str]) -> list[Effect]:
    """The effects of the catalogue that act on one of these quantities."""
    return [effect for effect in catalogue().values() if set(effect.changes) & set(known)]


def values_of(effect: Effect) -> dict[str, float]:
    """Typical ones; a torque limit at which the axis still follows."""
    return {"limit_a": 40.0} if effect.name == "torque_limit" else effect.typical_values()


def axes_call(
    machine: MachineFile,
    motion: Motion,
    count: int,
    *,
    effects: tuple[str, ...] = (),
    outputs: tuple[str, ...] = TRACES,
    measured: bool = False,
    disturbance: Callable[[], Floats] | None = None,
) -> Callable[[], AxisRun]:
    """A call that runs `count` machines; their masses and friction differ. disturbance: (axes · count, ticks)"""
    columns: dict[str, list[Floats]] = {}
    for letter, axis in machine.axes.items():
        base = axis_constants(axis)
        for name in effects:
            base |= effect_constants(effect_named(name), values_of(effect_named(name)), base, letter)
        for name, value in base.items():
            scaled = name in ("mass_kg", "coulomb_minus_n", "coulomb_plus_n")
            columns.setdefault(name, []).append(value * (spread(count) if scaled else np.ones(count)))
    constants = {name: np.concatenate(parts) for name, parts in columns.items()}
    reference = np.array(list(motion.reference_mm.values()))
    lanes = len(machine.axes) * count

    def call() -> AxisRun:
        if disturbance is None:
            inputs = AxisInput(reference, np.repeat(np.arange(len(machine.axes)), count))
        else:
            inputs = AxisInput(np.repeat(reference, count, axis=0), np.arange(lanes), disturbance())
        return run_axes(constants, inputs, period_s=PERIOD_S, effects=effects, outputs=outputs, measured=measured)

    return call


def sticking(machine: MachineFile, motion: Motion) -> dict[str, float]:
    """Part of the time for which each axis sticks."""
    speed = axes_call(machine, motion, 1, outputs=("velocity_mm_s",))().outputs["velocity_mm_s"]
    return {axis: float(np.mean(row == 0.0)) for axis, row in zip(machine.axes, speed, strict=True)}


def told_of(motion: Motion) -> RunInput:
    """The motion with a cut: half a slot of 2 mm, always in the material."""
    ticks = motion.ticks
    t_s = PERIOD_S * np.arange(ticks)
    steady = {name: np.full(ticks, value) for name, value in (("rpm", 3600.0), ("depth", 2.0), ("entry", 0.3), ("exit", 2.2))}
    angle = np.mod(3600.0 / 60.0 * 2.0 * math.pi * t_s, 2.0 * math.pi)
    around = {"coolant_on": np.ones(ticks), "ambient_temp_c": np.full(ticks, 22.0)}
    cut = (steady["rpm"], angle, steady["depth"], steady["entry"], steady["exit"])
    return RunInput(t_s, motion.reference_mm, *cut, **around)


def chain_call(machine: MachineFile, motion: Motion, count: int, catalogued: Sequence[Effect]) -> Run:
    """A call that runs force, axes, load and temperature of `count` machines whose materials differ, with these effects."""
    assert machine.tool is not None
    assert machine.spindle is not None
    assert machine.thermal is not None
    told = told_of(motion)
    milling = milling_of(told)
    assert milling is not None
    tool, teeth = machine.tool, machine.tool.teeth

    def of(known: Mapping[str, str]) -> tuple[tuple[str, ...], dict[str, float]]:
        effects = [effect for effect in acting_on(known) if effect in catalogued]
        given = {f"{e.name}__{k}": v for e in effects for k, v in e.checked(values_of(e)).items()}
        return tuple(e.name for e in effects), given

    (cutting, cutting_values), (meter, meter_values) = of(process_quantities()), of(spindle_quantities())
    heating, heating_values = of(thermal_quantities())
    materials = tool_constants(tool) | cutting_values
    many = {name: np.full(count, value) for name, value in materials.items()}
    many["tangential_coefficient_n_per_mm2"] = many["tangential_coefficient_n_per_mm2"] * spread(count)
    heat = {name: np.full(count, value) for name, value in (thermal_constants(machine.thermal) | heating_values).items()}
    forces: list[Floats] = []
    axis_effects = of(axis_quantities())[0]
    outputs = (*TRACES, "table_mm")
    axes = axes_call(machine, motion, count, effects=axis_effects, outputs=outputs, disturbance=lambda: forces[-1])

    def call() -> list[object]:
        force = milling_force(many, teeth, milling, period_s=PERIOD_S, effects=cutting)
        forces[:] = [np.concatenate([-force.mean_force_x_n, -force.mean_force_y_n, np.zeros((count, motion.ticks))])]
        ran = axes()
        drive = spindle_constants(machine.spindle) | meter_values
        load = spindle_load_pct(drive, force.cutting_power_w(), told.spindle_rpm, period_s=PERIOD_S, effects=meter)
        surroundings = (told.spindle_rpm, told.ambient_temp_c, told.coolant_on)
        warm = [
            spindle_temperature_c(
                {name: values[i] for name, values in heat.items()},
                Warming(told.t_s, load[i], *surroundings),
                22.0,
                effects=heating,
            )
            for i in range(count)
        ]
        return [ran, load, warm]

    return call


def with_effects(machine: MachineFile, catalogued: Sequence[Effect]) -> MachineFile:
    """The machine with these effects on it: on each axis, and on what the sensors of position and load read."""
    added: list[AddedEffect] = []
    for effect in catalogued:
        on = {On.AXIS: list(machine.axes), On.SIGNAL: ["x_pos_mm", "spindle_load_pct"], On.MACHINE: [""]}[effect.on]
        added += [AddedEffect(effect=effect.name, on=place, parameters=values_of(effect)) for place in on]
    return machine.model_copy(update={"effects": tuple(added)})


def servo_rows(machine: MachineFile, motion: Motion, loops: Mapping[str, PlainLoop], repeats: int) -> dict[str, float]:
    """Single and batch beside C, ms for one machine, and by how much they differ, mm."""
    single = axes_call(machine, motion, 1)
    runs: dict[str, Run] = {
        "single": single,
        "batch, traces": axes_call(machine, motion, BATCH),
        "batch, sums": axes_call(machine, motion, BATCH, outputs=(), measured=True),
    }
    row: dict[str, float] = {}
    for name, loop in loops.items():
        for traces in (True, False):
            call, out = loop.bound(machine, motion, traces)
            runs[f"{name}, {'traces' if traces else 'sums'}"] = call
            if traces:
                call()
                positions = single().outputs["position_mm"]
                difference = max(float(np.abs(out[a][0] - p).max()) for a, p in zip(machine.axes, positions, strict=True))
                row[f"{name} differs, mm"] = difference
    batch = axes_call(machine, motion, BATCH)().outputs["position_mm"][::BATCH]
    row["batch differs from single, mm"] = float(np.abs(batch - single().outputs["position_mm"]).max())
    ms = interleaved(runs, repeats)
    return row | {name: value / (BATCH if name.startswith("batch") else 1) for name, value in ms.items()}


def effect_rows(machine: MachineFile, motion: Motion, repeats: int) -> dict[str, float]:
    """Batches without and with effects, ms for one machine."""
    effects = tuple(e.name for e in acting_on(axis_quantities()))
    kept = (*TRACES, "table_mm")
    runs: dict[str, Run] = {}
    for name, some in (("bare", ()), ("all", effects)):
        runs[f"{name}, traces"] = axes_call(machine, motion, BATCH, effects=some, outputs=kept)
        runs[f"{name}, sums"] = axes_call(machine, motion, BATCH, effects=some, outputs=(), measured=True)
    ms = interleaved(runs, repeats)
    return {name: value / BATCH for name, value in ms.items()} | {"effects": float(len(effects))}


def chain_rows(machine: MachineFile, motion: Motion, repeats: int) -> dict[str, float]:
    """The chain without and with effects, ms for one machine."""
    told, every = told_of(motion), list(catalogue().values())
    some = {"bare": [], "all": every, "all but helix": [effect for effect in every if effect.name != "helix"]}
    batch = interleaved({name: chain_call(machine, motion, BATCH, effects) for name, effects in some.items()}, repeats)
    machines = {name: with_effects(machine, effects) for name, effects in some.items()}
    single = interleaved({name: lambda m=m: respond(m, told) for name, m in machines.items()}, repeats)
    return {f"batch, {name}": ms / BATCH for name, ms in batch.items()} | {f"single, {name}": ms for name, ms in single.items()}


def stage_rows(machine: MachineFile, motion: Motion, repeats: int) -> dict[str, float]:
    """Stages of one candidate, ms."""
    assert machine.tool is not None
    assert machine.spindle is not None
    assert machine.thermal is not None
    told = told_of(motion)
    milling = milling_of(told)
    assert milling is not None
    tool, spindle, thermal = tool_constants(machine.tool), spindle_constants(machine.spindle), thermal_constants(machine.thermal)
    force = milling_force(tool, machine.tool.teeth, milling, period_s=PERIOD_S)
    power = force.cutting_power_w()
    load = spindle_load_pct(spindle, power, told.spindle_rpm, period_s=PERIOD_S)[0]
    planned = plan(motion.path, machine.program)
    pulls = np.concatenate([-force.mean_force_x_n, -force.mean_force_y_n, np.zeros((1, motion.ticks))])
    runs: dict[str, Run] = {
        "plan": lambda: plan(motion.path, machine.program),
        "sample": lambda: sampled(planned, PERIOD_S),
        "servo": axes_call(machine, motion, 1, disturbance=lambda: pulls),
        "force": lambda: milling_force(tool, machine.tool.teeth, milling, period_s=PERIOD_S),
        "load": lambda: spindle_load_pct(spindle, power, told.spindle_rpm, period_s=PERIOD_S),
        "heat": lambda: spindle_temperature_c(
            thermal, Warming(told.t_s, load, told.spindle_rpm, told.ambient_temp_c, told.coolant_on), 22.0
        ),
    }
    ms = interleaved(runs, repeats)
    share = motion.ticks * PERIOD_S / planned.total_s  # the program goes on after the ticks that the others are given
    ms |= {"plan": ms["plan"] * share, "sample": ms["sample"] * share}
    return ms | {"chain": sum(ms.values())}


def measure(ticks: int, repeats: int, folder: Path) -> dict[str, dict[str, dict[str, float]]]:
    """Everything, by motion and group."""
    machine = machine_from_toml(MACHINE)
    compilers = {"C": PLAIN, "limit": LIMIT} if shutil.which("gcc") else {}
    loops = {name: PlainLoop(folder, options) for name, options in compilers.items()}
    result: dict[str, dict[str, dict[str, float]]] = {}
    for name, text in MOTIONS.items():
        motion = motion_of(machine, text, ticks)
        result[name] = {
            "sticking": sticking(machine, motion),
            "servo": servo_rows(machine, motion, loops, repeats),
            "effects": effect_rows(machine, motion, repeats),
            "chain": chain_rows(machine, motion, max(3, repeats // 5)),
            "stages": stage_rows(machine, motion, repeats),
        }
    return result


def report(name: str, groups: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return what is printed of one motion."""
    servo, effects, chain, stages = groups["servo"], groups["effects"], groups["chain"], groups["stages"]
    plain = servo.get("C, traces", math.nan)
    sticking = ", ".join(f"{axis} {100 * part:.0f} %" for axis, part in groups["sticking"].items())

    def line(label: str, ms: float, over: float, aim: str = "") -> str:
        return f"  {label:<44}{ms:9.3f} ms  {ms / over:6.2f} ×{'  (aim ≤ ' + aim + ')' if aim else ''}"

    lines = [f"{name}: sticking {sticking} of the time", " beside C with the same outputs"]
    lines += [
        line("C, traces", plain, plain),
        line("C, sums", servo.get("C, sums", math.nan), plain),
        line("limit, traces", servo.get("limit, traces", math.nan), plain),
        line("single, three axes", servo["single"], plain, "1.5"),
        line(f"batch of {BATCH}, traces", servo["batch, traces"], plain, "0.25"),
        line(f"batch of {BATCH}, sums", servo["batch, sums"], servo.get("C, sums", math.nan), "0.25"),
        f" all {effects['effects']:.0f} effects that act on an axis, beside the bare batch",
    ]
    for kept in ("traces", "sums"):
        bare = effects[f"bare, {kept}"]
        lines += [line(f"bare, {kept}", bare, bare), line(f"all, {kept}", effects[f"all, {kept}"], bare, "3")]
    lines.append(" whole chain with a cut, every effect of the catalogue, beside the bare chain")
    for kind, label in (("batch", f"batch of {BATCH}: force, axes, load, heat"), ("single", "single: respond")):
        bare = chain[f"{kind}, bare"]
        lines += [line(f"{label}, bare", bare, bare), line(f"{label}, all", chain[f"{kind}, all"], bare, "3")]
        lines.append(line("  all but helix", chain[f"{kind}, all but helix"], bare))
    lines.append(" stages of one candidate, beside C")
    lines += [line(stage, ms, plain) for stage, ms in stages.items()]
    differ = ", ".join(f"{key} {value:.1e}" for key, value in servo.items() if key.endswith("mm"))
    return [*lines, f"  {differ}"]


def main() -> int:
    """Measure and print; 1 where C and ours do not agree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--repeats", type=int, default=25)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = measure(round(options.seconds / PERIOD_S), options.repeats, Path(folder))
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        print(f"{options.seconds:g} s at {1 / PERIOD_S:.0f} Hz, best of {options.repeats}, for one candidate of three axes")
        for name, groups in result.items():
            print("\n".join(report(name, groups)))
    worst = max(groups["servo"].get("C differs, mm", 0.0) for groups in result.values())
    if not worst <= AGREEMENT_MM:
        print(f"C and ours differ by {worst:.1e} mm, more than {AGREEMENT_MM:g} mm", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
