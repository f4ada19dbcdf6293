"""The command `cnctwin`.

Exit codes: 0 = done, 1 = the answer is bad news, 2 = wrong input. Errors are one line on stderr that names the culprit, the value
and the way out.
"""

import logging
import sys
from importlib import import_module
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException
from typer.main import get_group

from cnctwin.errors import ApplicationError, BrokerStartError
from cnctwin.files.modes import restrict
from edge.errors import EdgeError
from processors.errors import ProcessorError
from sparkplug.errors import SparkplugError
from twin.errors import TwinError

COMMANDS = {
    "demo": "cnctwin.commands.demo:demo",
    "init": "cnctwin.commands.starting.init:init",
    "up": "cnctwin.commands.starting.up:up",
    "watch": "cnctwin.commands.watch:watch",
    "doctor": "cnctwin.commands.doctor:doctor",
    "process": "cnctwin.commands.process:process",
    "bridge": "cnctwin.commands.bridge:bridge",
    "simulate": "cnctwin.commands.simulate:simulate",
    "expect": "cnctwin.commands.expect:expect",
    "identify": "cnctwin.commands.identify:identify",
    "import": "cnctwin.commands.import_recording:import_recording",
    "record": "cnctwin.commands.record:record",
    "serve": "cnctwin.commands.serve:serve",
    "optimise": "cnctwin.commands.optimise:optimise",
    "replay": "cnctwin.commands.replay:replay_history",
    "validate": "cnctwin.commands.validate:validate",
    "edge": "cnctwin.commands.edge:edge_app",
    "gap": "cnctwin.commands.gap:gap_app",
    "simulate-control": "cnctwin.commands.simulate_control:control_app",
    "alerts": "cnctwin.commands.alerts:alerts_app",
    "train": "cnctwin.commands.train.app:train_app",
    "store": "cnctwin.commands.store:store_app",
    "parts": "cnctwin.commands.parts:parts_app",
    "figures": "cnctwin.commands.figures.command:figures",
    "jobs": "cnctwin.commands.jobs:jobs_app",
    "plan": "cnctwin.commands.plan:plan_app",
    "twin": "cnctwin.commands.twin:twin_app",
    "model": "cnctwin.commands.model:model_app",
}
"""The module and the name of each command, or group of commands, in the order of the help."""


class _Commands(TyperGroup):
    """The commands, each of which is loaded when it is asked for: all of them take longer than most of them run."""

    def list_commands(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]  # as click names it
        return list(COMMANDS)

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]
        place = COMMANDS.get(cmd_name)
        if place is None:
            return None
        module, _, name = place.partition(":")
        found = getattr(import_module(module), name)
        alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        if isinstance(found, typer.Typer):
            alone.add_typer(found, name=cmd_name)
        else:
            alone.command(cmd_name)(found)
        return get_group(alone).commands[cmd_name]


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="A digital twin of CNC machines.",
)


@app.callback()
def _entry() -> None:
    pass


def main() -> None:
    """Run the command; every expected error is one line on stderr."""
    restrict(sys.argv[1:])
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
