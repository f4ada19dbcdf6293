"""`cnctwin parts`: the as-built records of parts."""

import json
import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

import typer
from rich.console import Console
from rich.table import Table

from cnctwin.commands.options import From, StateDir, StorePlace, To
from cnctwin.errors import UsageError
from cnctwin.memory.parts.journal import Journal
from cnctwin.memory.parts.record_log import parts
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.moment import moment_ms, stretch_ms
from edge.state_dir import state_dir as folder_for_state
from processors.alerts.courier.secret import read_secret
from processors.alerts.receivers import names_secret, url_fault

if TYPE_CHECKING:
    from cnctwin.memory.parts.delivery import Receiver

parts_app = typer.Typer(no_args_is_help=True, help="As-built records of parts: list, export, deliver to an MES or a PLM.")
Machine = Annotated[str | None, typer.Option(help="Name of the machine; else all", show_default=False)]
EVERY_S = 5.0


@parts_app.command("list")
def list_parts(machine: Machine = None, store: StorePlace = None, begin: From = None, end: To = None) -> None:
    """One line for each part."""
    table = Table()
    for column in ("machine", "no.", "program", "began", "ended", "cycle s", "active s", "interrupted s", "complete"):
        table.add_column(column)
    for record in _records(machine, store, begin, end):
        cycle = record["cycle"]
        figures = [cycle["cycle_time_s"], cycle["active_s"], cycle["interrupted_s"]]
        shown = [record["machine"], record["part_number"], record["program"], record["began"], record["ended"], *figures]
        complete = "yes" if record["complete"] else "no: " + "; ".join(record["reasons"])
        table.add_row(*("–" if one is None else str(one) for one in shown), complete)
    Console().print(table)


@parts_app.command("export")
def export(
    machine: Machine = None,
    store: StorePlace = None,
    begin: From = None,
    end: To = None,
    out: Annotated[Path | None, typer.Option(help="A file; else standard output", show_default=False)] = None,
) -> None:
    """All records as JSON, one a line."""
    lines = (json.dumps(record, ensure_ascii=False) + "\n" for record in _records(machine, store, begin, end))
    if out is None:
        sys.stdout.writelines(lines)
    else:
        out.write_text("".join(lines), encoding="utf-8")


@parts_app.command("deliver")
def deliver(
    url: Annotated[str, typer.Option(help="https://…, or $NAME or file:/path that holds it")],
    secret: Annotated[
        str | None, typer.Option(help="$NAME or file:/path: signs each record (HMAC-SHA256)", show_default=False)
    ] = None,
    bearer: Annotated[str | None, typer.Option(help="$NAME or file:/path: a token", show_default=False)] = None,
    machine: Machine = None,
    store: StorePlace = None,
    since: Annotated[
        str | None, typer.Option(help="Parts finished before it are not sent; else before the first start", show_default=False)
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Deliver what is due, then end; 1 = something could not be")] = False,
    state_dir: StateDir = None,
) -> None:
    """Send each record by POST, at least once and in order; a receiver knows it again by its id."""
    from cnctwin.memory.parts.delivery import Delivery

    receiver = _receiver(url, secret, bearer)
    name = re.sub(r"[^A-Za-z0-9.-]", "_", f"{urlsplit(receiver.url).hostname}{urlsplit(receiver.url).path}")[:100]
    journal = Journal.read(folder_for_state(state_dir) / "parts" / f"{name}.json")
    if since is not None or journal.since_ms is None:
        journal.begin(time.time_ns() // 1_000_000 if since is None else moment_ms(since, "--since"))
    with stopped_by_signals() as stop:
        opened = open_store(store or default_place())
        try:
            delivery = Delivery(opened, receiver, journal)
            while not stop.is_set():
                machines = opened.machines() if machine is None else [machine]
                done = delivery.round(machines, time.time_ns() // 1_000_000)
                if done.delivered or done.refused or done.given_up or done.reason:
                    sys.stderr.write(
                        f"{done.delivered} delivered, {done.refused} refused, {done.given_up} given up"
                        + (f"; waits: {done.reason}\n" if done.reason else "\n")
                    )
                if once:
                    raise typer.Exit(1 if done.waits_s is not None or done.refused else 0)
                stop.wait(done.waits_s or EVERY_S)
        finally:
            opened.close()


def _receiver(url: str, secret: str | None, bearer: str | None) -> "Receiver":
    from cnctwin.memory.parts.delivery import Receiver

    address = read_secret(url) if names_secret(url) else url
    fault = url_fault(address)
    if fault is not None:
        raise UsageError(f"--url {fault}")
    for option, text in (("--secret", secret), ("--bearer", bearer)):
        if text is not None and not names_secret(text):
            raise UsageError(f"{option}: a secret does not stand on a command line; write $NAME or file:/path")
    return Receiver(address, bearer and read_secret(bearer), secret and read_secret(secret))


def _records(machine: str | None, store: str | None, begin: str | None, end: str | None) -> list[dict[str, Any]]:
    from_ms, to_ms = stretch_ms(begin, end)
    opened = open_store(store or default_place())
    try:
        known = opened.machines()
        if machine is not None and machine not in known:
            raise UsageError(f"the store has no machine {machine!r}; it has: {', '.join(known) or 'none'}")
        found = [part for name in known if machine in (None, name) for part in parts(opened, name, from_ms, to_ms)]
    finally:
        opened.close()
    return [part.record for part in sorted(found)]
