#!/usr/bin/env python3
"""Measure what the residual model gains, and what it refuses: simulated days, and a real machine's day.

    .venv/bin/python benchmarks/residual.py [--trees N] [--nulls N] [--data FOLDER] [--json]

The simulated machine differs from its twin by a few per cent of its constants, and its spindle stands in a column that the twin's
physics does not have. Six days are trained on; three later days, with a program that was never cut before and a warmer shop, are
held out. Beside the forest: the physics alone, the physics and a constant, a line through the same features, and the figure that
a split of shuffled hours would have given. Then a day on which a program runs twice as fast; a start in the middle of a shift;
rules for the region, by what they refuse of what is far off and keep of what is not; residuals that no feature explains; what a
correction costs; and, where the recording is there, the Mazak's day, whose temperature is known not to follow its speed.
"""

import argparse
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import IsolationForest, RandomForestRegressor

from benchmarks.simulated_days import ORDINARY, Day, ordinary_days, simulated_days
from cnctwin.standins.simulated_machine.description import TOLD
from twin.errors import TwinError
from twin.machine import Thermal, read_machine
from twin.recording.observations import read_observations
from twin.residual.features import LOAD, MEASURED, PHYSICS, SETS, SPEED
from twin.residual.judging import rmse
from twin.residual.model import Trained
from twin.residual.physics import Physics
from twin.residual.recorded_run import Samples, recorded_of
from twin.residual.region_fit import region_of
from twin.residual.split import blocks_of
from twin.residual.table import Recorded, Table, offered, table_of
from twin.residual.training import Outcome, TrainingSettings, fitted, trained

Floats = NDArray[np.float64]
NEW_PROGRAM, TWICE = (0.7, 0.95), (2.0, 2.0)


def machine() -> tuple[Thermal, Physics]:
    """The twin's constants."""
    thermal = read_machine(TOLD).thermal
    assert thermal is not None
    return thermal, Physics.model_validate(thermal.model_dump() | {"ambient_temp_c": None})


def days(thermal: Thermal, seed: int) -> Recorded:
    """Six ordinary days, and three with another program and another shop."""
    late = tuple(Day((ORDINARY[n % 4], NEW_PROGRAM), 21.5 + n % 2, 13.0) for n in range(3))
    return simulated_days((*ordinary_days(6), *late), thermal, seed)


def by_set(recorded: Recorded, asked: TrainingSettings, about: Trained) -> dict[str, Any]:
    """Each feature set, judged alike."""
    found: dict[str, Any] = {}
    for name in SETS:
        began = time.perf_counter()
        held = trained(recorded, replace(asked, feature_set=name), about).model.held_out
        found[name] = {**held.model_dump(), "refused": held.why_refused, "seconds": time.perf_counter() - began}
    return found


def shuffled_hours(done: Outcome, name: str, asked: TrainingSettings) -> dict[str, float]:
    """Gain of a forest whose held-out hours are drawn by lot, beside that on later time; rows and trees alike."""
    table = done.table
    x, y = table.of(SETS[name]), table.residual_k
    hour = np.floor(table.t_s / 3600.0).astype(np.int64)
    names = np.unique(hour)
    drawn = np.random.default_rng(asked.seed).permutation(names)[: round(asked.held_share * len(names))]
    row = np.random.default_rng(asked.seed).permutation(len(y)) < asked.held_share * len(y)
    found = {}
    for what, test in (("hours", np.isin(hour, drawn)), ("rows", row)):
        error = y[test] - fitted(x[~test], y[~test], asked).predict(x[test])
        found[what] = 1.0 - rmse(error) / rmse(y[test])
    found["training data itself"] = 1.0 - rmse(y - fitted(x, y, asked).predict(x)) / rmse(y)
    train, test = done.split.train, done.split.test
    found["later time"] = 1.0 - rmse(y[test] - fitted(x[train], y[train], asked).predict(x[test])) / rmse(y[test])
    return found


def elsewhere(done: Outcome, recorded: Recorded) -> dict[str, float]:
    """A recording of something else: what is refused of it, and what the forest would have made of that."""
    table = table_of(recorded, done.model.features, 30.0)
    inside, said = done.model.region.has(table.x), done.model.forest.predict(table.x)
    y = table.residual_k
    return {
        "refused": float(1.0 - inside.mean()),
        "physics_refused_k": rmse(y[~inside]),
        "forest_refused_k": rmse((y - said)[~inside]),
        "physics_used_k": rmse(y[inside]),
        "corrected_used_k": rmse((y - said)[inside]),
    }


def started_midway(done: Outcome, day: Recorded, thermal: Thermal, physics: Physics) -> dict[str, float]:
    """The physics and the means begin again in the middle of a shift: the four hours after it."""
    half = len(day.t_s) // 2
    part = slice(half, half + 4 * 3600)
    told = {name: Samples(day.t_s[part], values[part]) for name, values in day.signals.items() if name != PHYSICS}
    return elsewhere(done, recorded_of(told, physics))


def regions(train: Table, held: Table, fars: dict[str, Table], seed: int) -> dict[str, dict[str, float]]:
    """Share that is kept by each rule, of held-out rows and of what is far off."""
    rng = np.random.default_rng(seed)
    x, block = train.x, blocks_of(train.t_s, 7200.0)
    low, high = x.min(axis=0), x.max(axis=0)
    points = {"held out": held.x, **{name: table.x for name, table in fars.items()}}
    points["features shuffled among rows"] = np.column_stack([rng.permutation(column) for column in x.T])
    points["anywhere in the ranges"] = rng.uniform(low, high, (1500, x.shape[1]))
    region = region_of(x, block)
    isolation = IsolationForest(n_estimators=200, random_state=seed).fit(x)
    odd = np.quantile(isolation.score_samples(x), 0.01)
    forest = RandomForestRegressor(60, max_depth=14, min_samples_leaf=5, random_state=seed).fit(x, train.residual_k)
    leaves = forest.apply(x)
    some = rng.permutation(len(x))[:1000]
    shared = np.quantile([(leaves[block != block[i]] == leaves[i]).mean(axis=1).max() for i in some], 0.01)
    found = {}
    for name, every in points.items():
        rows = every[rng.permutation(len(every))[:1000]]
        ranged = ((rows >= region.low) & (rows <= region.high)).all(axis=1)
        together = np.array([(leaves == own).mean(axis=1).max() for own in forest.apply(rows)])
        found[name] = {
            "ranges": float(ranged.mean()),
            "and isolation forest": float((ranged & (isolation.score_samples(rows) >= odd)).mean()),
            "and leaves shared": float((ranged & (together >= shared)).mean()),
            "and nearest row": float(region.has(rows).mean()),
        }
    return found


def nulls(recorded: Recorded, count: int, asked: TrainingSettings, about: Trained) -> dict[str, Any]:
    """Residuals that wander by themselves, whatever the machine does: how many of such models are accepted."""
    accepted, unjudged, gains = 0, 0, []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        steps = rng.normal(size=len(recorded.t_s) // 60 + 1)
        kept, wander = np.exp(-60.0 / 5400.0), np.empty(len(steps))
        wander[0] = steps[0]
        for n in range(1, len(steps)):
            wander[n] = kept * wander[n - 1] + np.sqrt(1.0 - kept**2) * steps[n]
        offset = rng.normal()
        residual = offset + np.repeat(wander, 60)[: len(recorded.t_s)]
        signals = {**recorded.signals, MEASURED: recorded.signals[PHYSICS] + residual}
        try:
            held = trained(Recorded(recorded.t_s, recorded.stretch, signals), asked, about).model.held_out
        except TwinError:  # it remembers for so long that the held-out time gives no interval
            unjudged += 1
            continue
        accepted += not held.why_refused
        gains.append(held.gain.value)
    middle = float(np.median(gains)) if gains else None
    return {"models": count, "accepted": accepted, "no interval": unjudged, "gain over physics alone, median": middle}


def cost(done: Outcome, rows: Floats) -> float:
    """Microseconds of a correction, region and forest, on rows one after the other."""
    listed = rows[:2000].tolist()
    done.model.correction_one(listed[0])
    began = time.perf_counter()
    for row in listed:
        done.model.correction_one(row)
    return (time.perf_counter() - began) / len(listed) * 1e6


def mazak(path: Path, asked: TrainingSettings) -> dict[str, Any]:
    """The second spindle of a real machine: its temperature swings with its spindles at rest (ambient: not recorded, 24 °C)."""
    told: dict[str, list[tuple[float, float]]] = {}
    names = {"S2rpm": SPEED, "S2load": LOAD, "S2temp": MEASURED, "Fact": "feed_mm_min", "Xabs": "axis_x_pos_mm"}
    names |= {"Yabs": "axis_y_pos_mm", "Zabs": "axis_z_pos_mm"}
    for at_s, key, text in read_observations(path.read_text(encoding="utf-8", errors="replace"), path.name).rows:
        if key in names:
            told.setdefault(names[key], []).append((at_s, _number(text)))
    series = {}
    for name, pairs in told.items():
        times, values = np.array(pairs).T
        known = values != 0.0 if name == MEASURED else np.full(len(values), True)  # 0 is no temperature here
        series[name] = Samples(times[known], values[known])
    physics = Physics(ambient_temp_c=24.0)
    last_s = max(one.t_s[-1] for one in series.values())
    begins_s = last_s - 86_400.0  # what is older was told at the start of the file
    day = {name: Samples(np.maximum(one.t_s, begins_s), one.value) for name, one in series.items()}
    recorded = recorded_of(day, physics)
    about = Trained(machine="mazak", physics=physics)
    try:
        held = trained(recorded, asked, about).model.held_out
    except TwinError as error:
        hours = {"hours": recorded.hours, "cutting_hours": recorded.cutting_hours}
        return {**hours, "refused": str(error), "judged all the same": all_the_same(recorded, asked)}
    return {"hours": recorded.hours, "cutting_hours": recorded.cutting_hours, **held.model_dump(), "refused": held.why_refused}


def all_the_same(recorded: Recorded, asked: TrainingSettings) -> dict[str, float]:
    """RMSE on the second half of a forest that was trained on the first, whatever such a figure is worth, K."""
    table = table_of(recorded, offered(recorded, SETS["published"]), asked.row_s)
    half = len(table.t_s) // 2
    y, constant = table.residual_k[half:], table.residual_k[:half].mean()
    said = fitted(table.x[:half], table.residual_k[:half], asked).predict(table.x[half:])
    return {"physics": rmse(y), "physics and a constant": rmse(y - constant), "forest": rmse(y - said)}


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def measured(asked: TrainingSettings, null_count: int, data: Path) -> dict[str, Any]:
    """Everything."""
    thermal, physics = machine()
    about = Trained(machine="vmc", physics=physics)
    recorded = days(thermal, 1)
    found: dict[str, Any] = {"hours": recorded.hours, "cutting_hours": recorded.cutting_hours}
    found["by feature set"] = by_set(recorded, asked, about)
    done = trained(recorded, asked, about)
    found["chosen"] = done.model.trained.feature_set
    found["choosing"] = dict(done.choosing)
    smaller = replace(asked, trees=min(asked.trees, 100))
    found["split"] = {name: shuffled_hours(done, name, smaller) for name in ("published", "remembering")}
    other = {
        "a program twice as fast": simulated_days([Day((TWICE,), 21.0)], thermal, 7, start_day=20),
        "the shop 8 K warmer": simulated_days([Day(ORDINARY[:2], 29.0)], thermal, 8, start_day=20),
        "a day and a night without a break": simulated_days([Day((ORDINARY[0],), 21.0, 24.0)], thermal, 9, start_day=20),
    }
    found["elsewhere"] = {name: elsewhere(done, one) for name, one in other.items()}
    day = simulated_days([Day(ORDINARY[:2], 21.0)], thermal, 10, start_day=20)
    found["elsewhere"]["the same shift, begun in its middle"] = started_midway(done, day, thermal, physics)
    found["regions"] = {}
    for name in SETS:
        tables = {what: table_of(one, SETS[name], 30.0) for what, one in other.items()}
        train = table_of(simulated_days(ordinary_days(6), thermal, 1), SETS[name], 30.0)
        held = table_of(simulated_days(ordinary_days(8)[6:], thermal, 2, start_day=10), SETS[name], 30.0)
        found["regions"][name] = regions(train, held, tables, 0)
    found["correction_us"] = cost(done, done.table.of(done.model.features))
    if null_count:
        quick = replace(asked, trees=40, feature_set="lean", row_s=60.0)
        found["nulls"] = nulls(recorded, null_count, quick, about)
    path = data / "nist" / "raw" / "Mazak01-20180718-20180719.txt"
    if path.exists():
        found["mazak"] = mazak(path, asked)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--trees", type=int, default=300)
    parser.add_argument("--nulls", type=int, default=40)
    here = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("CNCTWIN_DATA", here)))
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = measured(TrainingSettings(trees=options.trees), options.nulls, options.data)
    if options.json:
        print(json.dumps(found))
        return
    print(f"{found['hours']:.0f} h, {found['cutting_hours']:.0f} h of cutting; RMSE in K on held-out days, in the region")
    for name, one in found["by feature set"].items():
        gain, names = one["gain"], ("physics", "constant", "linear", "corrected")
        rmses = ", ".join(f"{what} {one[f'{what}_rmse_k']:.2f}" for what in names)
        interval = f"gain {100 * gain['value']:.0f} % ({100 * gain['low']:.0f} to {100 * gain['high']:.0f})"
        blocks = f"{one['blocks']} blocks of {one['gap_s'] / 3600:.1f} h"
        print(f"  {name:12s} {rmses}; {interval}, {blocks}, in region {100 * one['in_region']:.0f} %, {one['seconds']:.0f} s")
        if one["refused"]:
            print(f"      REFUSED: {one['refused']}")
    print(f"chosen: {found['chosen']}, of " + ", ".join(f"{k} {v:.2f} K" for k, v in found["choosing"].items()))
    best = found["by feature set"][found["chosen"]]
    print("by regime (physics, corrected, share):", {k: tuple(round(x, 2) for x in v) for k, v in best["by_regime"].items()})
    print("worth of a feature, K:", best["importance"])
    print("gain by how the test rows were chosen")
    for name, one in found["split"].items():
        print(f"  {name:12s} " + ", ".join(f"{what} {100 * value:.0f} %" for what, value in one.items()))
    print("elsewhere")
    for name, one in found["elsewhere"].items():
        print(f"  {name:36s} " + ", ".join(f"{what} {value:.2f}" for what, value in one.items()))
    print("kept by rules for the region")
    for name, rules in found["regions"].items():
        for what, one in rules.items():
            print(f"  {name:12s} {what:34s} " + ", ".join(f"{rule} {value:.3f}" for rule, value in one.items()))
    print(f"a correction: {found['correction_us']:.0f} µs")
    print("residuals that nothing explains:", found.get("nulls"))
    print("Mazak:", json.dumps(found.get("mazak", "no recording"), indent=1))


if __name__ == "__main__":
    main()
