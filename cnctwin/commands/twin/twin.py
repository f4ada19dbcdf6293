"""The commands below `cnctwin twin`: which description of a machine is live, which challenger waits, promote it, or go back.

Exit codes: 0 = done; 1 = refused, with the reason; 2 = wrong input.
"""

import getpass
import json
import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cnctwin.commands.options import AsJson, Broker, Config, Group, Machines, StorePlace, Wait
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_text
from cnctwin.processes.extras import needed_by
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import moment_text

if TYPE_CHECKING:
    from cnctwin.machines.change import Change, Done
    from cnctwin.machines.folder import MachineFolder
    from sparkplug.broker import BrokerAddress

twin_app = typer.Typer(
    no_args_is_help=True, help="The description of a machine: which is live, which challenger waits, promote it, go back."
)
MachineName = Annotated[str, typer.Argument(metavar="MACHINE", help="Name of the machine on the broker")]
By = Annotated[str | None, typer.Option(help="Who does it; else the user of this process", show_default=False)]
Why = Annotated[str, typer.Option(help="Why, for the log")]
Version = Annotated[str, typer.Option(help="Version: its digits, or the first of them", show_default=False)]
STEPS_SHOWN = 12


@twin_app.command()
def show(
    machine: MachineName,
    machines: Machines = None,
    broker: Broker = None,
    group: Group = "cnc",
    wait_s: Wait = 3.0,
    as_json: AsJson = False,
) -> None:
    """Show the live description, what of it is assumed, the challenger that waits, and what each does to the standing gap."""
    from cnctwin.machines.told import told

    own = _folder(machine, machines)
    found = told(own) | {"standing": _standing(address(broker), group, machine, wait_s)}
    if as_json:
        sys.stdout.write(json.dumps(found, ensure_ascii=False) + "\n")
        return
    console = standard_output()
    for line in _lines(found):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


@twin_app.command()
def challenge(
    machine: MachineName,
    twin: Annotated[Path, typer.Argument(help="The twin.toml of a diagnosis, or any machine.toml")],
    case: Annotated[
        Path | None, typer.Option(help="A case whose check runs it is scored on, beside the live one", show_default=False)
    ] = None,
    by: By = None,
    why: Why = "",
    machines: Machines = None,
    as_json: AsJson = False,
) -> None:
    """Have a description wait as the challenger; the diagnosis.json beside it says where it comes from."""
    own = _folder(machine, machines)
    with needed_by("scoring a description", "twin"):
        from cnctwin.loop.judging import card_of
    live, text = own.live(), read_text(twin)
    card = card_of(twin, case, None if live is None else own.live_file.read_text(encoding="utf-8"))
    _change(machine, machines, lambda change: change.file(text, card, _user(by), why or card.sentence), as_json)


@twin_app.command()
def promote(
    machine: MachineName,
    version: Version = "",
    by: By = None,
    why: Why = "",
    force: Annotated[bool, typer.Option("--force", help="Whatever speaks against it; takes --why")] = False,
    machines: Machines = None,
    as_json: AsJson = False,
) -> None:
    """Make the challenger the live description, or with --version one of the history. Exit code 1: it may not be, and why."""
    if force and not why.strip():
        raise UsageError("--force takes --why, which the log keeps")
    _change(machine, machines, lambda change: change.promote(_user(by), why, version, is_forced=force), as_json)


@twin_app.command()
def back(
    machine: MachineName,
    by: By = None,
    why: Why = "",
    machines: Machines = None,
    as_json: AsJson = False,
) -> None:
    """Make the description before the live one live again; once more, the one before that. Exit code 1: there is none."""
    _change(machine, machines, lambda change: change.back(_user(by), why), as_json)


@twin_app.command()
def withdraw(
    machine: MachineName,
    by: By = None,
    why: Why = "",
    machines: Machines = None,
    as_json: AsJson = False,
) -> None:
    """Take the challenger away; it stays in the history."""
    _change(machine, machines, lambda change: change.withdraw(_user(by), why), as_json)


@twin_app.command()
def programs(
    machine: MachineName,
    folder: Annotated[Path, typer.Option("--programs", help="Folder with the NC files that the machine runs")],
    machines: Machines = None,
) -> None:
    """Plan the programs of a machine: live, each section between tool changes is then compared with its planned time."""
    own = _folder(machine, machines)
    with needed_by("planning a program", "twin"):
        from cnctwin.machines.planned import keep_planned, planned
    console = standard_output()
    for description in (one for one in (own.live(), own.challenger()) if one is not None):
        found, faults = planned(description.machine, folder)
        keep_planned(own, description.version, found)
        for name, seconds in found.items():
            text = f"{description.version}  {name}: {sum(seconds):.1f} s in {len(seconds)} sections between tool changes"
            console.print(text, markup=False, highlight=False, soft_wrap=True)
        for fault in faults:
            console.print(fault, markup=False, highlight=False, soft_wrap=True)


@twin_app.command("run")
def run_loop(
    machines: Machines = None,
    config: Config = None,
    store: StorePlace = None,
    jobs_files: Annotated[
        Path | None,
        typer.Option(
            help="Folder below which requests may name files, as of `jobs run`; else cases in the state folder",
            show_default=False,
        ),
    ] = None,
    jobs: Annotated[
        Path | None,
        typer.Option(help="Folder of jobs and results, as of `jobs run`; else jobs in the state folder", show_default=False),
    ] = None,
    diagnoses: Annotated[
        Path | None, typer.Option(help="Folder with <machine>/diagnosis.json; else diagnoses beside the descriptions")
    ] = None,
    broker: Broker = None,
    group: Group = "cnc",
) -> None:
    """Keep the loop of a plant until SIGTERM or Ctrl-C: an open gap is diagnosed, and the answer waits as a challenger."""
    from cnctwin.loop.config import loop_configuration
    from cnctwin.loop.service import LoopService
    from cnctwin.loop.workshop import Places
    from cnctwin.machines.place import machines_folder
    from cnctwin.memory.store.opening import default_place
    from edge.state_dir import state_dir

    folder = machines_folder(machines, config)
    if folder is None:
        raise UsageError("no folder of descriptions is here; give --machines DIR or $CNCTWIN_MACHINES (docs/how-to/loop.md)")
    files = jobs_files or state_dir() / "cases"
    files.mkdir(parents=True, exist_ok=True)
    places = Places(store or default_place(), files, jobs or state_dir() / "jobs", diagnoses or folder / "diagnoses")
    logging.getLogger("cnctwin.loop").setLevel(logging.INFO)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        service = LoopService(folder, where, loop_configuration(config), places, group)
        print(f"the loop of {where.url} keeps {folder}; jobs read {files}", file=sys.stderr)
        service.run(stop)


def _folder(machine: str, given: Path | None) -> "MachineFolder":
    """Return the folder of a machine that is described. Raises UsageError."""
    from cnctwin.machines.folder import MachineFolder, described
    from cnctwin.machines.place import VARIABLE, machines_folder

    folder = machines_folder(given)
    if folder is None or not folder.is_dir():
        where = "no folder of descriptions is here" if folder is None else f"{folder}: is no folder"
        raise UsageError(f"{where}; give --machines DIR or ${VARIABLE}, with {machine}.toml in it (docs/how-to/loop.md)")
    own = MachineFolder(folder, machine)
    if machine not in (known := described(folder)):
        raise UsageError(f"{folder}: no description of {machine!r}; there are {', '.join(known) or 'no machines'}")
    return own


def _change(machine: str, machines: Path | None, make: "Callable[[Change], Done]", as_json: bool) -> None:
    from cnctwin.machines.change import RefusedError, changing

    own = _folder(machine, machines)
    try:
        with changing(own, time.time_ns() // 1_000_000) as change:
            done = make(change)
    except RefusedError as error:
        print(f"cnctwin: {error}", file=sys.stderr)
        raise typer.Exit(1) from None
    if as_json:
        step = None if done.step is None else done.step.document
        sys.stdout.write(json.dumps({"done": step is not None, "text": done.text, "step": step}, ensure_ascii=False) + "\n")
    else:
        print(done.text)


def _user(given: str | None) -> str:
    if given:
        return given
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "command line"


def _lines(found: Mapping[str, Any]) -> Iterator[str]:
    """The document in lines for a person."""
    from twin.assumed import listed

    live, challenger, score = found["live"], found["challenger"], found["score"]
    if live is None:
        yield f"{found['machine']}: not described yet; a challenger waits"
    else:
        why = f": {live['why']}" if live["why"] else ""
        yield f"{found['machine']}: {live['version']} is live since {moment_text(live['since'])} UTC, by {live['by']}{why}"
        yield f"assumed: {listed(live['assumed']) or 'nothing'}"
    if challenger is None:
        yield "no challenger waits"
    else:
        said = f": {challenger['sentence']}" if challenger["sentence"] else ""
        yield f"challenger: {challenger['version']}{said}"
        if challenger["gap_before"] is not None and challenger["gap_after"] is not None:
            yield f"gap by its diagnosis: {challenger['gap_before']:.3g} → {challenger['gap_after']:.3g} × the repeatability"
        if score is not None:
            both = f"live {score['live']:.3g}, challenger {score['challenger']:.3g} × the repeatability"
            yield f"gap on {score['runs']} runs that were not fitted: {both}"
        yield from _shadow(found["shadow"], found["standing"])
        yield "it may be promoted" if found["may_promote"] else f"it may not be promoted: {found['why_not']}"
    yield from _gaps(found["standing"])
    for fault in found["faults"]:
        yield f"wrong: {fault}"
    for step in found["steps"][-STEPS_SHOWN:]:
        why = f": {step['why']}" if step.get("why") else ""
        yield f"{moment_text(step['t'])}  {step['step']:<11} {step.get('version', ''):<12} by {step.get('by') or '?'}{why}"


def _shadow(shadow: Mapping[str, Any] | None, standing: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield what the loop has kept of the shadow; its gaps only where the broker tells none."""
    if shadow is None:
        return
    if standing is None:
        yield from _gaps({one: {"live": shadow["live"].get(one), "challenger": gap} for one, gap in shadow["challenger"].items()})
    yield f"it has run beside the live one for {shadow['seconds']:.0f} s"


def _gaps(standing: Mapping[str, Any] | None) -> Iterator[str]:
    for signal, gaps in (standing or {}).items():
        known = [f"{which} {gap:.2f}" for which in ("live", "challenger") if (gap := gaps[which]) is not None]
        yield f"standing gap of {signal}: {', '.join(known)} × the repeatability"


def _standing(broker: "BrokerAddress | None", group: str, machine: str, wait_s: float) -> dict[str, Any] | None:
    """The standing gap by signal, of both; None where no broker is given, or it tells nothing."""
    if broker is None:
        return None
    from cnctwin.loop.listening import heard_gap

    found = heard_gap(broker, group, machine, wait_s)
    if found is None:
        return None
    signals = sorted({*found.live, *found.challenger})
    return {one: {"live": found.live.get(one), "challenger": found.challenger.get(one)} for one in signals}
