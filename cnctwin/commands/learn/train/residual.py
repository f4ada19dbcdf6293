"""`cnctwin train residual` on the command line; `cnctwin/training/residual` does it, and is imported when it is run."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, Config, From, Machines, Seed, StorePlace, To
from cnctwin.errors import UsageError
from cnctwin.terminal.moment import moment_ms


def train_residual(
    machine: Annotated[str, typer.Option(help="Name of the machine, as the store has it")],
    out: Annotated[Path, typer.Option(help="Folder of models; the model goes to <out>/residual/<machine>/<version>")],
    files: Annotated[
        list[Path] | None, typer.Argument(help="Run logs (Parquet or CSV), oldest first, in place of a store")
    ] = None,
    store: StorePlace = None,
    from_: From = None,
    to: To = None,
    config: Config = None,
    machines: Machines = None,
    hours_min: Annotated[float, typer.Option(min=0.0, help="Hours of cutting that there have to be")] = 40.0,
    held_share: Annotated[float, typer.Option(help="Last part of the time, held out to judge by")] = 0.3,
    features: Annotated[str, typer.Option(help="published, remembering or lean; else chosen on held-out time")] = "",
    trees: Annotated[int, typer.Option(min=1, max=2000, help="Trees of the forest")] = 300,
    depth: Annotated[int, typer.Option(min=1, max=30, help="Greatest depth of a tree")] = 14,
    leaf: Annotated[int, typer.Option(min=1, help="Fewest rows in a leaf")] = 5,
    row_s: Annotated[float, typer.Option(min=1.0, max=600.0, help="A row of training every so long")] = 30.0,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Learn the error of the spindle's heat model. Exit code 1: no significant improvement, so no model is written."""
    try:
        from cnctwin.training.residual import train as command
    except ImportError as error:
        raise UsageError(
            f"{error.name} is not installed, which trains models: pip install 'cnctwin[anomaly,historian]'"
        ) from None
    given = tuple(files or ())
    stretch = (_moment(from_, "--from"), _moment(to, "--to"))
    wanted = command.Wanted(machine, given, "" if given else store or "", *stretch, config, machines, hours_min)
    asked = command.TrainingSettings(trees, depth, leaf, row_s, held_share, features, seed)
    raise typer.Exit(command.train_residual(wanted, asked, out, as_json=as_json, console=Console()))


def _moment(text: str | None, option: str) -> int | None:
    return moment_ms(text, option) if text else None
