"""`cnctwin process`: processors until they are stopped."""

from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Group, Machines
from cnctwin.machines.place import machines_folder
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from edge.state_dir import state_dir as folder_for_state


def process(
    names: Annotated[list[str], typer.Argument(help="thermal, cutting_force, mirror, …")],
    config: Annotated[Path | None, typer.Option(help="TOML with a table for each processor")] = None,
    broker: Broker = None,
    group: Group = "cnc",
    state_dir: Annotated[
        Path | None, typer.Option(help="Keeps birth/death numbers; else $CNCTWIN_STATE_DIR or ~/.local/state/cnctwin")
    ] = None,
    machines: Machines = None,
) -> None:
    """Run processors until SIGTERM or Ctrl-C; beside alerts the courier that sends, beside historian the store that it keeps."""
    from cnctwin.running.processors import process as run_processors
    from processors.running.limits import limits_of
    from processors.running.runtime import configured

    pairs, limits = configured(names, config), limits_of(config)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        run_processors(
            pairs,
            where,
            stop,
            group=group,
            state_dir=folder_for_state(state_dir),
            limits=limits,
            machines=machines_folder(machines, config),
        )
