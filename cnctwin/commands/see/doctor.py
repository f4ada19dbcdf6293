"""`cnctwin doctor`: is everything connected, in order and accounted for?"""

import json
import logging
import sys
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import AsJson, Broker, Group
from cnctwin.errors import UsageError
from cnctwin.processes.given_broker import address
from cnctwin.terminal.console import standard_output

STYLES = {"good": "green", "note": "cyan", "bad": "bold red"}
UNMAPPED = "unmapped"
"""The reason for which an edge drops what its configuration has no signal for."""


def doctor(
    broker: Broker = None,
    group: Group = "cnc",
    seconds: Annotated[float, typer.Option(help="How long to listen, in seconds", min=1.0, max=600.0)] = 4.0,
    bundle: Annotated[
        Path | None,
        typer.Option(help="Write a zip for a bug report: versions, configuration, logs; no secrets", show_default=False),
    ] = None,
    include: Annotated[
        list[Path] | None,
        typer.Option(
            help="Configuration or log for the bundle, a file or a folder; may be given again; else processors.toml, edges, "
            "machines, logs and state/logs of this folder",
            show_default=False,
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Is everything connected, in order and accounted for: received = emitted + dropped + buffered?"""
    from cnctwin.plant.doctor import examine
    from cnctwin.plant.screen import ledger_table
    from sparkplug.broker import BrokerAddress

    logging.getLogger("sparkplug").setLevel(logging.ERROR)  # what is wrong with the connection stands in the report
    if include and bundle is None:
        raise UsageError("--include is for a bundle; name its file with --bundle")
    report = examine(address(broker) or BrokerAddress(), group, seconds)
    if as_json:
        sys.stdout.write(json.dumps(report.as_json(), default=str) + "\n")
    else:
        console = standard_output()
        for finding in report.findings:
            console.print(f"{finding.mark:<4}", style=STYLES[finding.mark], end=" ")
            console.print(finding.text, markup=False, highlight=False, soft_wrap=True)
        if report.ledgers:
            console.print(ledger_table(report.ledgers))
            if any(UNMAPPED in ledger.reasons for ledger in report.ledgers):
                console.print(f"{UNMAPPED}: values that the control offers and the edge's configuration gives no signal")
    if bundle is not None:
        from cnctwin.plant.bundle import summary, write_bundle

        names = write_bundle(bundle, report.as_json(), include or ())
        print(summary(bundle, names), file=sys.stderr)
    raise typer.Exit(0 if report.good else 1)
