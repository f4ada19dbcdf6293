#!/usr/bin/env python3
"""Measure how much of one core the joint anomaly score of 1,000 machines at 10 Hz takes: engine, model, gate and common mode.

    .venv/bin/python benchmarks/joint_anomaly.py [--machines N] [--cell N] [--seconds S] [--json]
    .venv/bin/python benchmarks/joint_anomaly.py --parts [--machines N] [--cell N] [--seconds S] [--json]

With `--parts` cuts are compared with cuts, the default of the processor: ticks of a second, five signals, a part of 240 s with
four tools and 24 lines (benchmarks/simulated_cell/milled_parts.py). Twenty-four machines for twelve minutes.

Every machine has an Isolation Forest of 200 trees on five features in a place of its own in memory (eight are trained, the others
are copies, which cost the same), and reports all five ten times a second, always other values.
The share is CPU time over event time: 1 = one core is full. In the same run, the same messages go through an engine with an empty
fold, and the same rows through the kernel alone: their ratio holds on other computers too. What is not in it: the transport
(`benchmarks/sample_path.py`: receiving and decoding cost a multiple).
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random
from statistics import median
from typing import Any

import numpy as np
from sklearn.ensemble import IsolationForest

from benchmarks.simulated_cell.milled_parts import PART_S, model_of_parts, recorded, rows_of
from processors.actions import Action, Publish
from processors.config import Configuration
from processors.contract import Output
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.parts_member import RAW
from processors.joint_anomaly.processor import PROCESSOR, State
from processors.joint_anomaly.scoring import scorings
from processors.running.engine import Engine
from processors.sample import Sample
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId, Reading
from sparkplug.quality import Quality
from twin.anomaly.detector import flattened
from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.replay import replayed
from twin.forest.forest import forest_of_arrays
from twin.forest.isolation import IsolationScorer

FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
START_MS = 1_790_000_000_000
TICK_MS = 100
Step = Callable[[Configuration[Config], State, Sample], tuple[State, Sequence[Output]]]


def model(seed: int) -> AnomalyModel:
    """Trained on noise: what a score costs depends on the forest's size."""
    rows = np.random.default_rng(seed).normal(size=(4096, len(FEATURES)))
    return flattened(IsolationForest(n_estimators=200, contamination=0.01, random_state=seed).fit(rows), FEATURES)


def copy_of(one: AnomalyModel) -> AnomalyModel:
    """The same forest in another place of the memory, as every machine has its own: no cache holds a thousand of them."""
    scorer = one.scorer
    assert isinstance(scorer, IsolationScorer)
    forest = forest_of_arrays({name: array.copy() for name, array in scorer.forest.arrays().items()})
    return replace(one, scorer=IsolationScorer(forest, scorer.denominator, scorer.offset))


def stream(machines: list[str], seconds: float) -> list[HostEvent]:
    """All messages, in the order of their time."""
    random = Random(1)
    nodes = {machine: NodeId("cnc", machine) for machine in machines}

    def event(kind: EventKind, machine: str, at_ms: int) -> HostEvent:
        readings = tuple(Reading(name, random.gauss(0.0, 1.0), at_ms, Quality.GOOD, None, None, False) for name in FEATURES)
        change = Reading("tool_change_active", False, START_MS, Quality.GOOD, None, None, False)
        return HostEvent(kind, nodes[machine], machine, at_ms, (*readings, change) if kind is EventKind.BIRTH else readings)

    ticks = range(START_MS + TICK_MS // 2, START_MS + round(seconds * 1000), TICK_MS)
    data = [event(EventKind.DATA, machine, at_ms) for at_ms in ticks for machine in machines]
    return [*(event(EventKind.BIRTH, machine, START_MS) for machine in machines), *data]


def engine(step: Step, names: list[str], cell: int, models: list[AnomalyModel]) -> Engine:
    """The processor's own fold, or another, over cells of so many machines."""
    cells = {f"c{i}": names[i : i + cell] for i in range(0, len(names), cell)}
    table, by_name = (
        {"cells": cells, "tick_s": TICK_MS / 1000, "threshold": 1.0, "common_mode": "source"},
        dict(zip(names, models, strict=True)),
    )
    configuration = Configuration(Config, table, name="joint_anomaly", reads=lambda config: scorings(config, by_name))
    return Engine(replace(PROCESSOR, step=step), configuration, machines_max=len(names))


def measure(machines: int, cell: int, seconds: float) -> dict[str, Any]:
    """CPU time for each score: of the whole, of an engine whose fold does nothing, and of the kernel.

    The three take turns, tick by tick, so that what else runs on this computer is felt by all; the medians of the ticks are told.
    """
    names = [f"m{i}" for i in range(machines)]
    first = [model(seed) for seed in range(8)]
    trained = [copy_of(first[i % len(first)]) for i in range(machines)]
    whole, empty = engine(PROCESSOR.step, names, cell, trained), engine(nothing, names, cell, trained)
    events = stream(names, seconds)
    for one in events[: 3 * machines]:
        whole.feed(one, 0.0)
        empty.feed(one, 0.0)
    data = events[3 * machines :]
    ticks: list[tuple[float, float, float]] = []
    scored = whole.counts.ticks
    for place in range(0, len(data), machines):
        tick = data[place : place + machines]
        rows = [tuple(reading.value for reading in one.readings) for one in tick]
        at_s = [time.process_time()]
        for one in tick:
            whole.feed(one, 0.0)
        at_s.append(time.process_time())
        for one in tick:
            empty.feed(one, 0.0)
        at_s.append(time.process_time())
        for i, row in enumerate(rows):
            trained[i].score_one(row)
        at_s.append(time.process_time())
        ticks.append((at_s[1] - at_s[0], at_s[2] - at_s[1], at_s[3] - at_s[2]))
    scored = whole.counts.ticks - scored
    if scored != len(data) or whole.counts.dead_letters:
        raise SystemExit(f"{scored} scores of {len(data)} messages, {whole.counts.dead_letters} dead letters")
    if not any(change.name == RAW for change in published(whole.feed(data[-1]._replace(readings=later(data[-1])), 0.0))):
        raise SystemExit("no score is published: this measures something else")
    whole_us, empty_us, kernel_us = (1e6 * median(of_tick) / machines for of_tick in zip(*ticks, strict=True))
    return {
        "machines": machines,
        "cell": cell,
        "scores": scored,
        "us_per_score": round(whole_us, 1),
        "us_of_the_empty_engine": round(empty_us, 1),
        "us_of_the_kernel": round(kernel_us, 1),
        "times_the_empty_engine": round(whole_us / empty_us, 2),
        "share_of_a_core": round(machines * whole_us / (1000 * TICK_MS), 3),
    }


def measure_parts(machines: int, cell: int, seconds: float) -> dict[str, Any]:
    """CPU time for each tick of a machine whose parts are compared: of the whole, and of an engine whose fold does nothing."""
    names = [f"m{i}" for i in range(machines)]
    learned = model_of_parts()
    cells = {f"c{i}": names[i : i + cell] for i in range(0, len(names), cell)}
    table, models = {"cells": cells, "threshold": 5.0}, dict.fromkeys(names, learned)
    configuration = Configuration(Config, table, name="joint_anomaly", reads=lambda config: scorings(config, models))
    whole, empty = (
        Engine(replace(PROCESSOR, step=step), configuration, machines_max=machines) for step in (PROCESSOR.step, nothing)
    )
    parts = [rows_of(place, 1 + round(seconds) // PART_S) for place in range(machines)]
    times: list[tuple[float, float]] = []
    for second in range(round(seconds)):
        kind, at_ms = EventKind.DATA if second else EventKind.BIRTH, START_MS + 1000 * second + 500
        said = [(name, parts[place][(second + 7 * place) % len(parts[place])]) for place, name in enumerate(names)]
        events = [
            HostEvent(kind, NodeId("cnc", name), name, at_ms, tuple(_told(key, value, at_ms) for key, value in row.items()))
            for name, row in said
        ]
        at_s = [time.process_time()]
        for engine_now in (whole, empty):
            for event in events:
                engine_now.feed(event, 0.0)
            at_s.append(time.process_time())
        times.append((at_s[1] - at_s[0], at_s[2] - at_s[1]))
    late = times[len(times) // 3 :]  # the first part is new to nobody, but births and caches are not what is measured
    if whole.counts.dead_letters:
        raise SystemExit(f"{whole.counts.dead_letters} dead letters")
    whole_us, empty_us = (1e6 * sum(each) / len(late) / machines for each in zip(*late, strict=True))
    assert learned.parts is not None
    rows, at_s = recorded(machines, 4), [time.process_time()]
    replayed([learned.parts], [rows])
    scores_us = 1e6 * (time.process_time() - at_s[0]) / len(rows.values)
    return {
        "machines": machines,
        "cell": cell,
        "us_of_the_scores": round(scores_us, 1),
        "us_a_machine_tick": round(whole_us, 1),
        "us_of_the_empty_engine": round(empty_us, 1),
        "us_of_the_fold": round(whole_us - empty_us, 1),
        "snapshot_kb_a_machine": round(len(whole.snapshot("c0")) / 1000 / min(cell, machines), 1),
    }


def _told(name: str, value: Any, at_ms: int) -> Reading:
    return Reading(name, value, at_ms, Quality.GOOD, None, None, False)


def later(event: HostEvent) -> tuple[Reading, ...]:
    """The same, a tick later."""
    return tuple(reading._replace(timestamp_ms=reading.timestamp_ms + TICK_MS) for reading in event.readings)


def published(actions: Sequence[Action]) -> list[Change]:
    """All values that go out."""
    return [change for action in actions if isinstance(action, Publish) for change in action.changes]


def nothing(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, tuple[()]]:
    """A fold that does nothing: what is left is the engine."""
    return state, ()


def _print_parts(given: argparse.Namespace) -> None:
    for cell in given.cell or [1, 4, 12]:
        found = measure_parts(given.machines or 24, cell, given.seconds or 3.0 * PART_S)
        if given.json:
            print(json.dumps(found))
        else:
            fold_us, empty_us, scores_us = (found[f"us_of_the_{part}"] for part in ("fold", "empty_engine", "scores"))
            print(
                f"parts, {found['machines']} machines at 1 Hz in cells of {cell}: {fold_us:.1f} µs a machine tick over an engine "
                f"with an empty fold ({empty_us:.1f} µs), of which the scores alone {scores_us:.1f} µs; "
                f"a snapshot has {found['snapshot_kb_a_machine']:.1f} kB a machine"
            )


def main() -> None:
    """Print a line for each size of cell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int)
    parser.add_argument("--cell", type=int, action="append")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--parts", action="store_true", help="compare cuts with cuts")
    given = parser.parse_args()
    if given.parts:
        _print_parts(given)
        return
    for cell in given.cell or [4, 12, 50]:
        machines = given.machines or 1000
        found = measure(machines, cell, given.seconds or 6.0)
        if given.json:
            print(json.dumps(found))
        else:
            print(
                f"{machines} machines at 10 Hz in cells of {cell}: {found['share_of_a_core']:.2f} of a core; "
                f"{found['us_per_score']:.1f} µs a score, {found['times_the_empty_engine']:.1f} times an engine with an empty "
                f"fold ({found['us_of_the_empty_engine']:.1f} µs); kernel {found['us_of_the_kernel']:.1f} µs"
            )


if __name__ == "__main__":
    main()
