"""docs/reference/commands.md: every command with its options, from the parsers themselves."""

import re
from collections.abc import Iterator
from typing import Any

from typer.main import get_group

from cnctwin.cli import app

HEAD = """\
# Commands

For whoever types a command or writes one into a script: every command with its arguments, options and defaults. `cnctwin COMMAND --help` shows the same
in a terminal. Exit codes: 0 = done, 1 = the answer is bad news, 2 = wrong input. This page is written by `scripts/reference`.
"""


def page() -> str:
    """Return the page: commands in the order of the help."""
    return "\n".join([HEAD, *_section(get_group(app), ["cnctwin"])]).rstrip() + "\n"


def _section(command: Any, names: list[str]) -> Iterator[str]:
    subcommands = command.list_commands(None) if hasattr(command, "list_commands") else []
    if len(names) > 1:
        yield f"{'#' * min(len(names), 3)} {' '.join(names)}\n"
        if command.help:
            yield re.sub(r"\s*\n\s*", " ", command.help.strip()) + "\n"
    parameters = [one for one in command.params if not getattr(one, "hidden", False) and one.name != "help"]
    if not subcommands and len(names) > 1:
        arguments = [_argument(one) for one in parameters if one.param_type_name == "argument"]
        options = "" if len(arguments) == len(parameters) else "[OPTIONS]"
        yield "```\n" + " ".join(word for word in (*names, options, *arguments) if word) + "\n```\n"
    if parameters and len(names) > 1:
        yield "| option | meaning | default |\n|---|---|---|"
        yield from map(_row, parameters)
        yield ""
    for name in subcommands:
        found = command.get_command(None, name)
        if not getattr(found, "hidden", False):
            yield from _section(found, [*names, name])


def _argument(one: Any) -> str:
    name = one.name.upper().replace("_", "-") + ("…" if one.nargs == -1 else "")
    return name if one.required else f"[{name}]"


def _row(one: Any) -> str:
    names = _argument(one).strip("[]") if one.param_type_name == "argument" else ", ".join([*one.opts, *one.secondary_opts])
    meaning = re.sub(r"\s+", " ", getattr(one, "help", None) or "").replace("|", "\\|")
    default = one.default
    if one.required:
        default = "required"
    elif default is None or callable(default) or default is False or default in ([], ()) or "Sentinel" in type(default).__name__:
        default = ""
    return f"| `{names}` | {meaning} | {getattr(default, 'value', default)} |"
