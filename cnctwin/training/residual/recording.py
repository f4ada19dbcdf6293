"""The data that a residual is learned from: run logs of a machine, or a stretch of the store, a second apart."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Column, Query, Store
from twin.errors import RunLogError
from twin.residual.physics import Physics
from twin.residual.recorded_run import RECORDED, Samples, joined, recorded_of, recorded_run
from twin.residual.table import Recorded
from twin.runlog import read_run

TICK_S = 1.0
APART_S = 3600.0
"""Between two run logs, of which nobody says how far they are apart."""
ASKED_MS = 6 * 3_600_000
"""The stretch of the store that is read at a time."""
Say = Callable[[str], None]


def from_files(paths: Sequence[Path], physics: Physics, say: Say) -> Recorded:
    """The run logs, in the order of time. Raises UsageError where one cannot be read, ResidualError where it lacks a signal."""
    parts = []
    for number, path in enumerate(paths, start=1):
        say(f"run log {number} of {len(paths)}")
        try:
            parts.append(recorded_run(read_run(path), physics, TICK_S))
        except RunLogError as error:
            raise UsageError(str(error)) from None
    return joined(parts, APART_S)


def from_store(store: Store, machine: str, stretch: tuple[int | None, int | None], physics: Physics, say: Say) -> Recorded:
    """A stretch (from, to; ms since 1970, None = all there is) of the store. Raises UsageError, StoreError, ResidualError."""
    series = [one for one in store.series(machine) if one.signal in RECORDED]
    if not series:
        known = ", ".join(store.machines()) or "none"
        raise UsageError(
            f"--machine {machine}: the store has no signal of it that a residual could be learned from; it has: {known}"
        )
    from_ms = min(one.first_us for one in series) // 1000 if stretch[0] is None else stretch[0]
    to_ms = max(one.last_us for one in series) // 1000 + 1 if stretch[1] is None else stretch[1]
    if to_ms <= from_ms:
        raise UsageError(f"--to {to_ms} is not after --from {from_ms} (ms since 1970); give a stretch of time")
    names = tuple(name for name in RECORDED if any(one.signal == name for one in series))
    pieces: dict[str, list[Samples]] = {name: [] for name in names}
    for begins in range(from_ms, to_ms, ASKED_MS):
        say(f"reading the store: {100 * (begins - from_ms) // (to_ms - from_ms)} %")
        ends = min(begins + ASKED_MS, to_ms)
        for column in store.query(Query(machine, names, begins, ends, every_ms=round(TICK_S * 1000))):
            pieces[column.signal].append(samples_of(column))
    told = {name: Samples(*(np.concatenate(values) for values in zip(*own, strict=True))) for name, own in pieces.items()}
    return recorded_of({name: one for name, one in told.items() if len(one.t_s)}, physics, TICK_S, f"{machine} in the store")


def samples_of(column: Column) -> Samples:
    """A column of windows as samples in their middle; NaN where a window has no good number."""
    values = [float(value) if isinstance(value, (int, float)) else np.nan for value in column.value]
    return Samples(np.array(column.t_us, dtype=np.float64) / 1e6 + 0.5 * TICK_S, np.array(values, dtype=np.float64))
