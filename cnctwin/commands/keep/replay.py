"""`cnctwin replay`: the processors again over history, beside what they published then."""

import json
import sys
from typing import Annotated

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, Config, FromNeeded, StorePlace, To
from cnctwin.memory.replay import replay
from cnctwin.memory.replay.report import shown
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.terminal.moment import stretch_ms
from processors.config import read_tables


def replay_history(
    machine: Annotated[str, typer.Option(help="Name of the machine, as the store has it")],
    begin: FromNeeded,
    end: To = None,
    store: StorePlace = None,
    processors: Annotated[
        str | None, typer.Option(help="thermal,gap,…; else all that published then", show_default=False)
    ] = None,
    config: Config = None,
    chain: Annotated[
        bool, typer.Option("--chain", help="Feed each with what the others give now, not with what they gave")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Run the processors again over history and compare with what they published then. Exit code 1: it differs."""
    from_ms, to_ms = stretch_ms(begin, end)
    tables = {} if config is None else read_tables(config)
    names = None if processors is None else [name.strip() for name in processors.split(",") if name.strip()]
    opened = open_store(store or default_place())
    try:
        replayed = replay(opened, machine, from_ms, to_ms, names, tables, chain=chain)
    finally:
        opened.close()
    if as_json:
        sys.stdout.write(json.dumps(replayed.as_json(), default=repr) + "\n")
    else:
        shown(replayed, Console())
    raise typer.Exit(0 if replayed.is_equal else 1)
