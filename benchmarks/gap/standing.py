#!/usr/bin/env python3
"""The standing gap over a quarter: false growths of a healthy machine, and how soon an effect that nobody told is reported.

    .venv/bin/python benchmarks/gap/standing.py healthy [--machines 40] [--weeks 13] [--first-seed 1000]
    .venv/bin/python benchmarks/gap/standing.py effects [--only EFFECT …] [--machines 3] [--first-seed 2000] [--days 20]

Production days of the simulated machine (cnctwin/standins/production: two shifts, jobs, stops, tool wear, weather; load in whole
per cent, temperatures in tenths) go through the processors thermal and gap, as the description of the machine says: its data
sheet, a few per cent off. The first two weeks are stated to be healthy. Signals are taken every 20 s and where a state changes.

healthy   a false growth is each time that `twin/gap_growing` comes on in the weeks after that
effects   in a night (drawn) the machine gets the effect, at the size that a machine typically shows unless the
          table below gives another; printed is the time of production until `twin/gap_growing`, of which signal, and how large
          the standing gap became

A machine-quarter takes about half a minute of one core.
"""

import argparse
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from random import Random
from typing import Any, NamedTuple

from cnctwin.standins.production.day import Day, Production, production_days
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import TOLD
from processors.contract import Output, Processor, Sample, SampleKind
from processors.description import Description
from processors.gap.processor import PROCESSOR as GAP_PROCESSOR
from processors.thermal import PROCESSOR as THERMAL
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.effects.catalogue import effect_named
from twin.machine import AddedEffect, MachineFile
from twin.vocabulary import twin_signals

MONDAY_S = 1_780_272_000.0  # 2026-06-01T00:00:00Z
DAY_S, HOUR_S = 86_400.0, 3600.0
TICK_S = 20.0
HEALTHY_DAYS = 14.0
SIZES: dict[tuple[str, str], dict[str, float]] = {
    ("idle_speed_power", ""): {"power_kw": 0.15},
    ("rated_power", ""): {"scale": 0.85},
    ("cutting_coefficient", ""): {"scale": 1.25},
    ("edge_force", ""): {"tangential_n_per_mm": 8.0, "radial_n_per_mm": 4.0},
    ("load_dependent_efficiency", ""): {},
    ("speed_convection", ""): {},
    ("coolant_cooling", ""): {},
    ("second_thermal_mass", ""): {},
    ("sensor_bias", "spindle_temp_c"): {"bias": 1.0},
    ("sensor_scale", "spindle_temp_c"): {"scale": 1.05},
    ("sensor_lag", "spindle_temp_c"): {"time_constant_s": 60.0},
    ("sensor_bias", "spindle_load_pct"): {"bias": 1.0},
    ("sensor_scale", "spindle_load_pct"): {"scale": 1.2},
    ("tool_change_time", ""): {"change_s": 0.5},
    ("feed_override", ""): {"ratio": 0.9, "rapid": 1.0},
    ("block_overhead", ""): {"block_s": 0.05},
    ("corner_slowdown", ""): {},
}
"""The effects that production signals can show and the size of each; what is not given is typical."""


class Said(NamedTuple):
    """The gap at a time, s since 1970, in the processor's words."""

    at_s: float
    name: str
    value: Any


@dataclass
class Folded:
    """The processors thermal and gap over the days of one machine, folded without an engine."""

    description: Description
    table: dict[str, Any]
    said: list[Said] = field(default_factory=list)
    latest: dict[str, Any] = field(default_factory=dict)
    row: dict[str, Reading] = field(default_factory=dict)
    at_s: float = 0.0

    def __post_init__(self) -> None:
        self.thermal = _Fold.of(THERMAL, {"tick_s": TICK_S}, self.description)
        self.gap = _Fold.of(GAP_PROCESSOR, {"tick_s": TICK_S} | self.table, self.description)

    def copied(self) -> "Folded":
        """Return another one that goes on from the same state."""
        other = Folded(self.description, self.table, list(self.said), dict(self.latest), dict(self.row), self.at_s)
        other.thermal.state, other.gap.state = self.thermal.state, self.gap.state
        return other

    def describe(self, description: Description) -> None:
        """Go on with another description."""
        self.description = description
        self.thermal.describe(description)
        self.gap.describe(description)

    def feed(self, day: Day) -> None:
        """Feed the rows of a day; before and after it the machine is off."""
        if not len(day):
            return
        gap_s = day.at_s[0] - self.at_s
        if gap_s > 600.0:
            self._samples(SampleKind.DEATH, self.at_s)
            self._samples(SampleKind.HOLE, float(day.at_s[0]), gap_s=gap_s)
        self.at_s = float(day.at_s[0])
        before: dict[str, Any] = {}
        tick_s = (self.at_s // TICK_S + 1.0) * TICK_S
        for at_s, values in day.thinned(TICK_S).rows():
            while tick_s < at_s:  # a row that comes with a tick is seen by it
                self._tick(tick_s)
                tick_s += TICK_S
            self.at_s = at_s
            changed = tuple(name for name, value in values.items() if name not in before or before[name] != value)
            before = values
            if changed:
                for name in changed:
                    self.row[name] = _reading(name, values[name], at_s)
                self._samples(SampleKind.DATA, at_s, changed)

    def _samples(self, kind: SampleKind, at_s: float, changed: tuple[str, ...] = (), gap_s: float = 0.0) -> None:
        sample = Sample("vmc", kind, at_s, self.row, changed, gap_s, "switched off" if gap_s else "")
        for fold in (self.thermal, self.gap):
            fold.take(sample)

    def _tick(self, at_s: float) -> None:
        sample = Sample("vmc", SampleKind.TICK, at_s, self.row)
        for output in self.thermal.take(sample):
            if isinstance(output, Output):
                self.row[output.name] = _reading(output.name, output.value, at_s, output.reason)
        for output in self.gap.take(sample):
            if isinstance(output, Output) and self.latest.get(output.name) != output.value:
                self.latest[output.name] = output.value
                self.said.append(Said(at_s, output.name, output.value))


@dataclass
class _Fold:
    """One processor with its state."""

    processor: Processor[Any, Any]
    configuration: Any
    given: Any
    state: Any

    @classmethod
    def of(cls, processor: Processor[Any, Any], table: dict[str, Any], description: Description) -> "_Fold":
        configuration = processor.configured(table)
        return cls(
            processor,
            configuration,
            processor.given(configuration, "vmc", description),
            processor.initial(configuration.of("vmc")),
        )

    def describe(self, description: Description) -> None:
        self.given = self.processor.given(self.configuration, "vmc", description)

    def take(self, sample: Sample) -> Sequence[Any]:
        self.state, outputs = self.processor.step(self.given, self.state, sample)
        return outputs


def _reading(name: str, value: Any, at_s: float, reason: str | None = None) -> Reading:
    quality = Quality.GOOD if value is not None else Quality.BAD
    return Reading(name, value, round(at_s * 1000), quality, None, reason, False)


def told() -> Description:
    """Return the machine as its data sheet tells it."""
    return Description.from_toml(TOLD.read_text(encoding="utf-8"))


def watched(description: Description) -> Folded:
    """Return the processors as they begin: the first two weeks are healthy, as somebody has stated."""
    table = {"healthy_from": datetime.fromtimestamp(MONDAY_S, UTC), "healthy_hours": HEALTHY_DAYS * 24.0, "publish_s": 600.0}
    return Folded(description, table)


def growths(folded: Folded) -> list[tuple[float, str]]:
    """Return when a growth was reported, and of what."""
    found = []
    for one in folded.said:
        if one.name == twin_signals.GAP_GROWING and one.value is True:
            why = next(
                other.value for other in folded.said if other.at_s == one.at_s and other.name == twin_signals.GAP_GROWING_SIGNAL
            )
            found.append((one.at_s, why))
    return found


def healthy_quarter(seed: int, weeks: float, before: tuple[Folded, float | None]) -> list[tuple[float, str]]:
    """Return the growths of a healthy machine that goes on as it was `before`: all of them false."""
    folded, temp_c = before[0].copied(), before[1]
    until_s = MONDAY_S + (HEALTHY_DAYS + 7.0 * weeks) * DAY_S
    for day in production_days([(until_s, Production(machine_as_built(), seed))], hour_of(seed), temp_c):
        folded.feed(day)
    judged = [key for key, cell in folded.gap.state.cells.items() if cell.is_judged]
    assert len(judged) >= 8, f"hardly anything was judged: {judged}"
    return growths(folded)


def with_effect(machine: MachineFile, name: str, on: str) -> MachineFile:
    """Return the machine with one effect more, of the size in the table."""
    parameters = effect_named(name).typical_values() | SIZES.get((name, on), {})
    return machine.model_copy(update={"effects": (*machine.effects, AddedEffect(effect=name, on=on, parameters=parameters))})


class Noticed(NamedTuple):
    """The notice of an effect: hours of production until it came, None = never; its signal; the standing gap then, in floors."""

    hours: float | None
    why: str
    floors: float | None


def hour_of(seed: int) -> float:
    """Return when a machine gets its effect: in a night of the third week, as a day of the generator is worked out as a whole."""
    return MONDAY_S + (HEALTHY_DAYS + Random(seed).randrange(4)) * DAY_S


def before_effect(seed: int) -> tuple[Folded, float | None]:
    """Return the processors as they are when the effect comes, and the temperature of the spindle then."""
    folded, temp_c = watched(told()), None
    for day in production_days([(hour_of(seed), Production(machine_as_built(), seed))], MONDAY_S):
        folded.feed(day)
        temp_c = day.end_temp_c
    return folded, temp_c


def noticed(name: str, on: str, seed: int, days: float, before: tuple[Folded, float | None]) -> Noticed:
    """Return how an effect is noticed that comes at the machine's hour."""
    folded, temp_c = before[0].copied(), before[1]
    begins_s = hour_of(seed)
    after = Production(with_effect(machine_as_built(), name, on), seed)
    rows = 0.0
    for day in production_days([(begins_s + days * DAY_S, after)], begins_s, temp_c):
        folded.feed(day)
        found = [one for one in growths(folded) if one[0] >= begins_s]
        until_s = found[0][0] if found else float("inf")
        rows += float((day.at_s <= until_s).sum())
        if found:
            signal = found[0][1].split(" in ")[0]
            floors = folded.latest.get(f"{twin_signals.GAP_PREFIX}{signal}")
            return Noticed(rows / HOUR_S, found[0][1], floors)
    return Noticed(None, "", None)


def main() -> None:
    """Print a line for each machine, and the rate; or a line for each effect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trial", choices=("healthy", "effects"))
    parser.add_argument("--machines", type=int, help="machines of a trial; 40 healthy ones, or 3 for each effect")
    parser.add_argument("--weeks", type=float, default=13.0)
    parser.add_argument("--days", type=float, default=20.0)
    parser.add_argument("--first-seed", type=int)
    parser.add_argument("--only", nargs="+", default=())
    given = parser.parse_args()
    if given.trial == "healthy":
        _healthy(given.first_seed or 1000, given.machines or 40, given.weeks)
    else:
        _effects(given.first_seed or 2000, given.machines or 3, given.days, given.only)


def _healthy(first: int, machines: int, weeks: float) -> None:
    total = 0
    for seed in range(first, first + machines):
        found = healthy_quarter(seed, weeks, before_effect(seed))
        total += len(found)
        for at_s, why in found:
            print(f"machine {seed}: a false growth after {(at_s - MONDAY_S) / DAY_S - HEALTHY_DAYS:.1f} days: {why}", flush=True)
        if (done := seed - first + 1) % 5 == 0:
            print(f"{done} machines, {weeks:g} weeks each: {total} false growths", flush=True)


def _effects(first: int, machines: int, days: float, only: Sequence[str]) -> None:
    print(f"{'effect':<28} {'on':<18} {'noticed':<8} {'hours of production':<24} {'floors':<8} by")
    begun = {seed: before_effect(seed) for seed in range(first, first + machines)}
    for name, on in SIZES:
        if only and name not in only:
            continue
        found = [noticed(name, on, seed, days, before) for seed, before in begun.items()]
        hours = [one.hours for one in found if one.hours is not None]
        floors = [one.floors for one in found if one.floors is not None]
        spread = f"{min(hours):.1f} / {statistics.median(hours):.1f} / {max(hours):.1f}" if hours else "-"
        by = ", ".join(sorted({one.why.split(":")[0] for one in found if one.why}))
        floor = statistics.median(floors) if floors else 0.0
        print(f"{name:<28} {on:<18} {len(hours)}/{machines:<6} {spread:<24} {floor:<8.1f} {by}", flush=True)


if __name__ == "__main__":
    main()
