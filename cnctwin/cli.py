"""The command `cnctwin`.

Exit codes: 0 = done, 1 = the answer is bad news, 2 = wrong input. Errors are one line on stderr that names the culprit, the value
and the way out.
"""

import json
import logging
import sys
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from typer.exceptions import TyperException

from cnctwin.commands.alerts import alerts_app
from cnctwin.commands.jobs import jobs_app
from cnctwin.commands.model import model_app
from cnctwin.commands.moment import moment_ms
from cnctwin.commands.optimise import optimise
from cnctwin.commands.parts import parts_app
from cnctwin.commands.replay import replay_history
from cnctwin.commands.serve import serve
from cnctwin.commands.simulate_control import control_app
from cnctwin.commands.store import export, store_app
from cnctwin.commands.train.app import train_app
from cnctwin.commands.train.detector import train_detector
from cnctwin.commands.train.residual import train_residual
from cnctwin.commands.validate import validate
from cnctwin.demo import demo as demo_command
from cnctwin.demo.parts import DemoOptions
from cnctwin.errors import ApplicationError, BrokerStartError, UsageError
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from edge.errors import EdgeError
from edge.state_dir import state_dir as folder_for_state
from processors.errors import ProcessorError
from sparkplug.errors import SparkplugError
from twin.errors import TwinError

app = typer.Typer(
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help="A digital twin of CNC machines."
)
edge_app = typer.Typer(no_args_is_help=True, help="Turn what a control says into Sparkplug B metrics.")
gap_app = typer.Typer(no_args_is_help=True, help="The sim-to-real gap: where it lies, what causes it, how far it shrinks.")
app.add_typer(edge_app, name="edge")
app.add_typer(gap_app, name="gap")
app.add_typer(control_app, name="simulate-control")
app.add_typer(alerts_app, name="alerts")
app.add_typer(train_app, name="train")
app.add_typer(store_app, name="store")
app.add_typer(parts_app, name="parts")
app.add_typer(jobs_app, name="jobs")
train_app.command("detector")(train_detector)
train_app.command("residual")(train_residual)
app.add_typer(model_app, name="model")


class Method(StrEnum):
    """How `identify` searches."""

    LSQ = "least-squares"
    GA = "ga"


Broker = Annotated[str | None, typer.Option(help="mqtt[s]://[user@]host[:port]; else $CNCTWIN_BROKER", show_default=False)]
Group = Annotated[str, typer.Option(help="Sparkplug group: the plant")]
AsJson = Annotated[bool, typer.Option("--json", help="For a program to read")]


@app.command()
def demo(
    recording: Annotated[Path | None, typer.Option(help="SHDR log or time|key|value text; else the simulated machine")] = None,
    devices: Annotated[Path | None, typer.Option(help="The Devices.xml that belongs to it")] = None,
    speed: Annotated[float, typer.Option(help="How many times faster than real time, or than recorded")] = 1.0,
    seconds: Annotated[float | None, typer.Option(help="Stop by itself after so long; else at Ctrl-C")] = None,
    port: Annotated[int | None, typer.Option(help="The private broker's port; else 1883 or a free one", min=1, max=65535)] = None,
    machine: Annotated[str | None, typer.Option(help="The device's name; else that of the device model")] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser")] = False,
    as_json: AsJson = False,
) -> None:
    """Show a machine, its edge, a real broker and the twin, and account for everything that went through."""
    options = DemoOptions(recording, devices, speed, seconds, port, machine, as_json, no_open)
    with stopped_by_signals() as stop:
        code = demo_command.run(options, stop)
    raise typer.Exit(code)


@app.command()
def watch(
    machine: Annotated[str | None, typer.Argument(help="Only this machine")] = None,
    broker: Broker = None,
    group: Group = "cnc",
) -> None:
    """Live view in the terminal: each machine with the twin beside it, and the ledger of each stage."""
    from cnctwin.plant.watch import watch as look

    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        look(where, group, machine, stop)


@app.command()
def doctor(
    broker: Broker = None,
    group: Group = "cnc",
    seconds: Annotated[float, typer.Option(help="How long to listen", min=1.0, max=600.0)] = 4.0,
    as_json: AsJson = False,
) -> None:
    """Is everything connected, in order and accounted for: received = emitted + dropped + buffered?"""
    from cnctwin.plant.doctor import examine
    from cnctwin.plant.screen import ledger_table
    from sparkplug.broker import BrokerAddress

    logging.getLogger("sparkplug").setLevel(logging.ERROR)  # what is wrong with the connection stands in the report
    report = examine(address(broker) or BrokerAddress(), group, seconds)
    if as_json:
        _print_json(report.as_json())
    else:
        console = _console()
        for finding in report.findings:
            mark = "[green]good[/]" if finding.good else "[bold red]bad [/]"
            console.print(mark, end=" ")
            console.print(finding.text, markup=False, highlight=False, soft_wrap=True)
        if report.ledgers:
            console.print(ledger_table(report.ledgers))
    raise typer.Exit(0 if report.good else 1)


@app.command()
def process(
    names: Annotated[list[str], typer.Argument(help="thermal, cutting_force, mirror, …")],
    config: Annotated[Path | None, typer.Option(help="TOML with a table for each processor")] = None,
    broker: Broker = None,
    group: Group = "cnc",
    state_dir: Annotated[
        Path | None, typer.Option(help="Keeps birth/death numbers; else $CNCTWIN_STATE_DIR or ~/.local/state/cnctwin")
    ] = None,
) -> None:
    """Run processors until SIGTERM or Ctrl-C; beside alerts the courier that sends, beside historian the store that it keeps."""
    from cnctwin.commands.process import process as run_processors
    from processors.running.runtime import configured

    pairs = configured(names, config)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        run_processors(pairs, where, stop, group=group, state_dir=folder_for_state(state_dir))


@app.command()
def simulate(
    program: Annotated[Path, typer.Argument(help="The part program")],
    machine: Annotated[Path, typer.Option(help="machine.toml of the machine to run it on")],
    out: Annotated[Path | None, typer.Option(help="Write the run log there, .parquet or .csv")] = None,
    seed: Annotated[int | None, typer.Option(help="One noisy course of the machine instead of its mean course", min=0)] = None,
    as_json: AsJson = False,
) -> None:
    """Run a part program on the twin as on a machine: time, peak force, following error, and a run log."""
    _twin().simulate(program, machine, out, seed=seed, as_json=as_json, console=_console())


@app.command()
def identify(
    case: Annotated[Path, typer.Argument(help="The folder with case.toml, machine.toml and the recorded runs")],
    out: Annotated[Path | None, typer.Option(help="Write the identified machine.toml there")] = None,
    method: Annotated[
        Method, typer.Option(help="least-squares, or the reference paper's genetic algorithm beside it")
    ] = Method.LSQ,
    free_gains: Annotated[bool, typer.Option("--free-gains", help="Fit S_pp, S_vp, S_vi; else gains are as stated")] = False,
    seed: Annotated[int, typer.Option(help="Of the genetic algorithm", min=0)] = 1,
    as_json: AsJson = False,
) -> None:
    """Fit the twin's constants to recordings, with confidence intervals, and say which cannot be known from them."""
    if method is Method.GA:
        _twin().compare_methods(case, seed, as_json, _console())
    else:
        raise typer.Exit(_twin().identify(case, out, free_gains=free_gains, as_json=as_json, console=_console()))


@app.command("import")
def import_(
    recording: Annotated[
        str, typer.Argument(help="time|key|value text of the NIST test bed; an SHDR log, with --devices; a store, with --machine")
    ],
    out: Annotated[Path, typer.Option(help="The run log, .parquet or .csv; numbered where there are several runs")],
    devices: Annotated[Path | None, typer.Option(help="The Devices.xml of the SHDR log")] = None,
    device: Annotated[str | None, typer.Option(help="Which device of it, where there are several")] = None,
    machine: Annotated[str | None, typer.Option(help="Which machine of the store")] = None,
    from_: Annotated[str | None, typer.Option("--from", help="Of the store: UTC, as 2026-11-21T06:00, or ms since 1970")] = None,
    to: Annotated[str | None, typer.Option(help="Of the store")] = None,
) -> None:
    """Turn a recording into run logs: one for each program execution or stretch without a gap; or a stretch of a store."""
    if machine is not None:
        if from_ is None or to is None:
            raise UsageError(f"--machine {machine}: say which stretch of the store with --from and --to")
        rows = export(recording, machine, (moment_ms(from_, "--from"), moment_ms(to, "--to")), out)
        _console().print(f"{out}: {rows} rows", markup=False, highlight=False)
    elif devices is None:
        _twin().import_recording(Path(recording), out, _console())
    else:
        from cnctwin.importing.shdr import import_shdr

        import_shdr(Path(recording), devices, device, out, _console())


@gap_app.command("diagnose")
def gap_diagnose(
    case: Annotated[Path, typer.Argument(help="The folder with case.toml, machine.toml and the recorded runs")],
    out: Annotated[Path, typer.Option(help="The folder for diagnosis.json, report.html and twin.toml")],
    as_json: AsJson = False,
) -> None:
    """Say where the gap lies, what causes it, how far it shrinks. Exit code 1: a gap without a name is left."""
    raise typer.Exit(_gap().diagnose(case, out, as_json=as_json, console=_console()))


@gap_app.command("score")
def gap_score(
    twin: Annotated[Path, typer.Argument(help="The twin: a machine.toml, or the twin.toml of a diagnosis")],
    case: Annotated[Path, typer.Argument(help="The folder with the recorded runs")],
    as_json: AsJson = False,
) -> None:
    """Print the gap of any twin on all runs of a case: rms over what repeats, of all signals and by signal."""
    _gap().score(twin, case, as_json=as_json, console=_console())


@gap_app.command("check")
def gap_check(
    cases: Annotated[int, typer.Option(help="Machines to draw", min=1)] = 40,
    seed: Annotated[int, typer.Option(help="Of the machines; another one, other machines", min=0)] = 1,
    workers: Annotated[int, typer.Option(help="Processes", min=0)] = 2,
    as_json: AsJson = False,
) -> None:
    """The blind check: an independent plant withholds its effects, answers sealed by hash; accuracy over effect size."""
    raise typer.Exit(_gap().check(cases, seed, workers=workers, as_json=as_json, console=_console()))


@edge_app.command("run")
def edge_run(
    config: Annotated[Path, typer.Argument(help="The TOML file of one machine, or a folder with one for each")],
    broker: Broker = None,
) -> None:
    """Run an edge, or one for each file of a folder, until SIGTERM or Ctrl-C; changes of the files are taken up."""
    from cnctwin.commands.edge import run

    with stopped_by_signals() as stop:
        run(config, address(broker), stop)


@edge_app.command("check")
def edge_check(config: Annotated[Path, typer.Argument(help="The TOML file of one machine")], as_json: AsJson = False) -> None:
    """Check a configuration against its control and show what would be published, without a broker."""
    from cnctwin.commands.edge import table
    from edge.check import check

    if config.is_dir():
        raise UsageError(f"{config}: is a folder; check one of its files at a time")
    rows = check(config)
    if as_json:
        _print_json([asdict(row) for row in rows])
    else:
        _console().print(table(rows))


@edge_app.command("discover")
def edge_discover(
    url: Annotated[str, typer.Argument(help="http://host:port (MTConnect), focas://host, opc.tcp://host:port, lsv2://host")],
    device: Annotated[
        str, typer.Option(help="MTConnect: which of several devices, else the first. All others: the machine's name")
    ] = "",
) -> None:
    """Draft a configuration from a control's own description."""
    from edge.check import discover

    sys.stdout.write(discover(url, device=device))


app.command()(serve)
app.command()(optimise)
app.command("replay")(replay_history)
app.command()(validate)


def _twin() -> ModuleType:
    """The commands of the twin, which need what the extra brings: arrays, kernels, Parquet."""
    try:
        from cnctwin.commands import twin as twin_commands
    except ModuleNotFoundError as missing:
        raise UsageError(f"the twin needs the package {missing.name}; pip install 'cnctwin[twin]' brings it") from None
    return twin_commands


def _gap() -> ModuleType:
    """The commands of the gap, which need what the twin needs."""
    _twin()
    from cnctwin.commands import gap as gap_commands

    return gap_commands


def _console() -> Console:
    """Standard output; into a file or a pipe it is as wide as the tables need."""
    console = Console()
    if not console.is_terminal:
        console.width = 120
    return console


def _print_json(value: Any) -> None:
    sys.stdout.write(json.dumps(value, default=str) + "\n")


def main() -> None:
    """Run the command; every expected error is one line on stderr."""
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(message)s")
    try:
        # Standalone, typer would report a wrong option in a box of several lines.
        code = app(standalone_mode=False)
    except TyperException as error:
        _explain(error)
    except BrokerStartError as error:
        _fail(error, 1)
    except (ApplicationError, EdgeError, ProcessorError, SparkplugError, TwinError) as error:
        _fail(error, 2)
    raise SystemExit(code)


def _explain(error: TyperException) -> NoReturn:
    message = error.format_message()
    if not message:  # A command without arguments: its help has been shown already.
        raise SystemExit(2)
    context = getattr(error, "ctx", None)
    _fail(f"{message.rstrip('.')}; see {'cnctwin' if context is None else context.command_path} --help", 2)


def _fail(error: object, code: int) -> NoReturn:
    print(f"cnctwin: {error}", file=sys.stderr)
    raise SystemExit(code)
