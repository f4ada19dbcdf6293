"""`cnctwin train detector` on the command line; `cnctwin/training/detector` does it, and is imported when it is run."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, Seed
from cnctwin.errors import UsageError


def train_detector(
    runs: Annotated[list[Path], typer.Argument(help="Run logs of one machine (Parquet or CSV)")],
    out: Annotated[Path | None, typer.Option(help="Folder for the model")] = None,
    signal: Annotated[str, typer.Option(help="spindle_rpm, spindle_current_a or spindle_load_pct")] = "spindle_rpm",
    at: Annotated[
        list[float] | None, typer.Option(help="Time of a captured change in the first run, s; else labels are used")
    ] = None,
    candidates: Annotated[
        Path | None, typer.Option(help="List transients for you to label (.csv or .json), in place of a model")
    ] = None,
    false_gates_per_day: Annotated[float, typer.Option(min=0.001, help="False gates a day that the limit is set for")] = 1.0,
    before_s: Annotated[float, typer.Option(min=0.5, max=120.0, help="Seconds before --at that belong to the change")] = 12.0,
    after_s: Annotated[float, typer.Option(min=0.5, max=120.0, help="Seconds after --at that belong to the change")] = 8.0,
    stall_s: Annotated[float, typer.Option(min=0.0, max=60.0, help="How much longer a change may take")] = 4.0,
    period_s: Annotated[float, typer.Option(min=0.01, max=10.0, help="Sample period of the model")] = 0.1,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Learn what a tool change of a control that reports none looks like, from captures or labels."""
    try:
        from cnctwin.training.detector.train import train_detector as train
        from twin.transient.training import TrainingSettings
    except ImportError as error:
        raise UsageError(f"{error.name} is not installed, which trains detectors: pip install 'cnctwin[twin]'") from None
    asked = TrainingSettings(signal, before_s, after_s, stall_s, false_gates_per_day)
    train(runs, asked, out, at or [], candidates, period_s, seed, as_json, Console())
