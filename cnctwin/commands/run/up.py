"""`cnctwin up`: run a plant's folder, until SIGTERM or Ctrl-C."""

from pathlib import Path
from typing import Annotated

import typer

from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output


def up(
    folder: Annotated[Path, typer.Argument(help="The plant's folder, as `cnctwin init` has set it up")] = Path(),
    port: Annotated[int, typer.Option(help="TCP port of the page, or a free one where it is taken", min=1, max=65535)] = 8080,
) -> None:
    """Run a plant: broker where it has none, edges, processors, memory, jobs, loop and page, each started again when it dies."""
    from cnctwin.running.plant import run
    from cnctwin.running.plant_folder import PlantFolder

    console = standard_output()
    with stopped_by_signals() as stop:
        run(
            PlantFolder(folder.resolve()),
            port,
            stop,
            lambda text: console.print(text, markup=False, highlight=False, soft_wrap=True),
        )
