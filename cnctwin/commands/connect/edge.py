"""`cnctwin edge`: run an edge, check its configuration, draft one."""

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from cnctwin.commands.options import AsJson, Broker
from cnctwin.errors import UsageError
from cnctwin.processes.given_broker import address
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.table import left_out, text_table

if TYPE_CHECKING:
    from edge.adapter import Row

REASON_CHARACTERS_MAX = 40
"""The length of a reason that a table may repeat."""
COLUMNS = ("signal", "from", "unit", "native unit", "value now", "why not")
edge_app = typer.Typer(no_args_is_help=True, help="Turn what a control says into Sparkplug B metrics.")


@edge_app.command()
def run(
    config: Annotated[Path, typer.Argument(help="The TOML file of one machine, or a folder with one for each")],
    broker: Broker = None,
) -> None:
    """Run an edge, or one for each file of a folder, until SIGTERM or Ctrl-C; changes of the files are taken up."""
    from cnctwin.running.edges import run as run_edges

    with stopped_by_signals() as stop:
        run_edges(config, address(broker), stop)


@edge_app.command()
def check(config: Annotated[Path, typer.Argument(help="The TOML file of one machine")], as_json: AsJson = False) -> None:
    """Check a configuration against its control and show what would be published, without a broker."""
    from edge.check import check as rows_of

    if config.is_dir():
        raise UsageError(f"{config}: is a folder; check one of its files at a time")
    rows = rows_of(config)
    if as_json:
        sys.stdout.write(json.dumps([asdict(row) for row in rows], default=str) + "\n")
    else:
        console, reasons = standard_output(), repeated(rows)
        table = _table(rows, reasons, console.width)
        console.print(table)
        if missing := left_out(table, COLUMNS):
            console.print(f"no room for: {', '.join(missing)}; a wider terminal or --json shows it", style="dim", soft_wrap=True)
        for number, reason in enumerate(reasons, 1):
            console.print(f"({number}) {reason}", markup=False, highlight=False, soft_wrap=True)


@edge_app.command()
def discover(
    url: Annotated[str, typer.Argument(help="http://host:port (MTConnect), focas://host, opc.tcp://host:port, lsv2://host")],
    device: Annotated[
        str, typer.Option(help="MTConnect: which of several devices, else the first. All others: the machine's name")
    ] = "",
) -> None:
    """Draft a configuration from a control's own description."""
    from edge.check import discover as draft

    sys.stdout.write(draft(url, device=device))


def repeated(rows: "Sequence[Row]") -> tuple[str, ...]:
    """Return the long reasons that several rows have: each is said once, below the table."""
    counts = Counter(row.reason for row in rows if row.reason and len(row.reason) > REASON_CHARACTERS_MAX)
    return tuple(reason for reason, count in counts.items() if count > 1)


def _table(rows: "Sequence[Row]", reasons: Sequence[str], width: int) -> Table:
    """Return the signals that an edge would publish, for a person to read. reasons: those that stand below, by number"""
    signals = sum(not row.signal.startswith("(") for row in rows)  # "(warning)" is none
    added = "the edge adds its own: tool_change_…, clock_offset_…, stamp_clock and edge_sequence"
    cells = []
    for row in rows:
        value = "–" if row.value is None else str(row.value)
        why = f"({reasons.index(row.reason) + 1}) below" if row.reason in reasons else row.reason or ""
        cells.append((row.signal, row.source, row.unit or "", row.native_unit or "", value, why))
    title = f"{signals} signals would be published; {added}"
    return text_table(COLUMNS, cells, width, ("native unit", "unit", "from"), title=title, show_edge=True)
