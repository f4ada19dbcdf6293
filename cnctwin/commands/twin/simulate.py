"""`cnctwin simulate`: a part program on the twin."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from cnctwin.commands.options import AsJson, MachineDescription, StockBox
from cnctwin.errors import UsageError
from cnctwin.files.called_programs import with_called_programs
from cnctwin.files.output import check_suffix, write
from cnctwin.files.program_text import read_text
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from cnctwin.batch.simulation import Summary


def simulate(
    program: Annotated[Path, typer.Argument(help="The part program")],
    machine: MachineDescription,
    stock: StockBox = None,
    out: Annotated[Path | None, typer.Option(help="Write the run log there, .parquet or .csv")] = None,
    seed: Annotated[int | None, typer.Option(help="One noisy course of the machine instead of its mean course", min=0)] = None,
    as_json: AsJson = False,
) -> None:
    """Run a part program on the twin as on a machine: time, peak force, following error, and a run log."""
    with needed_by("the twin", "twin"):
        from cnctwin.batch.simulation import machine_to_simulate, summary_of
        from cnctwin.batch.stock import with_stock
        from twin.errors import PartProgramError
        from twin.runlog import write_run
        from twin.simulator.simulation import program_settings
        from twin.simulator.simulation import simulate as simulated
    described = with_stock(machine_to_simulate(machine), stock)
    check_suffix(out)
    text = read_text(program)
    with working("simulating"):
        try:
            settings = with_called_programs(program_settings(described), program, text)
            done = simulated(described, text, seed=seed, settings=settings, name=program.name)
        except PartProgramError as error:
            raise UsageError(f"{program}: {error}") from None
        if out is not None:
            write(lambda: write_run(done.run, out), out)
    summary = summary_of(done)
    if as_json:
        sys.stdout.write(json.dumps(summary.as_json() | {"notes": done.notes, "out": None if out is None else str(out)}) + "\n")
        return
    console = standard_output()
    console.print(_table(program.name, described.machine.name, summary))
    for note in done.notes:
        console.print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"{len(done.run)} samples in {out}", markup=False, highlight=False, soft_wrap=True)


def _table(program: str, machine: str, summary: "Summary") -> Table:
    """Root mean square and peak of each signal, in the manner of the reference paper's table of simulation results."""
    table = Table(title=f"{program} on {machine}: {summary.seconds:.2f} s", title_justify="left")
    for column in ("", "unit", "rms", "peak"):
        table.add_column(column, justify="left" if column in ("", "unit") else "right")
    for name, axis in summary.axes.items():
        error, torque = axis.following_error, axis.torque_a
        unit = "mdeg" if axis.unit == "deg" else "µm"
        table.add_row(f"following error {name.upper()}", unit, f"{1000 * error.rms:.1f}", f"{1000 * error.peak:.1f}")
        table.add_row(f"torque command {name.upper()}", "A", f"{torque.rms:.3f}", f"{torque.peak:.3f}")
    if (force := summary.cutting_force_n) is not None:
        table.add_row("resultant cutting force, while cutting", "N", f"{force.rms:.1f}", f"{force.peak:.1f}")
    if summary.spindle_load_pct is not None:
        table.add_row("spindle load", "%", "", f"{summary.spindle_load_pct:.1f}")
    if summary.spindle_temp_c is not None:
        table.add_row("spindle temperature", "°C", "", f"{summary.spindle_temp_c:.1f}")
    return table
