"""The first part of a cell's recorded time, and the rest."""

import numpy as np

from cnctwin.errors import UsageError
from cnctwin.training.anomaly.recorded_cell import RecordedCell, Stretch, part, span_s


def split(cell: RecordedCell, share: float) -> tuple[tuple[Stretch, ...], tuple[Stretch, ...]]:
    """The stretches before and after this share of all recorded time."""
    spans = [span_s(stretch) for stretch in cell.stretches]
    left_s = share * sum(end - start for start, end in spans)
    before: list[Stretch] = []
    after: list[Stretch] = []
    for stretch, (start, end) in zip(cell.stretches, spans, strict=True):
        cut_s = np.inf if left_s >= end - start else start + max(left_s, 0.0)
        left_s -= end - start
        for parts, from_s, to_s in ((before, start, cut_s), (after, cut_s, np.inf)):
            runs = {name: part(run, from_s, to_s) for name, run in stretch.items()}
            kept = {name: run for name, run in runs.items() if run is not None and len(run) > 1}
            if kept and to_s > from_s:
                parts.append(kept)
    for name in cell.machines:
        for parts, what in ((before, "train"), (after, "calibrate")):
            if not any(name in stretch for stretch in parts):
                raise UsageError(f"{name}: nothing is left to {what} on: record more, or choose another --train-share")
    return tuple(before), tuple(after)
