#!/usr/bin/env python3
"""How much of one core the joint anomaly score of 1,000 machines at 10 Hz takes: messages through engine, model, gate and common mode.

    .venv/bin/python benchmarks/joint_anomaly.py [--machines N] [--cell N] [--seconds S] [--json]

Every machine has an Isolation Forest of 200 trees on five features and reports all five ten times a second, each time other values.
The figure is CPU time over event time: 1 = one core is full. The share of the kernel is measured in the same run, by scoring the same
rows again. What is not in it: the transport (`benchmarks/sample_path.py`: receiving and decoding cost a multiple).
"""

import argparse
import json
import time
from random import Random
from typing import Any

import numpy as np
from sklearn.ensemble import IsolationForest

from processors.config import Configuration
from processors.effects import Publish
from processors.engine import Engine
from processors.joint_anomaly import PROCESSOR, Config
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from twin.anomaly.detector import flattened
from twin.anomaly.model import AnomalyModel

FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
START_MS = 1_790_000_000_000
TICK_MS = 100


def model(seed: int) -> AnomalyModel:
    """Trained on noise: what a score costs depends on the forest's size."""
    rows = np.random.default_rng(seed).normal(size=(4096, len(FEATURES)))
    return flattened(IsolationForest(200, contamination=0.01, random_state=seed).fit(rows), FEATURES)


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


def measure(machines: int, cell: int, seconds: float, models: int = 8) -> dict[str, Any]:
    """CPU time over event time, of the whole and of the kernel."""
    names = [f"m{i}" for i in range(machines)]
    trained = [model(seed) for seed in range(models)]
    cells = {f"c{i}": names[i : i + cell] for i in range(0, machines, cell)}
    configuration = Configuration(Config, {"cells": cells, "tick_s": TICK_MS / 1000, "threshold": 1.0}, name="joint_anomaly")
    configuration.default.__dict__["loaded"] = {name: trained[i % models] for i, name in enumerate(names)}
    engine, events = Engine(PROCESSOR, configuration, machines_max=machines), stream(names, seconds)
    births, data = events[:machines], events[machines:]
    for one in births:
        engine.feed(one, 0.0)
    warm, data = data[: len(data) // 4], data[len(data) // 4 :]
    for one in warm:
        engine.feed(one, 0.0)
    scores, began_s = 0, time.process_time()
    for one in data:
        for effect in engine.feed(one, 0.0):
            scores += isinstance(effect, Publish) and any(change[0] == "twin/raw_score" for change in effect.changes)
    whole_s = time.process_time() - began_s
    rows = [tuple(reading.value for reading in one.readings) for one in data]
    began_s = time.process_time()
    for i, row in enumerate(rows):
        trained[i % models].score_one(row)
    kernel_s = time.process_time() - began_s
    event_s = len(data) / machines * TICK_MS / 1000
    return {
        "machines": machines,
        "cell": cell,
        "messages": len(data),
        "scores": scores,
        "share_of_a_core": round(whole_s / event_s, 3),
        "share_of_the_kernel": round(kernel_s / event_s, 3),
        "us_per_score": round(1e6 * whole_s / max(scores, 1), 1),
    }


def main() -> None:
    """Print a line for each size of cell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=1000)
    parser.add_argument("--cell", type=int, action="append")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    for cell in given.cell or [4, 12, 50]:
        found = measure(given.machines, cell, given.seconds)
        if given.json:
            print(json.dumps(found))
        else:
            print(
                f"{found['machines']} machines at 10 Hz in cells of {cell}: {found['share_of_a_core']:.2f} of a core "
                f"({found['us_per_score']:.1f} µs a score, {found['scores']} scores); kernel {found['share_of_the_kernel']:.2f}"
            )


if __name__ == "__main__":
    main()
