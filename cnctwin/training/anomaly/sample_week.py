"""A sample week to train from: simulated machines in production, as run logs, healthy and of the same make.

Each is the simulated machine with its programs, shifts, batches, tool lives and idle time (`cnctwin.standins.production`); a seed
makes one machine's week another than the next one's.
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from cnctwin.standins.production.day import Production
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from twin.runlog import write_run

BEGINS = datetime(2026, 3, 2, tzinfo=UTC)
"""A Monday."""
HOURS_A_DAY = 24.0
MACHINES_MAX = 100


class SampleWeek(NamedTuple):
    """One machine's week: where it is, and how many rows it has."""

    machine: str
    file: Path
    rows: int


def sample_weeks(folder: Path, machines: int, days: int, seed: int) -> Iterator[SampleWeek]:
    """Write the recordings of some machines, `vmc1.parquet` and so on, and yield each. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    built = machine_as_built(None)
    for number in range(1, machines + 1):
        log = Production(built, seed=MACHINES_MAX * seed + number).day(BEGINS.timestamp(), HOURS_A_DAY * days).run_log()
        file = folder / f"vmc{number}.parquet"
        write_run(log, file)
        yield SampleWeek(f"vmc{number}", file, len(log))
