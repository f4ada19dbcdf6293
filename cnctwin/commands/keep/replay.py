"""`cnctwin replay`: the processors again over history, beside what they published then."""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, Config, FromNeeded, StorePlace, To
from cnctwin.terminal.moment import moment_text, stretch_ms


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
    from cnctwin.memory.replay import replay
    from cnctwin.memory.replay.report import shown
    from cnctwin.memory.store.opening import default_place, open_store
    from processors.config import read_tables

    from_ms, to_ms = stretch_ms(begin, end)
    tables = {} if config is None else read_tables(config)
    names = None if processors is None else [name.strip() for name in processors.split(",") if name.strip()]
    opened = open_store(store or default_place())
    try:
        replayed = replay(opened, machine, from_ms, to_ms, names, tables, chain=chain)
    finally:
        opened.close()
    notes = configuration_notes(config, tables, [one.name for one in replayed.processors], to_ms)
    if as_json:
        configuration = {"file": None if config is None else str(config), "notes": notes}
        sys.stdout.write(json.dumps(replayed.as_json() | {"configuration": configuration}, default=repr) + "\n")
    else:
        shown(replayed, Console())
        for note in notes:
            Console().print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(0 if replayed.is_equal else 1)


def configuration_notes(config: Path | None, tables: Mapping[str, object], names: Sequence[str], to_ms: int) -> list[str]:
    """Return what may make the configuration of this replay another than that of the day, a sentence each."""
    if config is None:
        return [
            f"no --config: {', '.join(names)} ran with default settings, not with those of that day; give the file as it was then"
        ]
    notes = []
    changed_ms = config.stat().st_mtime * 1000.0
    if changed_ms > to_ms:
        when = moment_text(changed_ms)
        notes.append(f"{config} was changed on {when} UTC, after this stretch; it may not be the configuration of that day")
    if missing := [name for name in names if name not in tables]:
        notes.append(f"{config} has no table for {', '.join(missing)}; default settings were used")
    return notes
