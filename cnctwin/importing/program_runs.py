"""From a recording in the `time|key|value` text of the NIST test bed to run logs, one for each program execution in it."""

import re
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from cnctwin.errors import UsageError
from cnctwin.files.output import check_suffix, write
from cnctwin.files.program_text import read_text
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs
from twin.runlog import run_log, write_run

OBSERVATION = re.compile(rb"(?m)^\d{4}-\d\d-\d\dT[^|\r\n]{0,40}\|[^|\r\n]+\|")


def is_observations(recording: Path) -> bool:
    """Return True for a file with `time|key|value` lines; one that cannot be read is none."""
    try:
        with recording.open("rb") as file:
            return OBSERVATION.search(file.read(4096)) is not None
    except OSError:
        return False


def import_program_runs(recordings: Sequence[Path], out: Path, console: Console) -> None:
    """Write the run logs of a recording in one file or several, and say what is in them. Raises UsageError."""
    check_suffix(out)
    recording = recordings[0] if len(recordings) == 1 else Path(", ".join(path.name for path in recordings))
    observations = read_observations("\n".join(map(read_text, recordings)), str(recording))
    runs = program_runs(observations)
    if not runs:
        raise UsageError(f"{recording}: no program execution in it; a run begins where Program_Status becomes ACTIVE")
    table = Table(title=f"{len(runs)} program executions in {recording.name}", title_justify="left")
    for column in ("file", "lasted", "active", "ended", "pauses"):
        table.add_column(column)
    for number, run in enumerate(runs, start=1):
        path = out if len(runs) == 1 else out.with_stem(f"{out.stem}-{number}")
        log = run_log(run.columns, str(recording))
        write(lambda log=log, path=path: write_run(log, path), path)  # type: ignore[misc]
        pauses = ", ".join(f"{p.end_s - p.start_s:.0f} s ({p.reason})" for p in run.pauses) or "none"
        table.add_row(str(path), f"{log.t_s[-1]:.0f} s", f"{run.active_s:.0f} s", run.ending.value, pauses)
    console.print(table)
    taken = f"{len(observations.rows)} observations taken, {observations.dropped} lines dropped: cut off, or without a value"
    console.print(taken, markup=False, highlight=False, soft_wrap=True)
