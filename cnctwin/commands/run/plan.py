"""`cnctwin plan`: what a plant needs before it is bought.

Exit codes: 0 = this computer is enough, 1 = it is not, 2 = wrong input.
"""

import json
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from cnctwin.commands.options import AsJson

if TYPE_CHECKING:
    from cnctwin.planning.fleet import FleetPlan
    from cnctwin.planning.kafka import KafkaPlan

plan_app = typer.Typer(no_args_is_help=True, help="What a plant needs: processes, cores, memory, disk.")


@plan_app.callback()
def plan() -> None:
    """Keep `fleet` a subcommand while it is the only one."""


@plan_app.command("fleet")
def plan_fleet_command(
    machines: Annotated[int, typer.Option(help="How many machines", min=1)],
    hz: Annotated[float, typer.Option(help="Messages a second of each")] = 10.0,
    metrics: Annotated[int, typer.Option(help="Metrics of each; 11 of 13 are taken to change in a message", min=1)] = 13,
    processors: Annotated[str, typer.Option(help="all, names with commas, or how many: the dearest")] = "all",
    cores: Annotated[int | None, typer.Option(help="Cores of the computer; else as this one has", min=1)] = None,
    disk: Annotated[float | None, typer.Option("--disk-gb", help="Room for the store; else what is free here", min=0.001)] = None,
    measure: Annotated[
        bool, typer.Option("--measure", help="Run the code for 20 s and scale the figures to this computer")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say what a fleet needs (processes, cores, memory, disk, network), and when one computer is not enough."""
    from cnctwin.planning.calibration import calibrated_us
    from cnctwin.planning.fleet import Computer, Fleet, chosen, plan_fleet
    from cnctwin.planning.kafka import plan_kafka
    from cnctwin.planning.measured import MEASURED

    names = chosen(processors, MEASURED)
    fleet = Fleet(machines, hz, metrics)
    disk_bytes = shutil.disk_usage(Path.home()).free if disk is None else round(disk * 1e9)
    calibration_us = calibrated_us() if measure else None
    slowness = 1.0 if calibration_us is None else calibration_us / MEASURED.calibration_us
    made = plan_fleet(fleet, names, Computer(cores or os.cpu_count() or 1, disk_bytes), slowness=slowness)
    beyond = plan_kafka(fleet, names, slowness=slowness) if made.limits else None
    if as_json:
        kafka = None if beyond is None else beyond.as_json()
        sys.stdout.write(json.dumps(made.as_json() | {"calibration_us": calibration_us, "kafka": kafka}) + "\n")
    else:
        _show(made, Console())
        if beyond is not None:
            _show_kafka(beyond, Console())
    raise typer.Exit(1 if made.limits else 0)


def _show(made: "FleetPlan", console: Console) -> None:
    fleet = made.fleet
    console.print(
        f"{fleet.machines} machines, {fleet.hz:g} Hz, {fleet.metrics} metrics; {made.basis}", soft_wrap=True, highlight=False
    )
    table = Table()
    for column in ("process", "of a core", "memory"):
        table.add_column(column, justify="left" if column == "process" else "right")
    for one in made.processes:
        words = "all" if len(made.processes) == 1 else " ".join(one.processors)
        table.add_row(f"cnctwin process {words}", f"{100 * one.cores:.0f} %", f"{one.memory_mb:.0f} MB")
    table.add_row("Mosquitto", f"{100 * made.broker_cores:.0f} %", "")
    console.print(table)
    if made.groups > 1:
        share = -(-fleet.machines // made.groups)
        console.print(
            f"all of it {made.groups} times: {made.groups} groups of {share} machines, each with a broker", soft_wrap=True
        )
    console.print(
        f"{made.cores:.1f} cores used, {made.memory_mb / 1000:.1f} GB of memory with a margin; "
        f"{made.in_mbit_s:.1f} Mbit/s from the edges, {made.mirror_mbit_s:.1f} Mbit/s to one reader of the whole mirror",
        soft_wrap=True,
        highlight=False,
    )
    if made.store is not None:
        load, a_day = made.store.load, made.store.year_bytes / 365.25
        console.print(
            f"disk: {a_day / 1e9:.1f} GB a day, {made.store.year_bytes / 1e12:.2f} TB a year "
            f"({load.for_ever * 365.25 / 1e9:.0f} GB of it for ever); `cnctwin store plan` proposes what to keep",
            soft_wrap=True,
            highlight=False,
        )
    if made.limits:
        console.print(
            f"One computer is not enough: {'; '.join(made.limits)}. With a margin it holds about {made.machines_max} machines "
            "like these. Beyond that take several computers with a group of machines each, or Kafka under the folds.",
            soft_wrap=True,
            highlight=False,
        )
    else:
        console.print(
            f"One computer is enough, up to about {made.machines_max} machines like these.", soft_wrap=True, highlight=False
        )


def _show_kafka(beyond: "KafkaPlan", console: Console) -> None:
    from cnctwin.planning.measured import ON_KAFKA

    console.print(
        f"\nOn Kafka (docs/how-to/kafka.md), by what was measured {ON_KAFKA.date} on {ON_KAFKA.computer}; ~ is an extrapolation:",
        soft_wrap=True,
        highlight=False,
    )
    for need in beyond.needs:
        mark = "~" if need.is_extrapolated else " "
        console.print(f"{mark} {need.what + ':':15} {need.need}", soft_wrap=True, highlight=False, markup=False)
        console.print(f"{'':18}from {need.basis}", soft_wrap=True, highlight=False, markup=False)
