"""Whether the program takes a command line, without running it."""

from collections.abc import Sequence
from typing import Any

import typer.main

from cnctwin.cli import app


def parsed(words: Sequence[str]) -> dict[str, Any]:
    """The options and arguments of `cnctwin <words>`. Raises what the program would refuse them with."""
    command: Any = typer.main.get_command(app)
    context = command.make_context("cnctwin", list(words), resilient_parsing=False)
    while hasattr(command, "resolve_command"):
        name, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        context = command.make_context(name, rest, parent=context)
    return dict(context.params)
