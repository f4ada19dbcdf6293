"""The comparison itself, run by `python -m benchmarks.stream_engines` in the environment of the plain loop.

Rounds are interleaved: each takes every engine once, and a ratio is between two figures of one round.
"""

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from confluent_kafka import KafkaException

from benchmarks.stream_engines.report import SIZES, Outcome, table
from benchmarks.stream_engines.trials import Bench, Engine, TrialError

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Extent:
    """The extent of a measurement."""

    messages: int
    rounds: int
    kills: int
    paced: int
    per_s: float


def say(text: str) -> None:
    """Write progress to standard error."""
    sys.stderr.write(f"[load {os.getloadavg()[0]:.1f}] {text}\n")
    sys.stderr.flush()


def attempt(outcome: Outcome, title: str, trial: Callable[..., Result], *terms: object) -> Result | None:
    """Run a trial; a failure of the engine is noted, and the comparison goes on."""
    try:
        result = trial(*terms)
    except (TrialError, KafkaException) as failure:
        outcome.failures.append(f"{title}: {failure}")
        say(outcome.failures[-1])
        return None
    say(f"{title}: {result}")
    return result


def compare_costs(bench: Bench, outcomes: Mapping[Engine, Outcome], round_: int, messages: int) -> None:
    """Measure the processor time of every engine once for each size of state."""
    for size in SIZES:
        unit_us = 0.0
        for engine, outcome in outcomes.items():
            title = f"{engine.name}, {size} B of state, round {round_}, µs a message"
            cpu_us = attempt(outcome, title, bench.cpu_us, engine, size, messages)
            if cpu_us is None:
                continue
            unit_us = cpu_us if engine.name == "plain" else unit_us
            outcome.cpu_us[size].append(cpu_us)
            if unit_us:
                outcome.ratios[size].append(cpu_us / unit_us)


def compare_kills(bench: Bench, outcomes: Mapping[Engine, Outcome], round_: int, extent: Extent) -> None:
    """Kill each engine that recovers once, and one of two workers of each engine that has several."""
    part = round_ / (extent.kills + 1)
    for engine, outcome in outcomes.items():
        paced = engine, SIZES[0], extent.paced, extent.per_s
        if engine.recovers and (result := attempt(outcome, f"{engine.name}, kill {round_}", bench.killed, *paced, part)):
            outcome.killed.append(result)
        if engine.shares and (result := attempt(outcome, f"{engine.name}, takeover {round_}", bench.taken_over, *paced)):
            outcome.taken_over.append(result)


def compare(bench: Bench, engines: Sequence[Engine], extent: Extent) -> dict[str, Outcome]:
    """Measure every engine."""
    outcomes = {engine: Outcome() for engine in engines}
    for number in range(extent.rounds):
        compare_costs(bench, outcomes, number + 1, extent.messages)
    for number in range(extent.kills):
        compare_kills(bench, outcomes, number + 1, extent)
    return {engine.name: outcome for engine, outcome in outcomes.items()}


def engines(names: Sequence[str], pythons: dict[str, str], jar: str, commit_s: float) -> list[Engine]:
    """Return the engines of these names; `quix` is three."""
    found = []
    for name in names:
        python = Path(pythons["plain" if name == "thin" else name])
        if name == "plain":
            found.append(Engine(name, "plain", "plain", python, commit_s, recovers=False, shares=False))
        elif name == "thin":
            found.append(Engine(name, "thin", "plain", python, commit_s))
        elif name == "quix":
            modes = ("at-least-once", "exactly-once", "stable")
            found += [Engine(f"quix-{mode}", "quix", "quix", python, commit_s, mode) for mode in modes]
        else:
            found.append(Engine(name, "flink", "flink", python, commit_s, jar=jar, shares=False))
    return found


def main() -> int:
    """Compare as the JSON object of the first argument says, and print the table."""
    told = json.loads(sys.argv[1])
    bench = Bench(told["kafka"], Path(told["folder"]))
    chosen = engines(told["engines"], told["pythons"], told["jar"], told["commit_s"])
    sys.stdout.write(table(compare(bench, chosen, Extent(**told["extent"]))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
