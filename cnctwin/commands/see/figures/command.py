"""`cnctwin figures`: OEE, stops, parts and energy by machine, shift, part or program, folded out of the store."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from cnctwin.commands.options import AsJson, Config, FromNeeded, StorePlace, To
from cnctwin.commands.see.figures.shown import show
from cnctwin.errors import UsageError
from cnctwin.figures.comma_separated import to_csv
from cnctwin.figures.documents import read_records
from cnctwin.figures.table import Asked, By, table, time_zone_of
from cnctwin.terminal.moment import stretch_ms
from processors.config import read_tables

NAME = "production"


def figures(
    begin: FromNeeded,
    end: To = None,
    machine: Annotated[str | None, typer.Option(help="One machine; else --all", show_default=False)] = None,
    every: Annotated[bool, typer.Option("--all", help="All machines of the store")] = False,
    by: Annotated[By, typer.Option(help="The rows of the table")] = By.SHIFT,
    store: StorePlace = None,
    config: Config = None,
    calendar: Annotated[
        Path | None, typer.Option(help="Shift calendar, in place of the configured one", show_default=False)
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write CSV to this file; - = standard output", show_default=False)] = None,
    as_json: AsJson = False,
) -> None:
    """OEE, stops by reason, parts and energy, folded out of the store as the processor `production` does live.

    The shift that holds the moment of --from is counted whole.
    """
    from cnctwin.figures.folding import folded
    from cnctwin.memory.store.opening import default_place, open_store

    if (machine is None) is not every:
        raise UsageError("name one machine with --machine, or all of them with --all")
    from_ms, to_ms = stretch_ms(begin, end)
    settings = _settings(config, calendar)
    opened = open_store(store or default_place())
    try:
        known = opened.machines()
        if machine is not None and machine not in known:
            raise UsageError(f"the store has no machine {machine!r}; it has: {', '.join(known) or 'none'}")
        chosen = known if machine is None else [machine]
        texts = [text for name in chosen for text in folded(opened, name, from_ms, to_ms, settings)]
    finally:
        opened.close()
    shifts, parts, _ = read_records(texts)
    time_zone = time_zone_of(shifts)
    first_ms = min((one.begin for one in shifts if one.begin <= from_ms < one.end), default=from_ms)
    share = {"known_share_min": settings["known_share_min"]} if "known_share_min" in settings else {}
    rows = table(shifts, parts, Asked(by, first_ms, to_ms, **share))
    if csv is not None and str(csv) != "-":
        csv.write_text(to_csv(rows, by), encoding="utf-8", newline="")
    elif csv is not None:
        sys.stdout.write(to_csv(rows, by))
    if as_json:
        sys.stdout.write(
            json.dumps({"from": from_ms, "to": to_ms, "by": str(by), "time_zone": time_zone, "rows": rows}, ensure_ascii=False)
            + "\n"
        )
    elif csv is None:
        show(rows, by, time_zone)


def _settings(config: Path | None, calendar: Path | None) -> dict[str, Any]:
    """Return the table of `production`, with the paths in it as they stand."""

    settings = {} if config is None else dict(read_tables(config).get(NAME, {}))
    return settings if calendar is None else settings | {"calendar": str(calendar)}
