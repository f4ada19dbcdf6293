"""Tool changes of a real machine in the raw score, and what the gate makes of them: the Okuma recording, 11 labelled changes.

    .venv/bin/python benchmarks/recorded/tool_changes.py okuma.txt okuma_devices.xml

Each stretch is scored by a forest that learned on the others, outside of tool changes (22 minutes in all: enough to see
transients, far too few for a rate of false alarms). The threshold is the largest score of what was learned, dwell a second. A
fault is planted in the middle of a change: from then on the spindle drags, its load 100 points higher; the forest has then
learned from the sound stretch too, since in two of the three the spindle's load never changes.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.evaluation.range_based import Range, ranges
from cnctwin.importing.shdr import recorded_runs
from cnctwin.training.anomaly.held_rows import held_rows
from twin.anomaly.alarm import AlarmRule, dwell_score, is_alarm, onsets
from twin.anomaly.detector import Detector, trained_model
from twin.anomaly.gate import gate, held
from twin.anomaly.model import AnomalyModel

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "axis_x_load_pct", "axis_y_load_pct", "axis_z_load_pct")
LOAD = FEATURES.index("spindle_load_pct")
TICK_S, TAIL_S, LOOK_BACK_S, DWELL = 1.0, 8.0, 0.0, 1
AFTER_S = 30.0
"""An alert so soon after a change is called its own: loads of up to 176 % come 11 and 26 s after one."""


@dataclass(frozen=True)
class Stretch:
    """Features as last reported at each tick, and whether a tool change is going on."""

    rows: Floats
    active: Flags
    tail_s: float = TAIL_S

    @property
    def shut(self) -> Flags:
        """The stretches in which scores are gated."""
        return gate(self.active, TICK_S, self.tail_s, LOOK_BACK_S)

    @property
    def changes(self) -> list[Range]:
        """Tool changes, in ticks."""
        return ranges(self.active.tolist())


@dataclass(frozen=True)
class Seen:
    """raw: score of each tick; threshold; alerts: ticks with the gate and without"""

    stretch: Stretch
    raw: Floats
    threshold: float
    gated_alerts: Sequence[int]
    open_alerts: Sequence[int]

    def of_changes(self, alerts: Sequence[int]) -> int:
        """Changes that an alert belongs to: in one, or soon after."""
        return sum(any(one.start <= tick < one.end + AFTER_S for tick in alerts) for one in self.stretch.changes)


def stretches(recording: Path, devices: Path) -> list[Stretch]:
    """The stretches of a recording that are longer than a minute."""
    found = []
    for run in recorded_runs(recording, devices):
        _, rows = held_rows(run, (*FEATURES, "tool_change_active"), 1000, 600_000)
        known = np.isfinite(rows[:, : len(FEATURES)]).all(axis=1)
        if known.sum() > 60:
            first = int(np.argmax(known))
            found.append(Stretch(rows[first:, : len(FEATURES)], held(rows[first:, -1])))
    return found


def taught(others: Sequence[Stretch]) -> tuple[AnomalyModel, AlarmRule]:
    """The model that these stretches teach, and the rule by which none of them is an alert."""
    model = trained_model(Detector(), np.concatenate([one.rows[~one.shut] for one in others]), FEATURES)
    threshold = max(float(dwell_score(model.scores(one.rows), one.shut, DWELL).max()) for one in others)
    return model, AlarmRule(max(threshold, 1e-6) * 1.0001, DWELL)


def seen(stretch: Stretch, model: AnomalyModel, rule: AlarmRule) -> Seen:
    """One stretch, as the model scores it."""
    raw = model.scores(stretch.rows)
    alerts = [onsets(is_alarm(rule, raw, shut)).tolist() for shut in (stretch.shut, np.zeros(len(raw), dtype=np.bool_))]
    return Seen(stretch, raw, rule.threshold, *alerts)


def each_by_the_others(recorded: Sequence[Stretch]) -> list[Seen]:
    """Each stretch, scored by what the others taught."""
    return [seen(one, *taught([*recorded[:number], *recorded[number + 1 :]])) for number, one in enumerate(recorded)]


def with_fault(stretch: Stretch, from_tick: int, points: float = 100.0) -> Stretch:
    """The stretch with a spindle that drags from a tick on."""
    rows = stretch.rows.copy()
    rows[from_tick:, LOAD] += points
    return replace(stretch, rows=rows)


def first_clean(stretch: Stretch, change: Range) -> int:
    """The first tick after a change that is judged."""
    return change.end + int(np.argmin(stretch.shut[change.end :]))


def main() -> None:
    """Prints what was seen."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("recording", type=Path)
    asked.add_argument("devices", type=Path)
    given = asked.parse_args()
    recorded = stretches(given.recording, given.devices)
    by_all = taught(recorded)
    for number, (stretch, found) in enumerate(zip(recorded, each_by_the_others(recorded), strict=True)):
        quiet = found.raw[~stretch.shut]
        peaks = [float(found.raw[one.start : one.end + int(TAIL_S)].max()) for one in stretch.changes]
        gated, opened = found.gated_alerts, found.open_alerts
        print(
            f"stretch {number}: {len(found.raw)} s, {len(stretch.changes)} changes, threshold {found.threshold:.3f}; changes "
            f"with an alert: {found.of_changes(gated)} gated, {found.of_changes(opened)} not; alerts in all {len(gated)} gated, "
            f"{len(opened)} not; raw in changes {np.round(peaks, 2).tolist()}, median outside {np.median(quiet):.2f}"
        )
        for one in stretch.changes:
            faulty = seen(with_fault(stretch, (one.start + one.end) // 2), *by_all)
            clean = first_clean(stretch, one)
            first = next((tick for tick in faulty.gated_alerts if tick >= one.start), None)
            print(f"  fault from the middle of the change at {one.start} s: first clean tick {clean}, alert at {first}")


if __name__ == "__main__":
    main()
