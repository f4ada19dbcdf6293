"""`cnctwin gap case`: a case from a machine's history, or from run logs."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from cnctwin.commands.options import WHEN, AsJson, From, Programs, StorePlace, To, file_or_class
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_text
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import moment_ms, moment_text, stretch_ms
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from cnctwin.composing.composed import Composed

ON_SHOWN = 4
Machine = Annotated[
    str | None,
    typer.Option(
        "--machine", help="Name of the machine, as the store has it; with run logs: its machine.toml, or a class, as vmc-40"
    ),
]
MachineFile = Annotated[
    Path | None, typer.Option(help="machine.toml; else M.toml in $CNCTWIN_MACHINES or ./machines, else an assumed machine")
]
Ambient = Annotated[float | None, typer.Option("--ambient-c", help="The surroundings, °C, where no signal tells them")]


def case(
    out: Annotated[Path, typer.Option(help="The folder to write; a case that is there is replaced")],
    runs: Annotated[list[Path] | None, typer.Argument(help="Run logs, .parquet or .csv; else --machine of a store")] = None,
    store: StorePlace = None,
    machine: Machine = None,
    from_: From = None,
    to: To = None,
    machine_file: MachineFile = None,
    programs: Programs = None,
    healthy_from: Annotated[str | None, typer.Option(help=f"Start of a stretch in which the twin was right: {WHEN}")] = None,
    healthy_to: Annotated[str | None, typer.Option(help="End of the stretch in which the twin was right")] = None,
    ambient_c: Ambient = None,
    fit: Annotated[list[str] | None, typer.Option(help="Run log to learn from")] = None,
    check: Annotated[list[str] | None, typer.Option(help="Run log to be judged on")] = None,
    kind: Annotated[list[str] | None, typer.Option(help="NAME=air, cut, warmup or program, of a run log")] = None,
    repeats: Annotated[list[str] | None, typer.Option(help="NAME=OTHER: a run log repeats another")] = None,
    program: Annotated[list[str] | None, typer.Option(help="NAME=file.nc that a run log is of")] = None,
    healthy: Annotated[list[str] | None, typer.Option(help="Run log made when the twin was right")] = None,
    as_json: AsJson = False,
) -> None:
    """Compose a case for `gap diagnose` from a machine's history, or from run logs.

    From a store: `--machine M`, and what is fitted comes before what is judged on. From run logs: kinds, roles and repeats are
    guessed where no option says them; on a terminal you are asked. Exit code 1: nothing is left to be judged on.
    """
    said = {"--fit": fit, "--check": check, "--kind": kind, "--repeats": repeats, "--program": program, "--healthy": healthy}
    if runs:
        if given := [name for name, v in _of_store(store, from_, to, programs, healthy_from, healthy_to, ambient_c) if v]:
            raise UsageError(f"{given[0]} belongs to a case from a store; leave it out, or the run logs")
        done = _from_runs(runs, _description(machine, machine_file), out, {name: values or [] for name, values in said.items()})
    elif machine is None:
        raise UsageError("name run logs, or a machine of the store: --machine NAME; `cnctwin store status` tells which it has")
    else:
        if given := [name for name, values in said.items() if values]:
            raise UsageError(f"{given[0]} belongs to run logs; a case from a store finds out by itself")
        period = (healthy_from, healthy_to)
        done = composed_of(store, machine, out, from_, to, machine_file, programs, healthy=period, ambient_c=ambient_c)
    if as_json:
        sys.stdout.write(json.dumps(done.as_json(), ensure_ascii=False) + "\n")
    else:
        show(done)
    raise typer.Exit(0 if done.has_check else 1)


def _description(machine: str | None, machine_file: Path | None) -> Path | None:
    """Return the file that describes the machine of run logs, by either of its options. Raises UsageError where both name one."""
    if machine is None or machine_file is None:
        return machine_file if machine is None else file_or_class(Path(machine))
    raise UsageError(f"--machine {machine} and --machine-file {machine_file}: two descriptions of one machine; give one")


def _of_store(*values: object) -> list[tuple[str, object]]:
    """Return the options of a case from a store, by name."""
    names = ("--store", "--from", "--to", "--programs", "--healthy-from", "--healthy-to", "--ambient-c")
    return [(name, value is not None) for name, value in zip(names, values, strict=True)]


def _from_runs(runs: list[Path], machine_file: Path | None, out: Path, said: dict[str, list[str]]) -> "Composed":
    """Compose a case from run logs, asking on a terminal for what no option says."""
    with needed_by("a case", "twin"):
        from cnctwin.commands.twin.gap_case_runs import machine_file_of, recordings_of
        from cnctwin.composing.from_runs import compose_runs

    recordings = recordings_of(runs, said)
    description = read_text(machine_file_of(machine_file))
    with working("composing"):
        return compose_runs(recordings, description, out)


def composed_of(
    store: str | None,
    machine: str,
    out: Path,
    from_: str | None,
    to: str | None,
    machine_file: Path | None,
    programs: Path | None,
    *,
    healthy: tuple[str | None, str | None] = (None, None),
    ambient_c: float | None = None,
) -> "Composed":
    """Compose a case as the options of a command say. Raises ApplicationError, TwinError."""
    with needed_by("a case", "twin"):
        from cnctwin.composing.compose import compose
    from cnctwin.memory.store.opening import default_place, open_store

    description = description_of(machine, machine_file)
    opened = open_store(store or default_place())
    try:
        with working("composing") as say:
            return compose(
                opened,
                machine,
                description,
                out,
                span_ms=_span_ms(from_, to),
                healthy_ms=_healthy_ms(*healthy),
                programs=programs,
                ambient_c=ambient_c,
                progress=say,
            )
    finally:
        opened.close()


def description_of(machine: str, machine_file: Path | None) -> str:
    """Return the text that describes a machine: the file given, its file in the folder of machines, else an assumed one."""
    from cnctwin.composing.assumed import assumed_description
    from cnctwin.machines.place import machines_folder

    if machine_file is not None:
        return read_text(machine_file)
    folder = machines_folder()
    live = None if folder is None else folder / f"{machine}.toml"
    return read_text(live) if live is not None and live.is_file() else assumed_description(machine)


def _span_ms(from_: str | None, to: str | None) -> tuple[int, int] | None:
    """Return the stretch that --from and --to say; None where neither does."""
    if from_ is None and to is None:
        return None
    return stretch_ms(from_, to)


def _healthy_ms(from_: str | None, to: str | None) -> tuple[int, int] | None:
    if (from_ is None) != (to is None):
        raise UsageError("--healthy-from and --healthy-to belong together; give both")
    return None if from_ is None or to is None else (moment_ms(from_, "--healthy-from"), moment_ms(to, "--healthy-to"))


def show(done: "Composed") -> None:
    """Print the runs of a case, what they can show, and what is missing for the rest."""
    console = standard_output()
    runs = Table(title=f"{done.name}: {len(done.runs)} runs in {done.folder}", title_justify="left")
    for column in ("run", "what", "kind", "role", "from", "lasted", "rows", "repeats"):
        runs.add_column(column, justify="right" if column in ("lasted", "rows") else "left", overflow="fold")
    for run in done.runs:
        begun = "" if run.from_ms is None else moment_text(run.from_ms)
        role = f"{run.role}, healthy" if run.healthy else run.role
        name = run.file.removeprefix("runs/")
        repeats = (run.repeats or "").removeprefix("runs/")
        runs.add_row(name, run.what, run.kind.value, role, begun, _length(run.lasted_s), str(run.rows), repeats)
    console.print(runs)
    shown = [f"{one.effect}{_places(one.on)}" for one in done.effects if not one.missing]
    console.print("\n[bold]can show[/]")
    console.print(f"· {', '.join(shown) or 'nothing'}", markup=False, highlight=False, soft_wrap=True)
    lacking: dict[str, list[str]] = {}
    for one in done.effects:
        if one.missing:
            lacking.setdefault(one.missing, []).append(one.effect)
    if lacking:
        console.print("\n[bold]cannot show[/]")
    for missing, effects in lacking.items():
        console.print(f"· {', '.join(effects)}: {missing}", markup=False, highlight=False, soft_wrap=True)
    if done.notes:
        console.print("\n[bold]how it was composed[/]")
    for note in done.notes:
        console.print(f"· {note}", markup=False, highlight=False, soft_wrap=True)


def _places(on: Sequence[str]) -> str:
    """Return where an effect may act, in brackets.

    >>> _places(()), _places(("x", "y"))
    ('', ' (x, y)')
    """
    if len(on) > ON_SHOWN:
        return f" ({len(on)} signals)"
    return f" ({', '.join(on)})" if on else ""


def _length(seconds: float) -> str:
    """Return a length as people say it.

    >>> _length(42.0), _length(600.0), _length(12_600.0)
    ('42 s', '10 min', '3.5 h')
    """
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
