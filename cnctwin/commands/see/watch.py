"""`cnctwin watch`: the plant live in the terminal."""

from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Group
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals


def watch(
    machine: Annotated[str | None, typer.Argument(help="Name of the machine; else all")] = None,
    broker: Broker = None,
    group: Group = "cnc",
) -> None:
    """Live view in the terminal: each machine with the twin beside it, and the ledger of each stage."""
    from cnctwin.plant.watch import watch as look

    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        look(where, group, machine, stop)
