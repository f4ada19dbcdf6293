"""`cnctwin train detector`: learn what a tool change looks like in the drive's signal, and how often chance looks like it."""

import csv
import json
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from cnctwin.errors import UsageError
from cnctwin.training.detector.change_points import Candidate, candidates_of
from cnctwin.training.detector.recorded_streams import streams_of
from twin.transient.artefact import save_detector
from twin.transient.errors import TransientError
from twin.transient.level import SIGNALS
from twin.transient.training import Trained, TrainingSettings, trained

PERIOD_S_MIN = 0.01


def train_detector(  # noqa: PLR0917 - the options of the command
    runs: Sequence[Path],
    asked: TrainingSettings,
    out: Path | None,
    at_s: Sequence[float],
    candidates: Path | None,
    period_s: float,
    seed: int,
    as_json: bool,
    console: Console,
) -> None:
    """Train, and write the model into `out`; with `candidates`, list transients for a person to label instead."""
    if asked.signal not in SIGNALS:
        raise UsageError(f"--signal {asked.signal}: it is one of {', '.join(SIGNALS)}")
    if period_s < PERIOD_S_MIN:
        raise UsageError(f"--period {period_s:g}: transients take seconds; {PERIOD_S_MIN:g} s is the finest")
    if (out is None) == (candidates is None):
        raise UsageError("say --out DIR for a model, or --candidates FILE for a list of transients to label")
    streams = streams_of(runs, asked.signal, period_s, at_s)
    if candidates is not None:
        listed = candidates_of(streams, asked.signal)
        _write_candidates(listed, candidates)
        _say(as_json, console, {"candidates": [asdict(one) for one in listed], "out": str(candidates)}, [
            f"{len(listed)} candidates in {candidates}, the deepest first; give those that are tool changes as --at"
        ])  # fmt: skip
        return
    assert out is not None
    try:
        done = trained(streams, asked, np.random.default_rng(seed))
        versions = {"python": platform.python_version(), "numpy": np.__version__}
        save_detector(out, done, tuple(str(path) for path in runs), versions, asked.false_gates_per_day)
    except TransientError as error:
        raise UsageError(str(error)) from None
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from None
    _say(as_json, console, summary_of(done) | {"out": str(out)}, [*sentences_of(done, asked), f"the model is in {out}"])


def summary_of(done: Trained) -> dict[str, Any]:
    """All figures, for a program to read."""
    detector = done.detector
    return {
        "signal": detector.signal,
        "period_s": detector.template.period_s,
        "seconds": detector.template.seconds,
        "changes": done.changes,
        "captured": list(done.captured),
        "not_found": list(done.not_found),
        "confirmed": done.confirmed,
        "limits": asdict(detector.limits),
        "weighing": None if detector.weighing is None else asdict(detector.weighing),
        "asked_score": done.asked_score,
        "false_gates": asdict(done.rate),
        "provisional_per_day": done.provisional_per_day,
        "provisional_s_per_day": done.provisional_s_per_day,
        "weighed_peaks": done.weighed_peaks,
        "copies_found": done.copies_found,
    }


def sentences_of(done: Trained, asked: TrainingSettings) -> list[str]:
    """Return what a person should know before it is used."""
    detector, rate = done.detector, done.rate
    said = [
        f"learned from {len(done.captured)} of {done.changes} changes: {detector.template.seconds:.1f} s long, stretched by "
        f"{min(detector.template.stretches):g} to {max(detector.template.stretches):g}, stalled by up to "
        f"{detector.template.stall_s:g} s",
        f"confirms {done.confirmed} of the {done.changes} changes it was learned from, and by the signal alone "
        f"{100.0 * done.copies_found:.0f} % of copies that were stretched and stalled",
        f"threshold {detector.limits.pattern_score:.3f}: {_rate(done)}",
    ]
    if done.asked_score is None:
        said.append(f"too little null to find the threshold for {asked.false_gates_per_day:g} false gates a day: record more")
    elif done.asked_score > detector.limits.pattern_score:
        said.append(
            f"{asked.false_gates_per_day:g} false gates a day would need {done.asked_score:.3f}: captured changes do not reach it"
        )
    said.append(_held_back(done))
    if detector.weighing is not None:
        said.append(
            "feed and block are weighed where they are reported: "
            f"{done.weighed_peaks} false gates in {rate.null_hours:.2f} h of null"
        )
    return said


def _held_back(done: Trained) -> str:
    """Return what opening on the beginning of a pattern costs: how often and for how long scores are held back for nothing."""
    if not done.provisional_per_day:
        return "in these runs it never takes anything else for the beginning of a tool change"
    often, minutes = done.provisional_per_day, done.provisional_s_per_day / 60.0
    return (
        f"takes something else for the beginning of a tool change about {often:.0f} times a day, and lets go by itself: "
        f"scores are held back for {minutes:.0f} min a day ({minutes / 14.4:.1f} %) in which no tool changes; "
        "opens_early = false avoids that, and judges the first seconds of true changes"
    )


def _rate(done: Trained) -> str:
    rate = done.rate
    how = "extrapolated" if rate.is_extrapolated else "counted"
    return (
        f"{rate.per_day:.2g} false gates a day by the signal alone (90 % interval {rate.low:.2g} to {rate.high:.2g}), {how} from "
        f"{rate.peaks} peaks in {rate.null_hours:.2f} h of null"
    )


def _write_candidates(listed: Sequence[Candidate], path: Path) -> None:
    try:
        if path.suffix == ".json":
            path.write_text(json.dumps([asdict(one) for one in listed], indent=2) + "\n", encoding="utf-8")
            return
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([field.name for field in fields(Candidate)])
            writer.writerows(list(asdict(one).values()) for one in listed)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


def _say(as_json: bool, console: Console, figures: dict[str, Any], sentences: Sequence[str]) -> None:
    if as_json:
        sys.stdout.write(json.dumps(figures) + "\n")
        return
    for sentence in sentences:
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
