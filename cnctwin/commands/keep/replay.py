"""`cnctwin replay`: the processors again over history, beside what they published then."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, StorePlace
from cnctwin.memory.replay import replay
from cnctwin.memory.replay.report import shown
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.terminal.moment import moment_ms
from processors.config import read_tables


def replay_history(
    machine: Annotated[str, typer.Option(help="The machine, as the store names it")],
    begin: Annotated[str, typer.Option("--from", help="ISO 8601, or ms since 1970")],
    end: Annotated[str, typer.Option("--to", help="ISO 8601, or ms since 1970; not in it any more")],
    store: StorePlace = None,
    processors: Annotated[
        str | None, typer.Option(help="thermal,gap,…; else all that published then", show_default=False)
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Their configuration as it was then, a table for each")] = None,
    chain: Annotated[
        bool, typer.Option("--chain", help="Feed each with what the others give now, not with what they gave")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Run the processors again over history and compare with what they published then. Exit code 1: it differs."""
    from_ms, to_ms = moment_ms(begin, "--from"), moment_ms(end, "--to")
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
