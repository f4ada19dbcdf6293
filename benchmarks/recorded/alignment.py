#!/usr/bin/env python3
"""The place in an operation without a line number: how far off, by distance, by programmed seconds, and put right by the signals.

    PYTHONPATH=. .venv/bin/python benchmarks/recorded/alignment.py

Recorded parts of one text, two by two: the second is followed as on the stream, without its lines, after the first has taught the
course. The truth is the line, which the method is not given: the place of that line in the first part. Ticks in a gate or a
standstill are left out. `untold`: the feed override is kept from the method as well.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.programs.plates import data_folder
from benchmarks.recorded.parts import TICK_S, Floats, Part, by_text, nist_parts, operations
from benchmarks.recorded.replaying import recorded, taught
from twin.anomaly.parts import alignment
from twin.anomaly.parts.following import told_after
from twin.anomaly.parts.judging import judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import begun

TICKS_MIN = 40
FAR_S = 5.0


class Apart(NamedTuple):
    """Mean error in s of the place, by distance, by seconds, and put right; share of ticks that are far off then."""

    by_distance_s: float
    by_seconds_s: float
    aligned_s: float
    far: float


def followed(model: PartsModel, first: Part, second: Part) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the progress in its operation at each tick of a part that follows another, and whether the tick told of anything."""
    one, spans = recorded([first, second], None)
    own, progress, works = begun(model), np.zeros(len(one.values)), np.zeros(len(one.values), dtype=np.bool_)
    for tick, told in enumerate(one.told()):
        if told is not None:
            own = told_after(model, own, told)
            own, _ = learned(model, own, judged(model, own, ()), is_alarm=False)
            progress[tick], works[tick] = own.place.moved_mm, not own.is_idle
    span = spans[1]
    return progress[span.begin : span.end], works[span.begin : span.end]


def pair(model: PartsModel, first: Part, second: Part) -> Iterator[Apart]:
    """Yield how far off the place is in each operation that two parts have."""
    bare = first.without_lines(), second.without_lines()
    right, works = followed(model, *bare)
    with patch.object(alignment, "STAY", np.inf):
        plain, _ = followed(model, *bare)
        usual, _ = followed(model, bare[0], bare[0])
    before = dict(operations(first))
    for name, ticks in operations(second):
        if name not in before or min(len(ticks), len(before[name])) < TICKS_MIN:
            continue
        here, there = ticks[works[ticks]], before[name]
        there = there[first.feed[there] >= 1.0]
        if min(len(here), len(there)) < TICKS_MIN:
            continue
        true = _place_of_lines(first.line[there], usual[there], second.line[here])
        run, ran = (np.cumsum(part.feed[at]) * TICK_S / 60.0 for part, at in ((second, here), (first, there)))
        errors = [np.abs(found - true) for found in (np.interp(run, ran, usual[there]), plain[here], right[here])]
        distance, seconds, aligned = (float(one.mean()) for one in errors)
        yield Apart(distance, seconds, aligned, float((errors[2] > FAR_S).mean()))


def _place_of_lines(usual: NDArray[np.int64], progress: Floats, lines: NDArray[np.int64]) -> Floats:
    """Return the progress at which each line stood in the first part; within a line, by the share of its ticks so far."""
    usual, lines = np.maximum.accumulate(usual), np.maximum.accumulate(lines)
    first, last = (np.searchsorted(usual, lines, side=side) for side in ("left", "right"))
    begin, end = (np.searchsorted(lines, lines, side=side) for side in ("left", "right"))
    at = first + (last - first) * (np.arange(len(lines)) - begin) / (end - begin)
    return np.interp(at, np.arange(len(progress)), progress)


def table(model: PartsModel, parts: Sequence[Part], *, is_untold: bool = False) -> tuple[Apart, int] | None:
    """Return the mean over all pairs of parts and operations, and how many there are."""
    nothing = [replace(one, feed_override_pct=np.full(one.ticks, np.nan)) if is_untold else one for one in parts]
    found = [row for first in nothing for second in nothing if first is not second for row in pair(model, first, second)]
    return (Apart(*np.mean(found, axis=0).tolist()), len(found)) if found else None


def main() -> None:
    """Print the table."""
    folder = data_folder()
    groups = {name: nist_parts(folder, name) for name in ("plate", "cover", "box")}
    for name in ("cover", "box"):
        others = [part.labelled(part.text).without_lines() for group, parts in groups.items() if group != name for part in parts]
        model = taught(sorted(others, key=lambda part: part.started_s), None)
        for text, parts in by_text(groups[name]).items():
            for is_untold in (False, True):
                row = table(model, parts, is_untold=is_untold) if len(parts) > 1 else None
                if row is not None:
                    one, count = row
                    ways = f"{one.by_distance_s:5.1f} s by distance, {one.by_seconds_s:4.1f} s by programmed seconds"
                    far = f"{one.aligned_s:4.1f} s put right ({one.far:.0%} of ticks more than {FAR_S:g} s)"
                    print(f"{text:24} {'untold' if is_untold else 'told':6} {count:3} operations: off by {ways}, {far}")


if __name__ == "__main__":
    main()
