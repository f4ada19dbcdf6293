"""`cnctwin simulate`, `cnctwin identify` and `cnctwin import`: the twin from the command line."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from cnctwin.errors import UsageError
from cnctwin.files.program_text import decoded
from twin.case import read_case
from twin.errors import EffectError, ProgramError
from twin.gap.free_run import GapRow
from twin.identification import identify as identification
from twin.identification import paper
from twin.identification.identify import Identification
from twin.machine import machine_to_toml, read_machine
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs
from twin.runlog import run_log, write_run
from twin.simulator.response import check_effects
from twin.simulator.simulation import Simulation
from twin.simulator.simulation import simulate as simulated


def read_text(path: Path) -> str:
    """The text of a file that the user named; what is not UTF-8 is read as Latin-1, as controls write it."""
    return read_encoded(path)[0]


def read_encoded(path: Path) -> tuple[str, str]:
    """The text of a file, and the encoding in which it is written again byte for byte. Raises UsageError."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    return decoded(raw)


def check_suffix(out: Path | None) -> None:
    """Raises UsageError where a run log would be written into a file of another kind."""
    if out is not None and out.suffix not in (".parquet", ".csv"):
        raise UsageError(f"{out}: a run log is written as .parquet or .csv, by the ending of its name")


def simulate(program: Path, machine: Path, out: Path | None, *, seed: int | None, as_json: bool, console: Console) -> None:
    """Run a program on a machine, write what it records, and print time, peak force and following error."""
    described = read_machine(machine)
    try:
        check_effects(described)
    except EffectError as error:
        raise UsageError(f"{machine}: {error}") from None
    check_suffix(out)
    text = read_text(program)
    with working("simulating"):
        try:
            done = simulated(described, text, seed=seed, name=program.name)
        except ProgramError as error:
            raise UsageError(f"{program}: {error}") from None
        if out is not None:
            write(lambda: write_run(done.run, out), out)
    summary = summary_of(done)
    if as_json:
        sys.stdout.write(json.dumps(summary | {"notes": done.notes, "out": None if out is None else str(out)}) + "\n")
        return
    console.print(simulation_table(program.name, described.machine.name, summary))
    for note in done.notes:
        console.print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"{len(done.run)} samples in {out}", markup=False, highlight=False, soft_wrap=True)


def summary_of(done: Simulation) -> dict[str, Any]:
    """The figures of a simulation: time, force, load, and of each axis following error and torque, rms and peak."""

    def figures(values: Any) -> dict[str, float]:
        return {"rms": float(np.sqrt(np.nanmean(values**2))), "peak": float(np.nanmax(np.abs(values)))}

    run = done.run
    axes = {
        axis: {"following_error_mm": figures(error), "torque_a": figures(run[f"{axis}_torque_a"])}
        for axis, error in done.following_error_mm().items()
    }
    summary: dict[str, Any] = {"seconds": done.seconds, "axes": axes}
    if "force_x_n" in run.columns:
        cutting = run["axial_depth_mm"] > 0.0
        resultant = np.hypot(run["force_x_n"], run["force_y_n"])[cutting]
        summary["cutting_force_n"] = {"rms": figures(resultant)["rms"], "peak": float(run["cutting_force_peak_n"].max())}
    for name in ("spindle_load_pct", "spindle_temp_c"):
        if name in run.columns:
            summary[name] = {"peak": float(np.nanmax(run[name]))}
    return summary


def simulation_table(program: str, machine: str, summary: dict[str, Any]) -> Table:
    """Root mean square and peak of each signal, in the manner of the reference paper's table of simulation results."""
    table = Table(title=f"{program} on {machine}: {summary['seconds']:.2f} s", title_justify="left")
    for column in ("", "unit", "rms", "peak"):
        table.add_column(column, justify="left" if column in ("", "unit") else "right")
    for axis, signals in summary["axes"].items():
        error, torque = signals["following_error_mm"], signals["torque_a"]
        table.add_row(f"following error {axis.upper()}", "µm", f"{1000 * error['rms']:.1f}", f"{1000 * error['peak']:.1f}")
        table.add_row(f"torque command {axis.upper()}", "A", f"{torque['rms']:.3f}", f"{torque['peak']:.3f}")
    if force := summary.get("cutting_force_n"):
        table.add_row("cutting force, while cutting", "N", f"{force['rms']:.1f}", f"{force['peak']:.1f}")
    if load := summary.get("spindle_load_pct"):
        table.add_row("spindle load", "%", "", f"{load['peak']:.1f}")
    if heat := summary.get("spindle_temp_c"):
        table.add_row("spindle temperature", "°C", "", f"{heat['peak']:.1f}")
    return table


def identify(case: Path, out: Path | None, *, free_gains: bool, as_json: bool, console: Console) -> int:
    """Fit the machine of a case to its recordings, write it, and say what is known and what is not.

    The exit code: 1 where nothing could be identified, or the identified machine does not fit what was recorded.
    """
    question = read_case(case)
    with working("identifying") as say:
        found = identification.identify(question, free_gains=free_gains, progress=lambda what: say(f"identifying: {what}"))
    code = 0 if found.estimates and not found.misfits else 1
    if out is not None:
        write(lambda: out.write_text(machine_to_toml(found.machine), encoding="utf-8"), out)
    if as_json:
        sys.stdout.write(json.dumps(identification_json(found) | {"out": None if out is None else str(out)}) + "\n")
        return code
    console.print(estimates_table(found))
    for title, sentences in (
        ("does not fit", found.misfits),
        ("found", found.notes),
        ("not to be known from these recordings", found.unknown),
    ):
        if sentences:
            console.print(f"\n[bold]{title}[/]")
        for sentence in sentences:
            console.print(f"  {sentence}", markup=False, highlight=False, soft_wrap=True)
    console.print()
    console.print(gap_table(found.gaps))
    if out is not None:
        console.print(f"the identified machine is in {out}", markup=False, highlight=False, soft_wrap=True)
    return code


def identification_json(found: Identification) -> dict[str, Any]:
    """Everything, for a program to read."""
    return {
        "estimates": [asdict(e) | {"identifiable": e.identifiable} for e in found.estimates],
        "misfits": found.misfits,
        "unknown": found.unknown,
        "notes": found.notes,
        "gaps": [asdict(row) | {"ratio": row.ratio} for row in found.gaps],
    }


def estimates_table(found: Identification) -> Table:
    """Each constant with its interval beside what was stated."""
    table = Table(title=f"{len(found.estimates)} constants of {found.machine.machine.name}", title_justify="left")
    for column in ("constant", "stated", "identified", "95 % interval", "unit", "known by"):
        justify: Literal["left", "right"] = "right" if column in ("stated", "identified", "95 % interval") else "left"
        table.add_column(column, justify=justify, overflow="fold", min_width=26 if column == "constant" else None)
    for e in found.estimates:
        interval = f"{e.low:.5g} … {e.high:.5g}"
        source = "the recordings" if e.identifiable else "what was stated"
        table.add_row(e.path, "–" if e.stated is None else f"{e.stated:.4g}", f"{e.value:.5g}", interval, e.unit, source)
    return table


def gap_table(rows: tuple[GapRow, ...]) -> Table:
    """Twin against recording by run, signal and regime."""
    table = Table(title="twin minus recording, rms, on the runs to be judged on", title_justify="left")
    for column in ("run", "signal", "regime", "gap", "repeatability", "ratio", "expected"):
        table.add_column(column, justify="left" if column in ("run", "signal", "regime") else "right")
    for row in rows:
        repeated = (
            ("–", "–") if row.repeatability is None or row.ratio is None else (f"{row.repeatability:.3g}", f"{row.ratio:.2f}")
        )
        table.add_row(row.run, row.signal, row.regime, f"{row.gap:.3g}", *repeated, f"{row.expected:.3g}")
    return table


def import_recording(recording: Path, out: Path, console: Console) -> None:
    """Turn a recording in the `time|key|value` text into run logs, one for each program execution in it."""
    check_suffix(out)
    observations = read_observations(read_text(recording), str(recording))
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


def write(write: Callable[[], object], path: Path) -> None:
    try:
        write()
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


@contextmanager
def working(first: str) -> Iterator[Callable[[str], None]]:
    """Says on stderr what is being done, where that is a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(first, total=None)
        yield lambda what: progress.update(task, description=what)


def compare_methods(case: Path, seed: int, as_json: bool, console: Console) -> None:
    """The reference paper's genetic algorithm with its stated settings, beside least squares, on the same recordings."""
    with working("searching with the genetic algorithm"):
        found = paper.identify_paper(read_case(case), seed, clock=time.perf_counter)
    rows = [asdict(row) for row in found.rows]
    if as_json:
        sys.stdout.write(json.dumps({"seed": seed, "rows": rows, "notes": found.notes}) + "\n")
        return
    table = Table(title="the reference paper's search beside least squares, on the same recordings", title_justify="left")
    for column in ("what", "method", "objective", "evaluations", "seconds", "values"):
        table.add_column(column, justify="right" if column in ("objective", "evaluations", "seconds") else "left")
    for row in found.rows:
        values = ", ".join(f"{name} {value:.5g}" for name, value in row.values.items())
        objective = f"{row.objective:.5g} {row.unit}"
        table.add_row(row.what, row.method, objective, str(row.evaluations), f"{row.seconds:.3g}", values)
    console.print(table)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)
