"""`cnctwin init`: set a plant's folder up, by questions or by options."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.errors import UsageError
from cnctwin.terminal.console import standard_output


def init(
    folder: Annotated[Path, typer.Argument(help="The plant's folder; it is made where it is missing")] = Path(),
    control: Annotated[
        str | None, typer.Option(help="Address of the control, as `edge discover` takes it; none = without one for now")
    ] = None,
    device: Annotated[str, typer.Option(help="MTConnect: which of several devices")] = "",
    machine: Annotated[
        str | None, typer.Option(help="Name of the machine; else that of the control's own description, in small letters")
    ] = None,
    broker: Annotated[str | None, typer.Option(help="mqtt[s]://[user@]host[:port]; private = one of our own")] = None,
    alerts: Annotated[
        str | None,
        typer.Option(
            help="pushover, https://… (http:// on this computer), an address of Apprise, or none; secrets from the environment"
        ),
    ] = None,
    machine_class: Annotated[
        str | None, typer.Option("--class", help="Starter description: vmc-40, hmc, lathe, router or five-axis")
    ] = None,
    service: Annotated[bool, typer.Option(help="Write a systemd unit, cnctwin.service")] = True,
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask nothing: what no option gives stays as it is, or has its default")
    ] = False,
) -> None:
    """Set a plant up: control, broker, alerts and machine are asked for, tried, and written; again, only what changes."""
    from cnctwin.processes.extras import needed_by

    with needed_by("the machine's description", "twin"):
        from cnctwin.running.plant_folder import PlantFolder
        from cnctwin.setting_up.dialog import Given, Prompts
        from cnctwin.setting_up.planned_files import write_all
        from cnctwin.setting_up.set_up import Answers, SetUp
    console = standard_output()

    def tell(text: str) -> None:
        console.print(text, markup=False, highlight=False, soft_wrap=True)

    root = folder.resolve()
    if root.exists() and not root.is_dir():
        raise UsageError(f"{folder}: is a file; give a folder")
    dialog = Given(tell) if yes else Prompts(tell)
    answers = Answers(control, device, machine, broker, alerts, machine_class, service)
    try:
        files = [file for file in SetUp(PlantFolder(root), answers, dialog).files() if file.changes]
        for file in files:
            for line in file.shown(root):
                tell(line)
        if files and dialog.ask(f"Write {'these' if len(files) > 1 else 'this'}? (y/n)", "y", "--yes").lower() not in (
            "y",
            "yes",
        ):
            raise typer.Exit(1)
    except KeyboardInterrupt:
        tell("\nnothing was written")
        raise typer.Exit(1) from None
    write_all(files)
    tell("nothing has changed" if not files else f"{len(files)} file{'s' if len(files) > 1 else ''} written")
    at = "" if root == Path.cwd() else f" {shlex.quote(str(folder))}"
    tell(f"start it with `cnctwin up{at}`; the page is on http://127.0.0.1:8080 then")
