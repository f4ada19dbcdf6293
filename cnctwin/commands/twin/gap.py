"""`cnctwin gap`: the sim-to-real gap from the command line."""

import json
import os
import sys
import tempfile
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from cnctwin.commands.options import AsJson, Dask, Seed
from cnctwin.commands.twin.gap_case import case
from cnctwin.errors import UsageError
from cnctwin.processes.extras import needed_by
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from twin.gap.diagnosis import Diagnosed, Diagnosis
    from twin.gap.score_of import Score

gap_app = typer.Typer(no_args_is_help=True, help="The sim-to-real gap: where it lies, what causes it, how far it shrinks.")
gap_app.command("case")(case)


@gap_app.command()
def diagnose(
    case: Annotated[Path, typer.Argument(help="The folder with case.toml, machine.toml and the recorded runs")],
    out: Annotated[Path, typer.Option(help="The folder for diagnosis.json, report.html and twin.toml")],
    as_json: AsJson = False,
) -> None:
    """Say where the gap lies, what causes it, how far it shrinks. Exit code 1: a gap without a name is left."""
    with needed_by("the twin", "twin"):
        from cnctwin.batch.diagnosis import diagnosis_files, in_threads, write_files
        from twin.case import read_case
        from twin.gap.diagnosis import Verdict
    recorded = read_case(case)
    with working("diagnosing") as say:
        found = in_threads(recorded, lambda what: say(f"diagnosing: {what}"))
    files = diagnosis_files(found, recorded.name)
    write_files(files, out)
    if as_json:
        sys.stdout.write(found.diagnosis.to_json())
    else:
        _print(found, files, out, standard_output())
    raise typer.Exit(1 if found.diagnosis.verdict in (Verdict.UNKNOWN, Verdict.PARTLY) else 0)


@gap_app.command()
def score(
    twin: Annotated[Path, typer.Argument(help="The twin: a machine.toml, or the twin.toml of a diagnosis")],
    case: Annotated[Path, typer.Argument(help="The folder with the recorded runs")],
    as_json: AsJson = False,
) -> None:
    """Print the gap of any twin on all runs of a case: rms over the repeatability, for all signals and by signal."""
    with needed_by("the twin", "twin"):
        from twin.case import read_case
        from twin.gap.score_of import score_of
        from twin.machine import read_machine
    console = standard_output()
    recorded = read_case(case)
    machine = read_machine(twin)
    with working("scoring"):
        found = score_of(machine, recorded)
    if as_json or not console.is_terminal:
        sys.stdout.write(json.dumps(score_json(found)) + "\n")
        return
    signals = Table(title=f"{machine.machine.name} on {recorded.name}: {found.gap:.3g} × the repeatability", title_justify="left")
    for column in ("signal", "rms", "repeatability", "unit", "×"):
        signals.add_column(column, justify="left" if column in ("signal", "unit") else "right")
    for signal, one in found.by_signal.items():
        signals.add_row(signal, f"{one.rms:.4g}", f"{one.floor:.4g}", one.unit, f"{one.rms / one.floor:.2f}")
    console.print(signals)


@gap_app.command()
def check(
    cases: Annotated[int, typer.Option(help="Machines to draw", min=1)] = 40,
    seed: Seed = 1,
    keep: Annotated[
        Path | None,
        typer.Option(help="A folder for what is done: with the same cases and seed, the check goes on where it stopped"),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes, one thread each; as many as there are cores", min=1)] = None,
    dask: Dask = None,
    as_json: AsJson = False,
) -> None:
    """The blind check: an independent plant withholds its effects, answers sealed by hash; accuracy over effect size.

    Ctrl-C ends it after the cases that have begun, and prints the score of those that are done.
    """
    with needed_by("the twin", "twin"):
        from cnctwin.blind_check.check import run_checks
        from cnctwin.blind_check.question import drafts
        from cnctwin.blind_check.table import check_json, missed, table
        from cnctwin.jobs.dask_cluster import DaskCluster
        from cnctwin.jobs.spread import spread_over
    if cases < 1:
        raise UsageError(f"--cases {cases}: at least one")
    cluster = DaskCluster.from_text(dask) if dask is not None else None
    cores = workers or (os.cpu_count() if find_spec("joblib") else None) or 1
    with (
        tempfile.TemporaryDirectory(prefix="blind-check-") as passing,
        stopped_by_signals() as stop,
        spread_over(min(cores, cases), cluster) as spread,
        working("blind check") as say,
    ):
        result = run_checks(
            drafts(cases, seed),
            {"diagnosis": "cnctwin.batch.diagnosis:diagnosed_alone"},
            keep or Path(passing),
            seed=seed,
            spread=spread,
            progress=say,
            stopped=stop.is_set,
        )["diagnosis"]
    sys.stdout.write(json.dumps(check_json(result)) + "\n" if as_json else table(result) + "\n")
    raise typer.Exit(1 if missed(result) else 0)


def _print(answer: "Diagnosed", files: Iterable[str], out: Path, console: Console) -> None:
    found = answer.diagnosis
    unseen = "that were not fitted" if any(not trace.fitted for trace in answer.traces) else "that were fitted, which flatters"
    console.print(found.sentence, style="bold", highlight=False, soft_wrap=True)
    gap = found.gap
    console.print(
        f"gap {gap.before:.3g} → {gap.after:.3g} × the repeatability; closed {100 * gap.closure:.1f} % "
        f"({100 * gap.closure_low:.1f} to {100 * gap.closure_high:.1f}) of its square, on runs {unseen}; "
        f"with the constants of the machine file {gap.as_stated:.3g}",
        highlight=False,
        soft_wrap=True,
    )
    for title, sentences in (
        ("where", [cell.sentence for cell in found.where[:5] if cell.discovered] + [p.sentence for p in found.patterns[:3]]),
        ("not to be known from these recordings", found.not_identifiable[:6]),
        ("found on the way", found.notes),
    ):
        if sentences:
            console.print(f"\n[bold]{title}[/]")
        for sentence in sentences:
            console.print(f"· {sentence}", markup=False, highlight=False, soft_wrap=True)
    if found.causes:
        console.print(_causes_table(found))
    for table in (_subsystems_table(found), _constants_table(found), _learned_table(found)):
        if table.row_count:
            console.print(table)
    if found.next_experiment is not None:
        console.print("\n[bold]next experiment[/]")
        console.print(found.next_experiment.why, markup=False, highlight=False, soft_wrap=True)
    console.print(f"\n{', '.join(files)} in {out} ({found.seconds:.0f} s)", markup=False, highlight=False, soft_wrap=True)


def _causes_table(found: "Diagnosis") -> Table:
    """Return the table of causes, with intervals."""
    causes = Table(title="causes", title_justify="left")
    for column in ("effect", "on", "parameters (90 %)", "share", "cannot be told apart from"):
        causes.add_column(column, justify="right" if column == "share" else "left")
    for cause in found.causes:
        parameters = ", ".join(
            f"{k} {v.value:.4g} ({v.low:.4g} … {v.high:.4g}) {v.unit}".strip() for k, v in cause.parameters.items()
        )
        rivals = ", ".join(str(e) for e in cause.indistinguishable_from)
        causes.add_row(cause.effect, cause.on, parameters, f"{100 * cause.closure:.1f} %", rivals)
    return causes


def _subsystems_table(found: "Diagnosis") -> Table:
    """Return the table of the parts compared alone, worst first."""
    parts = Table(title="part by part, driven by what was measured", title_justify="left")
    for column in ("part", "compared", "gap before → after", "verdict", "causes"):
        parts.add_column(column, justify="right" if column.startswith("gap") else "left")
    for one in found.subsystems:
        gap = f"{one.before:.3g} → {one.after:.3g} ×"
        parts.add_row(one.subsystem, one.compared, gap, one.verdict.value.replace("_", " "), ", ".join(one.causes))
    return parts


def _constants_table(found: "Diagnosis") -> Table:
    """Return the table of the constants that take up a part of the gap."""
    constants = Table(title="constants that take up a part of the gap", title_justify="left")
    for column in ("constant", "stated", "found", "moved by", "share"):
        constants.add_column(column, justify="left" if column == "constant" else "right")
    for one in found.constants:
        constants.add_row(
            one.name, f"{one.stated:.4g}", f"{one.found:.4g}", f"{one.deviations:.2g} σ", f"{100 * one.closure:.1f} %"
        )
    return constants


def _learned_table(found: "Diagnosis") -> Table:
    """Return the table of what is in no catalogue: described, not named."""
    learned = Table(title="described, not named", title_justify="left")
    for column in ("where", "over", "closes (90 %)", "repeats", ""):
        learned.add_column(column)
    for one in found.learned:
        closes = f"{100 * one.closure:.0f} % ({100 * one.closure_low:.0f} to {100 * one.closure_high:.0f})"
        where = f"{one.site.replace('_', ' ')}{f' on {one.on}' if one.on else ''}"
        learned.add_row(where, ", ".join(one.depends_on), closes, "yes" if one.repeats else "no", one.sentence)
    return learned


def score_json(found: "Score") -> dict[str, Any]:
    """As `cli.md` has it."""
    by_signal = {s: {"rms": _digits(v.rms), "floor": _digits(v.floor), "unit": v.unit} for s, v in found.by_signal.items()}
    return {"gap": _digits(found.gap), "by_signal": by_signal}


def _digits(value: float) -> float:
    return float(f"{value:.6g}")
