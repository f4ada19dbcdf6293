#!/usr/bin/env python3
"""The tool-change detector: what it costs a sample, how well it does on a synthetic grid, and on the NIST recordings.

    .venv/bin/python benchmarks/tool_change_detector.py [cost] [grid] [nist] [--hours H] [--seeds N] [--json]

cost: CPU time of one sample through the whole detector at 100 Hz with a 10 s template and 13 stretched forms of both parts,
beside scipy.signal.correlate of the same template over a 30 s buffer, once for each sample, in the same run. The ratio tells.

grid: drive current at 10 Hz in AR(0.6) noise: changes that are stretched by 0.7 to 1.5, stalled by up to 4 s at a random moment,
or both, among things that look a bit like them (starts, stops, load steps, ramps, peaks, half a change). The template is learned
from five captures in the same noise, the threshold from a null stream for one false gate a day; false gates are counted in
another null stream. SNR is the variance of the change's shape over that of the noise.

nist: trained on plates 13 and 14 (run logs as `cnctwin import` writes them), judged on all other recordings of plate, box and
cover as they are, beside a detector of every stop and restart of the spindle. A label counts as found if it lies within the
event, first to last confirmation of it, extended by 30 s (and by 5 s); an event without a label of its own is false. Intervals
are Wilson's, 95 %.
"""

import argparse
import json
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate, lfilter
from scipy.stats import chi2

from benchmarks.synthetic_changes import PERIOD_S, learned_from, null_stream, stream_of_changes, synthetic_change
from cnctwin.training.detector.recorded_streams import streams_of_run
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs
from twin.runlog import run_log
from twin.transient.detector import Detector, Limits
from twin.transient.evidence import UNKNOWN
from twin.transient.replay import replayed
from twin.transient.stream import Stream, held, resting, standing
from twin.transient.template import Template
from twin.transient.training import TrainingSettings, trained

Floats = NDArray[np.float64]
DATA = Path(os.environ.get("CNCTWIN_DATA", Path(__file__).parent.parent.parent / "shared" / "data"))


# Cost.


def cost(samples: int = 30_000, repeats: int = 5) -> dict[str, float]:
    """µs of CPU time a sample at 100 Hz; the best of so many repeats, since other work only ever adds to it."""
    period_s = 0.01
    shape = synthetic_change(np.arange(1000) * period_s)
    both = np.concatenate([shape[:250], shape[650:]])
    shape = (shape - both.mean()) / both.std()
    template = Template(period_s, shape[:250], shape[250:650], shape[650:], stall_s=4.0)
    detector = Detector("spindle_current_a", template, 1.0, Limits(0.6, 0.7, 0.8, 0.6, 0.3, 3.0))
    detector.warmed_up()
    rng = np.random.default_rng(0)
    values = lfilter([1.0], [1.0, -0.6], rng.standard_normal(samples)).tolist()
    buffer = rng.standard_normal(3000)

    def ours() -> None:
        state = detector.begun()
        for value in values:
            state, _ = detector.advanced(state, value, UNKNOWN, UNKNOWN)

    def theirs(method: str) -> Callable[[], None]:
        def run() -> None:
            for _ in range(50):
                correlate(buffer, shape, mode="valid", method=method)

        return run

    per_sample = _best_of(ours, repeats) / samples * 1e6
    direct, fft = (_best_of(theirs(method), repeats) / 50 * 1e6 for method in ("direct", "fft"))
    return {"detector_us": per_sample, "scipy_direct_us": direct, "scipy_fft_us": fft, "ratio": min(direct, fft) / per_sample}


def _best_of(run: Callable[[], None], repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        begin_s = time.process_time()
        run()
        spent.append(time.process_time() - begin_s)
    return min(spent)


# The synthetic grid.

CELLS = {"nominal": (False, False), "stretch": (True, False), "stall": (False, True), "stretch and stall": (True, True)}


def grid(hours: float, seeds: int, snrs_db: Sequence[float] = (20.0, 10.0, 3.0), count: int = 100) -> list[dict[str, Any]]:
    """A row for each SNR: recall by cell, and false gates a day in a null stream of `hours` for each seed."""
    rows = []
    for snr_db in snrs_db:
        hits = {cell: [0, 0] for cell in CELLS}
        false, provisional, stated = 0, 0, []
        for seed in range(seeds):
            rng = np.random.default_rng([seed, round(10 * snr_db)])
            done = learned_from(5, hours / 2.0, snr_db, rng)
            stated.append((done.rate.per_day, done.rate.low, done.rate.high))
            for cell, (stretched, stalled) in CELLS.items():
                stream = stream_of_changes(count, snr_db, rng, stretched=stretched, stalled=stalled)
                outcome = replayed(done.detector, stream)
                for at_s in stream.changes_s:
                    found = [one for one in outcome.confirmed if abs((one.begun_s + one.at_s) / 2.0 - at_s) < 8.0]
                    hits[cell][0] += bool(found)
                    hits[cell][1] += 1
            outcome = replayed(done.detector, null_stream(hours, snr_db, rng))
            false, provisional = false + len(outcome.confirmed), provisional + len(outcome.opened_s)
        days = hours * seeds / 24.0
        rows.append({
            "snr_db": snr_db,
            "recall": {cell: (found / of, *wilson(found, of)) for cell, (found, of) in hits.items()},
            "false_per_day": (false / days, *(bound / days for bound in poisson_interval(false))),
            "provisional_per_day": provisional / days,
            "stated": stated,
            "null_hours": hours * seeds,
        })  # fmt: skip
    return rows


def wilson(found: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if not of:
        return 0.0, 1.0
    z, p = 1.96, found / of
    middle, half = (
        (p + z * z / (2 * of)) / (1 + z * z / of),
        z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of)) / (1 + z * z / of),
    )
    return max(0.0, middle - half), min(1.0, middle + half)


def poisson_interval(count: int) -> tuple[float, float]:
    """95 % interval of a count (Garwood)."""
    low = 0.0 if count == 0 else float(chi2.ppf(0.025, 2 * count)) / 2.0
    return low, float(chi2.ppf(0.975, 2 * count + 2)) / 2.0


# The NIST recordings.

TRAINING = ("13", "14")
HOLE_S = 600.0


def training_streams() -> list[Stream]:
    """All program executions of the plates that are learned from, as `cnctwin import` gives them."""
    streams = []
    for number in TRAINING:
        path = DATA / "nist" / "plate" / f"Plate-Hurco04-{number}of20.txt"
        for run in program_runs(read_observations(path.read_text(), path.name)):
            streams += streams_of_run(run_log(run.columns, path.name), path.name, "spindle_rpm", PERIOD_S, ())
    return streams


def judged() -> Iterator[tuple[str, list[Stream]]]:
    """Part and streams of every other recording, from its first line to its last, but for holes of more than ten minutes."""
    for path in sorted((DATA / "nist").glob("*/*-Hurco*.txt")):
        if not any(f"Hurco04-{number}of20" in path.name and path.parent.name == "plate" for number in TRAINING):
            yield path.parent.name, list(whole_recording(path))


def whole_recording(path: Path) -> Iterator[Stream]:
    """A recording as a live machine would tell it."""
    rows = read_observations(path.read_text(), path.name).rows
    t_s = np.array([row.t_s for row in rows])

    def column(key: str) -> Floats:
        return np.array([float(row.value) if row.key == key else np.nan for row in rows])

    speed, feed, block, tool = map(column, ("Spindle_Speed", "Feed_Rate", "Block_Number", "Current_Tool"))
    cuts = np.flatnonzero(np.diff(t_s) > HOLE_S) + 1
    for first, last in zip([0, *cuts], [*cuts, len(rows)], strict=True):
        grid_s = np.arange(np.ceil(t_s[first] / PERIOD_S), np.floor(t_s[last - 1] / PERIOD_S) + 1.0) * PERIOD_S
        if len(grid_s) < 2:
            continue
        values = np.nan_to_num(held(t_s, speed, grid_s))  # before it is told for the first time, it stands
        changes = t_s[first:last][tool[first:last] == 0.0]
        yield Stream(
            PERIOD_S, float(grid_s[0]), values, resting(60.0 * held(t_s, feed, grid_s)), standing(held(t_s, block, grid_s)),
            tuple(changes.tolist()), path.name,
        )  # fmt: skip


def stops_and_restarts(stream: Stream) -> list[tuple[float, float]]:
    """The naive detector: every time that the spindle stops and starts again."""
    events, stopped_s = [], None
    turns = np.abs(stream.values) >= 10.0
    for n in np.flatnonzero(turns[1:] != turns[:-1]) + 1:
        at_s = stream.begin_s + n * stream.period_s
        if not turns[n]:
            stopped_s = at_s
        elif stopped_s is not None:
            events.append((stopped_s, at_s))
            stopped_s = None
    return events


@dataclass
class Tally:
    """Labels, those found, false events."""

    labels: int = 0
    found: int = 0
    false: int = 0

    def add(self, events: Sequence[tuple[float, float]], labels: Sequence[float], slack_s: float) -> None:
        """Each label is found by one event at most, each event finds one label at most."""
        taken: set[float] = set()
        for begun_s, ended_s in events:
            free = [at for at in labels if begun_s - slack_s <= at <= ended_s + slack_s and at not in taken]
            if free:
                taken.add(min(free, key=lambda at, end=ended_s: abs(end - at)))
            else:
                self.false += 1
        self.labels, self.found = self.labels + len(labels), self.found + len(taken)

    def row(self) -> dict[str, Any]:
        """Recall and precision with their intervals."""
        events = self.found + self.false
        return {
            "labels": self.labels, "found": self.found, "false": self.false,
            "recall": (self.found / max(self.labels, 1), *wilson(self.found, self.labels)),
            "precision": (self.found / max(events, 1), *wilson(self.found, events)),
        }  # fmt: skip


def nist() -> dict[str, Any]:
    """Recall and precision by part, detector and slack; onsets and how the gate stood at the label."""
    done = trained(training_streams(), TrainingSettings("spindle_rpm"), np.random.default_rng(0))
    alone = replace(done.detector, weighing=None)
    tallies: dict[str, Tally] = {}
    begun, opened, confirmed, at_label, hours = [], [], [], [], 0.0
    for part, streams in judged():
        for stream in streams:
            hours += stream.hours
            outcome, outcome_alone = replayed(done.detector, stream), replayed(alone, stream)
            events = {
                "with feed and block": [(one.begun_s, one.last_s) for one in outcome.confirmed],
                "speed alone": [(one.begun_s, one.last_s) for one in outcome_alone.confirmed],
                "speed alone, any score": [
                    (one.begun_s, one.last_s) for one in replayed(alone.with_score(0.0), stream).confirmed
                ],
                "stop and restart": stops_and_restarts(stream),
            }
            for name, some in events.items():
                for slack_s in (5.0, 30.0):
                    for where in (part, "all"):
                        tallies.setdefault(f"{name}, {where}, {slack_s:g} s", Tally()).add(some, stream.changes_s, slack_s)
            for at_s in stream.changes_s:
                at_label.append(bool(outcome.active[min(stream.index(at_s), len(outcome.active) - 1)]))
                near = [one for one in outcome.confirmed if one.begun_s - 30.0 <= at_s <= one.last_s + 30.0]
                if near:
                    one = min(near, key=lambda one, at=at_s: abs(one.last_s - at))
                    begun.append(one.begun_s - at_s)
                    confirmed.append(one.last_s - at_s)
                    opened += [] if one.opened_s is None else [one.opened_s - at_s]
    return {
        "trained_on": f"{done.confirmed} of {done.changes} changes of its own training confirmed",
        "hours": hours,
        "rows": {name: tally.row() for name, tally in sorted(tallies.items())},
        "gate_open_at_label": float(np.mean(at_label)),
        "seconds_after_label": {
            name: [round(float(value), 1) for value in np.quantile(some, [0.05, 0.5, 0.95])]
            for name, some in (("pattern begins", begun), ("provisional gate", opened), ("last confirmed", confirmed))
        },
    }


def main() -> None:
    """Run what is asked for, or all of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", choices=["cost", "grid", "nist"], default=[])
    parser.add_argument("--hours", type=float, default=48.0, help="of null for each seed and SNR; half of it again to train on")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    what = options.what or ["cost", "grid", "nist"]
    figures: dict[str, Any] = {}
    if "cost" in what:
        figures["cost"] = cost()
    if "grid" in what:
        figures["grid"] = grid(options.hours, options.seeds)
    if "nist" in what:
        figures["nist"] = nist()
    if options.json:
        print(json.dumps(figures))
        return
    for name, found in figures.items():
        print(f"# {name}")
        show(found)


def show(found: Any) -> None:
    """Figures as lines."""
    if isinstance(found, list):
        for row in found:
            cells = ", ".join(f"{cell} {p:.3f} [{low:.3f}, {high:.3f}]" for cell, (p, low, high) in row["recall"].items())
            per_day, low, high = row["false_per_day"]
            stated = "; ".join(f"{p:.2g} [{a:.2g}, {b:.2g}]" for p, a, b in row["stated"])
            provisional = row["provisional_per_day"]
            print(f"{row['snr_db']:g} dB: recall {cells}")
            hours = row["null_hours"]
            print(f"   false gates a day {per_day:.2f} [{low:.2f}, {high:.2f}] in {hours:g} h; stated by training {stated}")
            print(f"   provisional gates {provisional:.0f} a day")
        return
    for name, value in found.items():
        if name == "rows":
            for title, row in value.items():
                shares = ", ".join("{} {:.3f} [{:.3f}, {:.3f}]".format(key, *row[key]) for key in ("recall", "precision"))
                print(f"{title:36s} {row['found']:3d} of {row['labels']:3d}, {row['false']:3d} false: {shares}")
        else:
            print(f"{name}: {value:.3f}" if isinstance(value, float) else f"{name}: {value}")


if __name__ == "__main__":
    main()
