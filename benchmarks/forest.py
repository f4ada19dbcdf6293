#!/usr/bin/env python3
"""Flattened forests beside scikit-learn, in one run: time a row at batch 1, 10, 100, 1000, rows of the same bits, size, loading.

    .venv/bin/python benchmarks/forest.py [--rounds N] [--json]

An isolation forest of 200 trees on 5 features, alone and behind a StandardScaler, and a random forest of 300 trees, at most 14
levels, at least 5 rows a leaf, on 8 features; both on synthetic rows, each call with other rows than the one before. Ours and
scikit-learn's (one thread, as it serves fastest) take turns; a figure is the median over the rounds, the ratio the median of the
rounds' ratios, and the fastest round stands beside them, for a machine may have neighbours. A single row of ours is a list of
numbers, with everything from the call in Python to the number that comes back; that of scikit-learn is an array (1, n), so it is
spared the conversion. One forest that is asked again and again stays in the caches; a thousand forests of a thousand machines do
not, so a single row is also timed with that many copies in turn.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import IsolationForest, RandomForestRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from benchmarks.saved_regression import load_regression, save_regression
from twin.anomaly.detector import flattened
from twin.anomaly.model import load_model, save_model
from twin.forest import IsolationScorer, flatten_isolation, flatten_regression

Floats = NDArray[np.float64]
Score = Callable[[Floats], Floats]
BATCHES = (1, 10, 100, 1000)
FORESTS = 1000
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
CENTRE, SPREAD = np.array([40.0, 6000.0, 1000.0, 40.0, 0.2]), np.array([10.0, 1000.0, 300.0, 5.0, 0.1])


def microseconds_a_row(score: Callable[[Any], object], batches: list[Any], rows: int) -> float:
    """Return the microseconds that a row takes in one pass over all batches."""
    began = time.perf_counter()
    for batch in batches:
        score(batch)
    return (time.perf_counter() - began) / len(batches) / rows * 1e6


def compared(theirs: Score, ours: Score, ours_one: Callable[[list[float]], float], rows: Floats, rounds: int) -> dict[str, Any]:
    """Times of both at each size of batch."""
    found: dict[str, Any] = {}
    for size in BATCHES:
        count = {1: 20, 10: 20, 100: 5, 1000: 2}[size]
        batches = [rows[i * size : (i + 1) * size] for i in range(count)]
        many = (
            [rows[i % len(rows)].tolist() for i in range(1000)] if size == 1 else [batches[i % count] for i in range(10 * count)]
        )
        mine: Callable[[Any], object] = ours_one if size == 1 else ours
        times = [(microseconds_a_row(mine, many, size), microseconds_a_row(theirs, batches, size)) for _ in range(rounds)]
        found[str(size)] = {
            "ours_us": statistics.median(ours for ours, _ in times),
            "ours_fastest_us": min(ours for ours, _ in times),
            "sklearn_us": statistics.median(theirs for _, theirs in times),
            "ratio": statistics.median(theirs / ours for ours, theirs in times),
        }
    return found


def in_turn_us(scorer: IsolationScorer, rows: Floats, rounds: int) -> float:
    """Microseconds a row where each of a thousand forests is asked once in turn; the fastest round."""
    forest = scorer.forest
    copies = [
        replace(scorer, forest=replace(forest, nodes=forest.nodes.copy(), values=forest.values.copy())) for _ in range(FORESTS)
    ]
    pairs = list(zip(copies, rows[:FORESTS].tolist(), strict=True))
    return min(microseconds_a_row(lambda pair: pair[0].score_one(pair[1]), pairs, 1) for _ in range(rounds))


def same_bits(ours: Floats, theirs: Floats) -> str:
    """Return how many, of how many."""
    return f"{int((ours.view(np.int64) == np.ascontiguousarray(theirs).view(np.int64)).sum())} of {len(ours)}"


def loading_ms(load: Callable[[], object]) -> float:
    """Median of eleven, the first left out: it fetches the kernel."""
    times = []
    for _ in range(12):
        began = time.perf_counter()
        load()
        times.append((time.perf_counter() - began) * 1e3)
    return statistics.median(times[1:])


def size_bytes(folder: Path) -> int:
    """Return the bytes of all files in it."""
    return sum(path.stat().st_size for path in folder.iterdir())


def isolation(rounds: int, with_scaler: bool) -> dict[str, Any]:
    """The isolation forest."""
    generator = np.random.default_rng(0)
    model = IsolationForest(n_estimators=200, contamination=0.01, random_state=0)
    model = make_pipeline(StandardScaler(), model) if with_scaler else model
    model.fit(generator.normal(size=(20_000, 5)) * SPREAD + CENTRE)
    rows = generator.normal(size=(100_000, 5)) * SPREAD + CENTRE
    began = time.perf_counter()
    scorer = flatten_isolation(model)
    flatten_s = time.perf_counter() - began
    theirs = -model.decision_function(rows)
    one_by_one = np.array([scorer.score_one(row) for row in rows.tolist()])
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "model"
        save_model(flattened(model, FEATURES), folder)
        kept = {"bytes": size_bytes(folder), "load_ms": loading_ms(lambda: load_model(folder))}
        again = load_model(folder).scores(rows)
    return {
        "nodes": len(scorer.forest.nodes),
        "flatten_s": flatten_s,
        "same_bits_batch": same_bits(scorer.scores(rows), theirs),
        "same_bits_one_by_one": same_bits(one_by_one, theirs),
        "same_bits_loaded": same_bits(again, theirs),
        **kept,
        "thousand_in_turn_us": in_turn_us(scorer, rows, rounds),
        "batches": compared(lambda batch: -model.decision_function(batch), scorer.scores, scorer.score_one, rows, rounds),
    }


def regression(rounds: int) -> dict[str, Any]:
    """The random forest."""
    generator = np.random.default_rng(0)
    training = generator.normal(size=(10_050, 8))
    target = (
        2.0 * training[:, 0]
        + np.sin(3.0 * training[:, 1])
        + training[:, 2] * training[:, 3]
        + generator.normal(size=10_050) * 0.3
    )
    model = RandomForestRegressor(300, max_depth=14, min_samples_leaf=5, random_state=0, n_jobs=1).fit(training, target)
    rows = generator.normal(size=(20_000, 8))
    began = time.perf_counter()
    flat = flatten_regression(model)
    flatten_s = time.perf_counter() - began
    theirs = model.predict(rows)
    one_by_one = np.array([flat.predict_one(row) for row in rows.tolist()])
    names = tuple("abcdefgh")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "model"
        save_regression(flat, folder, names, "y")
        kept = {"bytes": size_bytes(folder), "load_ms": loading_ms(lambda: load_regression(folder, names))}
        again = load_regression(folder, names).predict(rows)
    return {
        "nodes": len(flat.forest.nodes),
        "flatten_s": flatten_s,
        "same_bits_batch": same_bits(flat.predict(rows), theirs),
        "same_bits_one_by_one": same_bits(one_by_one, theirs),
        "same_bits_loaded": same_bits(again, theirs),
        **kept,
        "batches": compared(model.predict, flat.predict, flat.predict_one, rows, rounds),
    }


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    found = {
        "isolation forest, 200 trees, 5 features": isolation(given.rounds, with_scaler=False),
        "the same behind a StandardScaler": isolation(given.rounds, with_scaler=True),
        "random forest, 300 trees, 8 features": regression(given.rounds),
    }
    if given.json:
        print(json.dumps(found))
        return
    for name, figures in found.items():
        print(f"{name}: {figures['nodes']} nodes, flattened in {figures['flatten_s']:.2f} s")
        bits = ", ".join(f"{figures[f'same_bits_{way}']} {way.replace('_', ' ')}" for way in ("batch", "one_by_one", "loaded"))
        print(f"  same bits: {bits}; folder of {figures['bytes'] / 1e6:.3f} MB, loaded in {figures['load_ms']:.1f} ms")
        if "thousand_in_turn_us" in figures:
            print(f"  one row of each of {FORESTS} forests in turn: {figures['thousand_in_turn_us']:.1f} µs a row at the fastest")
        for size, one in figures["batches"].items():
            print(
                f"  {size:>4} rows: {one['ours_us']:8.2f} µs a row (fastest {one['ours_fastest_us']:.2f}), "
                f"scikit-learn {one['sklearn_us']:9.1f}, ratio {one['ratio']:6.0f}"
            )


if __name__ == "__main__":
    main()
