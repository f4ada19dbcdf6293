"""Measure how well the clock fold finds a control's clock, and how often the truth lies in the spread that it states.

    python -m benchmarks.edges.clock [--hours 2] [--runs 40] [--seed 1] [--recording okuma.txt]

Simulated clocks of any offset and a drift of up to 100 ppm, read by each of our protocols as they are: a full second or a
millisecond, over a round trip or one way, with the latency of a quiet network or of one that stalls now and then. Each estimate
as it stands published is compared with the truth of its moment. The share within the stated spread is the coverage; of hard
bounds it is to be 100 %. With a recording of a spindle's speed (SHDR of an Okuma), also the method by signals.
"""

import argparse
import random
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

from edge.clock import offset as clock
from edge.clock import signals as clock_signals
from edge.sample import ClockReading

T0_S = 1_700_000_000.0


class Case(NamedTuple):
    """A control's clock and the way to it. `latency_s` draws the way of one message; `every_s` how often it is read."""

    name: str
    every_s: float
    resolution_ms: int
    is_one_way: bool
    latency_s: Callable[[random.Random], float]
    stamps: bool
    jitter_s: float = 0.5


def _quiet(chance: random.Random) -> float:
    return 0.002 + chance.expovariate(1 / 0.003)


def _plant(chance: random.Random) -> float:
    """A shop network: 5 ms, now and then a stall of up to 3 s."""
    return 0.005 + chance.expovariate(1 / 0.02) + (chance.uniform(0.2, 3.0) if chance.random() < 0.03 else 0.0)


def _recorded(chance: random.Random) -> float:
    """Like the machines of NIST's smart manufacturing test bed over their agent: 0.1 to 0.4 s, a tail to some seconds."""
    return chance.uniform(0.1, 0.4) + (chance.expovariate(1 / 1.5) if chance.random() < 0.05 else 0.0)


CASES = (
    Case("FOCAS: whole seconds, every 10 s", 10.0, 1000, False, _quiet, stamps=False),
    Case("LSV2: whole seconds, a shop network", 10.0, 1000, False, _plant, stamps=False),
    Case("FOCAS, always at the same phase", 10.0, 1000, False, _quiet, stamps=False, jitter_s=0.0),
    Case("OPC UA: 1 ms, every 10 s", 10.0, 1, False, _plant, stamps=True),
    Case("MTConnect: header of whole seconds", 0.5, 1000, True, _plant, stamps=True),
    Case("MTConnect, latency as at NIST", 0.5, 1000, True, _recorded, stamps=True),
)


class Estimate(NamedTuple):
    """An estimate that was published at a moment, and the truth."""

    at_s: float
    offset_s: float
    spread_s: float
    true_s: float


class Truth(NamedTuple):
    """offset at 0, and drift."""

    offset_s: float
    ppm: float

    def at(self, at_s: float) -> float:
        """Control minus edge."""
        return self.offset_s + self.ppm * 1e-6 * at_s


def heard(case: Case, truth: Truth, seconds: float, chance: random.Random) -> Iterator[clock.Heard]:
    """Yield what an edge hears of this clock, in the order of arrival."""
    at_s, last_s = 0.0, 0.0
    while at_s < seconds:
        there_s, back_s = case.latency_s(chance), case.latency_s(chance)
        asked_s = at_s - there_s if case.is_one_way else at_s
        looked_s = asked_s + there_s
        arrival_s = max(last_s, looked_s + back_s)
        shown_ms = int((T0_S + looked_s + truth.at(looked_s)) * 1000)
        shown_ms -= shown_ms % case.resolution_ms
        trip_s = 0.5 if case.is_one_way else arrival_s - asked_s
        edge_ms = 0 if case.is_one_way else round((T0_S + (asked_s + arrival_s) / 2.0) * 1000)
        reading = ClockReading(shown_ms, edge_ms, round(trip_s * 1000), case.resolution_ms, stamps_samples=case.stamps)
        stamp_s = looked_s - chance.uniform(0.0, 0.35)  # polled by its adapter
        newest_ms = int((T0_S + stamp_s + truth.at(stamp_s)) * 1000) if case.stamps else None
        yield clock.Heard(arrival_s, (T0_S + arrival_s) * 1000.0, reading, newest_ms)
        last_s = arrival_s
        at_s = max(at_s + case.every_s + chance.uniform(-1.0, 1.0) * min(case.jitter_s, 0.5 * case.every_s), arrival_s)


def judged(case: Case, truth: Truth, seconds: float, chance: random.Random) -> tuple[list[Estimate], clock.State]:
    """The published estimate as it stands at each bucket's end."""
    state, found = clock.State(), list[Estimate]()
    for one in heard(case, truth, seconds, chance):
        done = clock.step(state, one)
        state = done.state
        told = state.published
        if done.health and told is not None and told.bound is not None:
            found.append(Estimate(one.at_s, told.bound.offset_s, told.bound.spread_s, truth.at(one.at_s)))
    return found, state


def simulated(hours: float, runs: int, seed: int) -> None:
    """The table of all cases."""
    heads = "".join(f"{head:>10}" for head in ("covered", "error", "worst", "spread", "drift err", "steps", "us/look"))
    print(f"{'simulated clock':38}{heads}")
    for case in CASES:
        chance = random.Random(f"{seed} {case.name}")
        estimates, errors_ppm, steps, looks, spent_s = list[Estimate](), list[float](), 0, 0, 0.0
        for _ in range(runs):
            truth = Truth(
                chance.choice((0.0, 1.7, -2.4, 3600.0, -1e6)) + chance.uniform(-1.0, 1.0), chance.uniform(-100.0, 100.0)
            )
            began_s = time.perf_counter()
            found, state = judged(case, truth, hours * 3600.0, chance)
            spent_s += time.perf_counter() - began_s
            looks += round(hours * 3600.0 / case.every_s)
            estimates += found
            steps += state.steps
            if state.drift is not None:
                errors_ppm.append(abs(state.drift.ppm - truth.ppm))
        off = [abs(one.offset_s - one.true_s) for one in estimates]
        covered = sum(error_s <= one.spread_s for error_s, one in zip(off, estimates, strict=True)) / len(off)
        drift = f"{median(errors_ppm):.1f} ppm" if errors_ppm else "not known"
        spread_s = median(one.spread_s for one in estimates)
        print(
            f"{case.name:38}{covered:10.2%}{median(off):9.3f}s{max(off):9.3f}s{spread_s:9.3f}s{drift:>10}{steps:10d}"
            f"{spent_s / looks * 1e6:10.1f}"
        )


def stepped(runs: int, seed: int) -> None:
    """Clocks that are set in the middle of half an hour."""
    print(f"\n{'a step at 900 s':38} {'found':>8} {'false':>8} {'after':>8}")
    for case in CASES:
        chance = random.Random(f"{seed} step {case.name}")
        found, false, after_s = 0, 0, list[float]()
        for _ in range(runs):
            by_s = chance.choice((-1.0, 1.0)) * chance.uniform(1.5, 4000.0)
            truth, set_to = Truth(chance.uniform(-5.0, 5.0), 20.0), 0
            before = list(heard(case, truth, 900.0, chance))
            later = [one for one in heard(case, Truth(truth.offset_s + by_s, 20.0), 1800.0, chance) if one.at_s > 900.0]
            state = clock.State()
            for one in [*(look for look in before if look.at_s <= 900.0), *later]:
                state = clock.step(state, one).state
                if state.steps > set_to:
                    set_to = state.steps
                    if one.at_s > 900.0:
                        after_s.append(one.at_s - 900.0)
            found += state.steps >= 1
            false += max(0, state.steps - 1)
        print(f"{case.name:38} {found / runs:8.1%} {false:8d} {median(after_s) if after_s else float('nan'):7.1f}s")


def by_signals(speed: Sequence[tuple[float, float]], seed: int) -> None:
    """The table of the sheet: a recorded speed against a synthetic sensor, plain sample-and-hold and with the poll known."""
    print(f"\n{'signals, true offset (drift)':38} {'hold':>8} {'poll':>8} {'windows used':>14}")
    for offset_s, ppm in ((0.0, 0.0), (1.7, 0.0), (-2.4, 50.0), (0.8, -100.0)):
        envelope = sensor(speed, Truth(offset_s, ppm), random.Random(seed))
        row, used = list[float](), ""
        for poll_s in (0.0, 0.35):
            from_s, peaks, windows = speed[0][0], list[clock_signals.Peak](), 0
            while from_s + 60.0 < speed[-1][0]:
                peak = clock_signals.compare(tuple(speed), envelope, from_s=from_s, around_s=0.0, poll_s=poll_s)
                peaks += [peak] if peak is not None and peak.quality > clock_signals.QUALITY_MIN else []
                from_s, windows = from_s + clock_signals.WINDOW_S, windows + 1
            row.append(median(peak.offset_s for peak in peaks) if peaks else float("nan"))
            used += f" {len(peaks)}/{windows}"
        print(f"{offset_s:+8.2f} s ({ppm:+.0f} ppm){'':18} {row[0]:+7.2f}s {row[1]:+7.2f}s {used:>14}")


def sensor(speed: Sequence[tuple[float, float]], truth: Truth, chance: random.Random) -> clock_signals.Points:
    """A drive's current as an edge would see it, 20 times a second: acceleration, some speed, and noise as large as both.

    Each change happens at some moment of the poll before the one that shows it, and takes 0.1 s.
    """
    knots = [speed[0]]
    for (before_s, before), (at_s, value) in pairwise(speed):
        begins_s = max(before_s, at_s - chance.uniform(0.1, 0.4))
        knots += [(begins_s, before), (min(at_s, begins_s + 0.1), value)]
    points, place, last = list[tuple[float, float]](), 0, knots[0][1]
    from_s = speed[0][0]
    for number in range(round((speed[-1][0] - from_s) / 0.05)):
        at_s = from_s + 0.05 * number
        while place < len(knots) - 2 and knots[place + 1][0] <= at_s:
            place += 1
        (left_s, left), (right_s, right) = knots[place], knots[place + 1]
        now = left + (right - left) * min(max((at_s - left_s) / max(right_s - left_s, 1e-9), 0.0), 1.0)
        current = abs(now - last) / 0.05 / 1000.0 + now / 3000.0 + abs(chance.gauss(0.0, 0.3))
        points.append((at_s - truth.at(at_s - from_s), current))
        last = now
    return tuple(points)


def recorded_speed(path: Path) -> list[tuple[float, float]]:
    """The longest stretch of the main spindle's speed in an SHDR recording."""
    best, run = list[tuple[float, float]](), list[tuple[float, float]]()
    for line in path.read_text(encoding="latin-1").split("\n"):
        time_text, *pairs = line.split("|")
        for key, value in zip(pairs[::2], pairs[1::2], strict=False):
            if key == "S1speed" and value.replace(".", "").isdigit():
                at_s = datetime.fromisoformat(time_text).timestamp()
                run = [] if run and not 0.0 < at_s - run[-1][0] < 600.0 else run
                run.append((at_s, float(value)))
                best = max(best, run, key=len).copy()
    return best


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--recording", type=Path)
    options = parser.parse_args()
    simulated(options.hours, options.runs, options.seed)
    stepped(options.runs, options.seed)
    if options.recording is not None:
        by_signals(recorded_speed(options.recording), options.seed)


if __name__ == "__main__":
    main()
