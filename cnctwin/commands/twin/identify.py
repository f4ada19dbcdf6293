"""`cnctwin identify`: the twin's constants from recordings."""

import json
import sys
import tempfile
import time
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.table import Table

from cnctwin.commands.options import AsJson, From, Seed, StorePlace, To
from cnctwin.commands.twin.gap_case import Ambient, Machine, MachineFile, composed_of
from cnctwin.errors import UsageError
from cnctwin.files.output import write
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from twin.gap.free_run import GapRow
    from twin.identification.identify import Identification


class Method(StrEnum):
    """The search that `identify` uses."""

    LSQ = "least-squares"
    GA = "ga"


def identify(
    case: Annotated[
        Path | None, typer.Argument(help="The folder with case.toml, machine.toml and recorded runs; else --machine of a store")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the identified machine.toml there")] = None,
    store: StorePlace = None,
    machine: Machine = None,
    from_: From = None,
    to: To = None,
    machine_file: MachineFile = None,
    ambient_c: Ambient = None,
    method: Annotated[
        Method, typer.Option(help="least-squares, or the reference paper's genetic algorithm beside it")
    ] = Method.LSQ,
    free_gains: Annotated[
        bool, typer.Option("--free-gains", help="Fit the loop gains S_pp, S_vp, S_vi too; else they stay as stated")
    ] = False,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Fit the twin's constants to recordings, with confidence intervals, and say which cannot be known from them."""
    with needed_by("the twin", "twin"):
        from cnctwin.batch.identification import identification_json
        from twin.case import read_case
        from twin.identification import identify as identification
        from twin.machine_toml import machine_to_toml
    if method is Method.GA:
        if case is None:
            raise UsageError("--method ga compares the two on a case; give its folder")
        _compare_methods(case, seed, as_json=as_json)
        return
    with tempfile.TemporaryDirectory(prefix="identify-") as passing:
        if case is None and machine is not None:
            case = composed_of(store, machine, Path(passing) / "case", from_, to, machine_file, None, ambient_c=ambient_c).folder
        elif case is None or machine is not None:
            raise UsageError("give either the folder of a case, or a machine of the store: --machine NAME")
        question = read_case(case)
        with working("identifying") as say:
            found = identification.identify(question, free_gains=free_gains, progress=lambda what: say(f"identifying: {what}"))
    code = 0 if found.estimates and not found.misfits else 1
    if out is not None:
        write(lambda: out.write_text(machine_to_toml(found.machine), encoding="utf-8"), out)
    if as_json:
        sys.stdout.write(json.dumps(identification_json(found) | {"out": None if out is None else str(out)}) + "\n")
        raise typer.Exit(code)
    console = standard_output()
    console.print(_estimates_table(found))
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
    console.print(_gap_table(found.gaps))
    if out is not None:
        doubt = "; it does not fit its recordings: do not rely on it" if found.misfits else ""
        console.print(f"the identified machine is in {out}{doubt}", markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(code)


def _estimates_table(found: "Identification") -> Table:
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


def _gap_table(rows: "tuple[GapRow, ...]") -> Table:
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


def _compare_methods(case: Path, seed: int, *, as_json: bool) -> None:
    """The reference paper's genetic algorithm with its stated settings, beside least squares, on the same recordings."""
    from twin.case import read_case
    from twin.identification import paper

    console = standard_output()
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
