"""`cnctwin doctor`: is everything connected, in order and accounted for?"""

import json
import logging
import sys
from typing import Annotated

import typer

from cnctwin.commands.options import AsJson, Broker, Group
from cnctwin.processes.given_broker import address
from cnctwin.terminal.console import standard_output


def doctor(
    broker: Broker = None,
    group: Group = "cnc",
    seconds: Annotated[float, typer.Option(help="How long to listen", min=1.0, max=600.0)] = 4.0,
    as_json: AsJson = False,
) -> None:
    """Is everything connected, in order and accounted for: received = emitted + dropped + buffered?"""
    from cnctwin.plant.doctor import examine
    from cnctwin.plant.screen import ledger_table
    from sparkplug.broker import BrokerAddress

    logging.getLogger("sparkplug").setLevel(logging.ERROR)  # what is wrong with the connection stands in the report
    report = examine(address(broker) or BrokerAddress(), group, seconds)
    if as_json:
        sys.stdout.write(json.dumps(report.as_json(), default=str) + "\n")
    else:
        console = standard_output()
        for finding in report.findings:
            mark = "[green]good[/]" if finding.good else "[bold red]bad [/]"
            console.print(mark, end=" ")
            console.print(finding.text, markup=False, highlight=False, soft_wrap=True)
        if report.ledgers:
            console.print(ledger_table(report.ledgers))
    raise typer.Exit(0 if report.good else 1)
