"""The options of all commands, read as one table: the same thing has one name, one help and one default."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
import typer
import typer.main

from cnctwin.cli import GROUPS, app
from cnctwin.terminal.without_argument import EXAMPLES, explained

SAME = {
    "--broker",
    "--config",
    "--dask",
    "--device",
    "--from",
    "--group",
    "--json",
    "--kafka",
    "--speed",
    "--state-dir",
    "--store",
}
SAME |= {"--to", "--every", "--no-open"}
TO_SAY_MORE = {("validate", "--from"), ("validate", "--broker"), ("edge discover", "--device"), ("jobs submit", "--machine")}
TO_SAY_MORE |= {("init", "--broker"), ("init", "--device")}


class Option(NamedTuple):
    """An option or argument of a command."""

    command: str
    names: tuple[str, ...]
    required: bool
    help: str
    default: Any


def _walked(command: Any, path: str) -> Iterator[Option]:
    for name, inner in getattr(command, "commands", {}).items():
        yield from _walked(inner, f"{path} {name}")
    if not hasattr(command, "commands"):
        for one in command.params:
            names = tuple(one.opts) if one.param_type_name == "option" else ()
            yield Option(path, names, one.required, one.help or "", one.default)


def options() -> list[Option]:
    """Return the options of every command."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group)
    return [one for name in group.list_commands(context) for one in _walked(group.get_command(context, name), name)]


OPTIONS = options()


def test_the_table_holds_every_command() -> None:
    assert {one.command.split()[0] for one in OPTIONS} == {name for group in GROUPS for name in group.commands}
    assert len(OPTIONS) > 300


@pytest.mark.parametrize("name", sorted(SAME))
def test_an_option_says_the_same_in_every_command(name: str) -> None:
    found = [one for one in OPTIONS if name in one.names and (one.command, name) not in TO_SAY_MORE]
    assert len(found) > 1
    helps = {one.help.removesuffix("; else from the beginning") for one in found}
    assert len(helps) == 1, {one.command: one.help for one in found}


def test_the_end_of_a_stretch_is_now_where_it_is_left_out() -> None:
    found = [one for one in OPTIONS if "--to" in one.names]
    assert len(found) >= 13
    assert {(one.required, one.default) for one in found} == {(False, None)}
    assert {one.command for one in found} == {one.command for one in OPTIONS if "--from" in one.names}


def test_what_was_called_otherwise_still_works_and_has_the_common_name() -> None:
    """A name that one command had of its own stays as a second name beside that of all others."""
    pairs = {
        ("simulate", "--machine-file"),
        ("expect", "--machine-file"),
        ("optimise", "--machine-file"),
        ("alerts ack", "--comment"),
        ("alerts ack", "--why"),
        ("model promote", "--because"),
        ("model promote", "--why"),
        ("jobs run", "--dir"),
        ("jobs run", "--jobs"),
        ("jobs run", "--jobs-files"),
        ("model golden", "--run"),
        ("model golden", "--runs"),
    }
    assert pairs <= {(one.command, name) for one in OPTIONS for name in one.names}


def test_an_option_is_explained_by_words_that_stand_alone() -> None:
    """A help is read in a list, in any order: it cannot lean on the line before it."""
    leaning = re.compile(r"(Of|And|Or|Its|The same|That|Whose)\b")
    assert [one for one in OPTIONS if not one.help or leaning.match(one.help)] == []


def test_an_option_without_its_argument_gets_an_example_and_its_own_command() -> None:
    group = typer.main.get_command(app)
    for option in OPTIONS:
        if not option.names or isinstance(option.default, bool):
            continue
        told = explained(group, option.command.split(), option.names[0])
        assert told and f"as in {option.names[0]} " in told and told.endswith(f"see cnctwin {option.command} --help"), option
    assert EXAMPLES.keys() <= {name for option in OPTIONS for name in option.names}
