"""`cnctwin validate` on the command line; `cnctwin/validation` does it, and is imported when it is run."""

from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import FROM, AsJson, Config, Group, Machines, Programs, StorePlace, To
from cnctwin.errors import UsageError
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.place import machines_folder
from cnctwin.processes.extras import needed_by
from cnctwin.processes.given_broker import address
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import stretch_ms
from edge.state_dir import state_dir
from twin.vocabulary.nodes import VALIDATION_NODE

DAY_MS = 86_400_000


def validate(
    machine: Annotated[str, typer.Option(help="Name of the machine, as the store has it")],
    store: StorePlace = None,
    runs: Annotated[
        list[Path] | None, typer.Option(help="Run log, in place of the store; may be given again, and the worst counts")
    ] = None,
    from_: Annotated[str | None, typer.Option("--from", help=f"{FROM}; else a day before --to", show_default=False)] = None,
    to: To = None,
    truth: Annotated[
        list[Path] | None, typer.Option(help="Run log of a dynamometer, thermocouple, accelerometer; one for each of --runs")
    ] = None,
    programs: Programs = None,
    config: Config = None,
    twin: Annotated[
        Path | None, typer.Option(help="machine.toml of the twin; else the machine's live description in --machines")
    ] = None,
    machines: Machines = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the history; else `validation` in the state folder")] = None,
    keep: Annotated[bool, typer.Option(help="Keep this night in the history")] = True,
    broker: Annotated[
        str | None, typer.Option(help="Publish the figures: mqtt[s]://[user@]host[:port]", show_default=False)
    ] = None,
    group: Group = "cnc",
    as_json: AsJson = False,
) -> None:
    """Twin against ground truth: temperature, force, vibration, following error, cycle time. Exit code 1: over a budget."""
    from_ms, to_ms = stretch_ms(from_, to, DAY_MS)
    if runs and store is not None:
        raise UsageError("--runs and --store: give one of them")
    folder = None if twin is not None else machines_folder(machines, config)
    if folder is not None and (live := MachineFolder(folder, machine).live_file).is_file():
        twin = live
    with needed_by("validation", "twin,historian"):
        from cnctwin.validation import validate as command
    asked = command.ValidationRequest(
        *(machine, store, tuple(runs or ()), tuple(truth or ()), from_ms, to_ms, programs, config, twin),
        *(out or state_dir() / "validation", keep, group),
    )
    where = None if broker is None else address(broker)
    session_file = None if where is None else state_dir() / f"{VALIDATION_NODE}.json"
    raise typer.Exit(command.validate(asked, where, session_file, as_json=as_json, console=standard_output()))
