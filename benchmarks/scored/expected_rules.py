"""Two rules beside the twin's expectation, on the simulated cell: false alarms a machine-week, and delays of a broken tool.

    .venv/bin/python benchmarks/scored/expected_rules.py --seeds 101 --machines 4 --days 3
    .venv/bin/python benchmarks/scored/expected_rules.py --seeds 101 --machines 3 --days 1 --breaks     # one every 10 min

The cell is cut by the reference machine, which shares no code with the twin; the twin is given the statement of each machine, a
few percent off, without its edge forces, losses and cold grease. A control tells once a second. The programs of a machine are
worked out by `expectation_of`; the processors `expected` and `rules` see what the control tells. An alarm of `tool_broken` is
true while a broken tool is in the spindle; one of `load_over_expected` is true within any fault that raises the load beside the
feed (RAISES_LOAD). What alarms otherwise is false; that within another fault is counted beside. Delays are in seconds in which
the axis of the broken tool was within the stock, on a pass of its own: where it stands clear of the work, nothing shows.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.cell import Cell, draw_cell, machine_readings
from benchmarks.simulated_cell.fault import Fault, FaultKind, Overlap
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S, Schedule
from processors.config import Configuration
from processors.contract import Output, Sample, SampleKind
from processors.expected.processor import Config, Described, State, step
from processors.rules import processor as rules
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.expected.files import ByProgram
from twin.expected.making import expectation_of
from twin.machine import machine_from_toml
from twin.vocabulary.twin_signals import RULE_LOAD_OVER_EXPECTED, RULE_TOOL_BROKEN

RAISES_LOAD = frozenset(
    {
        FaultKind.CHIP_PACKING,
        FaultKind.INTERMITTENT,
        FaultKind.TOOL_TOO_LONG,
        FaultKind.WRONG_MATERIAL,
        FaultKind.DULLING_TOOL,
        FaultKind.BROKEN_INSERT,
        FaultKind.COOLANT_OFF,
        FaultKind.FEED_MISMATCH,
    }
)
AFTER_S = 30.0
BREAK_EVERY_S, BROKEN_S = 600, 60.0
WORKING_WEEK_S = 6 * 16 * 3600.0


class Told(NamedTuple):
    """A second of a machine: its alarms and whether the tool in the spindle should cut."""

    at_s: int
    is_broken: bool
    is_over: bool


class Found(NamedTuple):
    """delays_s: of each broken tool that had to cut, inf = not found; false, healthy: false onsets, those in no fault

    over, planted: faults that raise the load by kind and size, found and all
    """

    delays_s: list[float]
    false: Counter[str]
    healthy: Counter[str]
    over: Counter[str]
    planted: Counter[str]
    working_s: float
    ticks: int
    took_s: float


def reading(name: str, value: object) -> Reading:
    """Return a good reading."""
    return Reading(name, value, 0, Quality.GOOD, None, None, False)  # type: ignore[arg-type]


def given_of(cell: Cell, place: int) -> Described:
    """Return what the processor `expected` is given for a machine of the cell."""
    machine = cell.machines[place]
    made = [
        expectation_of(machine_from_toml(machine.toml(program, "m")), program.text, name=program.name)
        for program in machine.programs
    ]
    configuration: Configuration[Config] = Configuration(Config, {}, reads=lambda _: {"m": ByProgram(made)})
    return Described(configuration)


def told_of(cell: Cell, place: int) -> Iterator[tuple[Told, bool]]:
    """Yield the alarms of each second of a machine's shifts, and whether it works."""
    schedule, found = cell.schedules[place], machine_readings(cell, place)
    given, state, config, rule_state = given_of(cell, place), State(), rules.Config(), rules.State()
    names = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
    row: dict[str, Reading] = {"exec_state": reading("exec_state", "ACTIVE")}
    for at_s in range(cell.faults_from_day * DAY_S, cell.days * DAY_S):
        if schedule.work[at_s] == Work.STANDING and at_s % 60:
            continue
        row |= {name: reading(name, float(value)) for name, value in zip(names, found.rows[at_s].tolist(), strict=True)}
        row["program"] = reading("program", schedule.names[schedule.program[at_s]])
        row["nc_line"] = reading("nc_line", int(schedule.nc_line[at_s]))
        row["tool_number"] = reading("tool_number", int(schedule.tool_number[at_s]))
        row["feed_override_pct"] = reading("feed_override_pct", float(schedule.feed_override_pct[at_s]))
        sample = Sample("m", SampleKind.DATA, float(at_s), row)
        state, outputs = step(given, state, sample)
        row |= {
            one.name: Reading(one.name, one.value, 0, one.quality, None, one.reason, False)
            for one in outputs
            if isinstance(one, Output)
        }
        rule_state, _ = rules.step(config, rule_state, sample)
        alarms = [rule_state.latches.get(name) for name in ("tool_broken", "load_over_expected")]
        yield Told(at_s, *(latch is not None and latch.is_alarm for latch in alarms)), schedule.work[at_s] != Work.STANDING


def judged(cell: Cell, place: int) -> Found:
    """Judge one machine of a cell."""
    began = time.perf_counter()
    schedule = cell.schedules[place]
    faults = [fault for fault in cell.faults if fault.machine == place]
    false: Counter[str] = Counter()
    healthy: Counter[str] = Counter()
    onsets: dict[str, list[int]] = {RULE_TOOL_BROKEN: [], RULE_LOAD_OVER_EXPECTED: []}
    before = Told(0, False, False)
    working_s = ticks = 0
    for told, works in told_of(cell, place):
        working_s, ticks = working_s + works, ticks + 1
        for name, now, then in (
            (RULE_TOOL_BROKEN, told.is_broken, before.is_broken),
            (RULE_LOAD_OVER_EXPECTED, told.is_over, before.is_over),
        ):
            if now and not then:
                onsets[name].append(told.at_s)
        before = told
    broken = [fault for fault in faults if fault.kind is FaultKind.BROKEN_TOOL]
    raises = [fault for fault in faults if fault.kind in RAISES_LOAD]
    for name, true in ((RULE_TOOL_BROKEN, broken), (RULE_LOAD_OVER_EXPECTED, raises)):
        wrong = [at_s for at_s in onsets[name] if not any(within(fault, at_s) for fault in true)]
        false[name] = len(wrong)
        healthy[name] = sum(not any(within(fault, at_s) for fault in faults) for at_s in wrong)
    over = Counter(
        f"{one.kind} {one.size:g}" for one in raises if any(within(one, at_s) for at_s in onsets[RULE_LOAD_OVER_EXPECTED])
    )
    planted = Counter(f"{one.kind} {one.size:g}" for one in raises)
    delays = []
    for fault in broken:
        part = slice(int(fault.start_s), int(fault.end_s))
        cuts = part.start + np.flatnonzero(in_stock(schedule, part) & (schedule.tool_number[part] == fault.tool))
        if len(cuts):
            told_s = min((at_s for at_s in onsets[RULE_TOOL_BROKEN] if cuts[0] <= at_s < part.stop), default=None)
            delays.append(np.inf if told_s is None else float((cuts < told_s).sum()))
    return Found(delays, false, healthy, over, planted, working_s, ticks, time.perf_counter() - began)


def in_stock(schedule: Schedule, part: slice) -> NDArray[np.bool_]:
    """Return in which seconds the axis of the tool is within the stock, on a pass that cuts."""
    lines, line, stretch = schedule.lines, schedule.line[part], schedule.stretch[part]
    gone_mm = lines.length_mm[line] * np.clip(schedule.since_s[part] / schedule.lasts_s[stretch], 0.0, 1.0)
    lead_mm = lines.lead_mm[line]
    is_cutting = schedule.work[part] == Work.CUTTING
    return np.asarray(is_cutting & (gone_mm >= lead_mm) & (gone_mm <= lead_mm + lines.stock_mm[line]))


def with_breaks(cell: Cell) -> Cell:
    """Return the cell with tools that break in the cut, one in each BREAK_EVERY_S of a machine, and no other fault."""
    rng, faults = np.random.default_rng([cell.seed, 77]), []
    for place, schedule in enumerate(cell.schedules):
        cuts = in_stock(schedule, slice(0, len(schedule.work)))
        for start in range(0, len(cuts) - BREAK_EVERY_S, BREAK_EVERY_S):
            choices = np.flatnonzero(cuts[start : start + BREAK_EVERY_S - int(2 * BROKEN_S)])
            if len(choices):
                at_s = start + int(rng.choice(choices))
                tool = int(schedule.tool_number[at_s])
                faults.append(Fault(place, FaultKind.BROKEN_TOOL, 1.0, at_s, at_s + BROKEN_S, Overlap.NONE, tool=tool))
    return replace(cell, faults=tuple(faults))


def within(fault: Fault, at_s: float) -> bool:
    """Return True where an alarm belongs to a fault."""
    return fault.start_s <= at_s < fault.end_s + AFTER_S


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="101")
    parser.add_argument("--machines", type=int, default=4)
    parser.add_argument("--days", type=int, default=4)
    parser.add_argument("--breaks", action="store_true", help="nothing but tools that break in the cut, every ten minutes")
    asked = parser.parse_args()
    first, _, last = asked.seeds.partition("-")
    every: list[Found] = []
    for seed in range(int(first), int(last or first) + 1):
        cell = draw_cell(seed, asked.machines, asked.days, 0)
        cell = with_breaks(cell) if asked.breaks else cell
        every += [judged(cell, place) for place in range(asked.machines)]
    delays = np.array([one for found in every for one in found.delays_s])
    weeks = sum(found.working_s for found in every) / WORKING_WEEK_S
    ticks, took_s = sum(found.ticks for found in every), sum(found.took_s for found in every)
    print(f"{weeks:.2f} machine-weeks, {1e6 * took_s / ticks:.0f} µs a tick with the drawing of the cell and the expectations")
    for name in (RULE_TOOL_BROKEN, RULE_LOAD_OVER_EXPECTED):
        false = sum(found.false[name] for found in every)
        healthy = sum(found.healthy[name] for found in every)
        print(f"{name}: {false} false alarms, {false / weeks:.2f} a machine-week; {healthy / weeks:.2f} but for other faults")
    shown = ", ".join(f"{one:.0f}" for one in np.sort(delays)[:: max(1, len(delays) // 20)])
    print(
        f"broken tools: {len(delays)}, found {np.isfinite(delays).mean():.2f}, within 2 s {(delays <= 2.0).mean():.2f}, "
        f"within 3 s {(delays <= 3.0).mean():.2f}, within 10 s {(delays <= 10.0).mean():.2f}; delays {shown} s"
    )
    over, planted = sum((found.over for found in every), Counter()), sum((found.planted for found in every), Counter())
    for kind in sorted(planted):
        print(f"load_over_expected, {kind}: {over[kind]} of {planted[kind]}")


if __name__ == "__main__":
    main()
