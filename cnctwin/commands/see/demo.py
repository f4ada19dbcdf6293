"""`cnctwin demo`: a machine, its edge, a broker, the twin and the page, started together."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import AsJson, Devices, Speed
from cnctwin.demo.by_itself import ByItself
from cnctwin.processes.stopping import stopped_by_signals


def demo(
    recording: Annotated[Path | None, typer.Option(help="SHDR log or time|key|value text; else the simulated machine")] = None,
    devices: Devices = None,
    speed: Speed = 1.0,
    seconds: Annotated[float | None, typer.Option(help="Stop by itself after so long; else at Ctrl-C")] = None,
    port: Annotated[int | None, typer.Option(help="The private broker's port; else 1883 or a free one", min=1, max=65535)] = None,
    machine: Annotated[str | None, typer.Option(help="The device's name; else that of the device model")] = None,
    effect: Annotated[
        str,
        typer.Option(
            help="What the simulated machine hides from its twin: NAME, NAME@SIGNAL, either with :SIZE; random; or none"
        ),
    ] = "random",
    seed: Annotated[int | None, typer.Option(help="Seed for drawing the effect and its size; else another one each time")] = None,
    diagnose: Annotated[
        ByItself, typer.Option(help="Who begins the diagnosis; by hand = a person at the page")
    ] = ByItself.BY_ITSELF,
    promote: Annotated[
        ByItself | None,
        typer.Option(
            help="Who promotes its answer; else a person where this is a terminal, the loop where not", show_default=False
        ),
    ] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser")] = False,
    as_json: AsJson = False,
) -> None:
    """Show a machine, its edge, a real broker and the twin, and account for everything that went through."""
    from cnctwin.demo.demo import run
    from cnctwin.demo.parts import DemoOptions

    watched = sys.stdout.isatty() and not as_json
    promoted = promote or (ByItself.BY_HAND if watched else ByItself.BY_ITSELF)
    options = DemoOptions(recording, devices, speed, seconds, port, machine, as_json, no_open, effect, seed, diagnose, promoted)
    with stopped_by_signals() as stop:
        code = run(options, stop)
    raise typer.Exit(code)
