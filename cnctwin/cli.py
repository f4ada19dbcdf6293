"""The command `cnctwin`.

Exit codes: 0 = done, 1 = the answer is bad news, 2 = wrong input. Errors are on stderr, each a line that names the culprit, the
value and the way out; a file with several faults has a line for each.
"""

import logging
import sys
from importlib import metadata
from io import TextIOWrapper
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.main import get_group

from cnctwin.commands import connect, keep, learn, run, see, twin
from cnctwin.commands.group import CommandGroup
from cnctwin.errors import ApplicationError, BrokerStartError
from cnctwin.files.modes import restrict
from cnctwin.terminal.without_argument import explained
from edge.errors import EdgeError
from processors.errors import ProcessorError
from sparkplug.errors import SparkplugError
from twin.errors import TwinError

GROUPS: tuple[CommandGroup, ...] = (see.GROUP, connect.GROUP, run.GROUP, twin.GROUP, learn.GROUP, keep.GROUP)
"""The folders of commands, in the order of the help."""


class _Commands(TyperGroup):
    """The commands, each of which is loaded when it is run: loading all of them takes longer than most of them run.

    The help and the shell's completion list their names and summaries, which need no command.
    """

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self._listed = TyperGroup(
            name=self.name,
            help=self.help,
            params=self.params,
            commands=[
                TyperCommand(name, help=summary, rich_help_panel=group.title)
                for group in GROUPS
                for name, (_, summary) in group.commands.items()
            ],
            rich_markup_mode=self.rich_markup_mode,
        )
        self.commands = self._listed.commands  # from which a mistyped name finds its neighbour

    def list_commands(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]  # as click names it
        return list(self.commands)

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]
        group = next((group for group in GROUPS if cmd_name in group.commands), None)
        if group is None:
            return None
        found = group.loaded(cmd_name)
        alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        if isinstance(found, typer.Typer):
            alone.add_typer(found, name=cmd_name)
        else:
            alone.command(cmd_name)(found)
        return get_group(alone).commands[cmd_name]

    def format_help(self, ctx: typer.Context, formatter: Any) -> None:  # type: ignore[override]
        self._listed.format_help(ctx, formatter)

    def shell_complete(self, ctx: typer.Context, incomplete: str) -> list[Any]:  # type: ignore[override]
        listed = typer.Context(self._listed, info_name=ctx.info_name, resilient_parsing=True)
        return self._listed.shell_complete(listed, incomplete)


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="A digital twin of CNC machines.",
)


def _version(is_asked: bool) -> None:
    if is_asked:
        print(f"cnctwin {metadata.version('cnctwin')}")
        raise typer.Exit


@app.callback()
def _entry(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command; every expected error is one line on stderr."""
    restrict(sys.argv[1:])
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and "utf" not in stream.encoding.lower():
            stream.reconfigure(errors="replace")  # Windows' code pages have no →, and LANG=C has no µ
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
    context, option = getattr(error, "ctx", None), getattr(error, "option_name", None)
    if context is None and option and (told := explained(get_group(app), sys.argv[1:], option)):
        _fail(told, 2)
    joint = " See" if message.endswith("?") else "; see"
    _fail(f"{message.rstrip('.')}{joint} {'cnctwin' if context is None else context.command_path} --help", 2)


def _fail(error: object, code: int) -> NoReturn:
    print(f"cnctwin: {error}", file=sys.stderr)
    raise SystemExit(code)
