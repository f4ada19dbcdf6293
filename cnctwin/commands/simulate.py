"""`cnctwin simulate`: a part program on the twin."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from cnctwin.commands.extras import needed_by
from cnctwin.commands.options import AsJson
from cnctwin.errors import UsageError
from cnctwin.files.called_programs import with_called_programs
from cnctwin.files.output import check_suffix, write
from cnctwin.files.program_text import read_text
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from twin.simulator.simulation import Simulation


def simulate(
    program: Annotated[Path, typer.Argument(help="The part program")],
    machine: Annotated[Path, typer.Option(help="machine.toml of the machine to run it on")],
    out: Annotated[Path | None, typer.Option(help="Write the run log there, .parquet or .csv")] = None,
    seed: Annotated[int | None, typer.Option(help="One noisy course of the machine instead of its mean course", min=0)] = None,
    as_json: AsJson = False,
) -> None:
    """Run a part program on the twin as on a machine: time, peak force, following error, and a run log."""
    with needed_by("the twin", "twin"):
        from twin.effects.added import check_effects
        from twin.errors import EffectError, PartProgramError
        from twin.machine import read_machine
        from twin.runlog import write_run
        from twin.simulator.simulation import program_settings
        from twin.simulator.simulation import simulate as simulated
    described = read_machine(machine)
    try:
        check_effects(described)
    except EffectError as error:
        raise UsageError(f"{machine}: {error}") from None
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
    summary = _summary_of(done)
    if as_json:
        sys.stdout.write(json.dumps(summary | {"notes": done.notes, "out": None if out is None else str(out)}) + "\n")
        return
    console = standard_output()
    console.print(_table(program.name, described.machine.name, summary))
    for note in done.notes:
        console.print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"{len(done.run)} samples in {out}", markup=False, highlight=False, soft_wrap=True)


def _summary_of(done: "Simulation") -> dict[str, Any]:
    """The figures of a simulation: time, force, load, and of each axis following error and torque, rms and peak."""

    import numpy as np

    def figures(values: Any) -> dict[str, float]:
        return {"rms": float(np.sqrt(np.nanmean(values**2))), "peak": float(np.nanmax(np.abs(values)))}

    run = done.run
    axes = {
        axis: {
            f"following_error_{'deg' if axis in run.rotary else 'mm'}": figures(error),
            "torque_a": figures(run[f"{axis}_torque_a"]),
        }
        for axis, error in done.following_error_mm().items()
    }
    summary: dict[str, Any] = {"seconds": done.seconds, "axes": axes}
    if "force_x_n" in run.columns:
        cutting = run["axial_depth_mm"] > 0.0
        resultant = np.hypot(run["force_x_n"], run["force_y_n"])[cutting]
        summary["cutting_force_n"] = {"rms": figures(resultant)["rms"], "peak": float(run["cutting_force_peak_n"].max())}
    for name in ("spindle_load_pct", "spindle_temp_c"):
        if name in run.columns:
            summary[name] = {"peak": float(np.nanmax(run[name]))}
    return summary


def _table(program: str, machine: str, summary: dict[str, Any]) -> Table:
    """Root mean square and peak of each signal, in the manner of the reference paper's table of simulation results."""
    table = Table(title=f"{program} on {machine}: {summary['seconds']:.2f} s", title_justify="left")
    for column in ("", "unit", "rms", "peak"):
        table.add_column(column, justify="left" if column in ("", "unit") else "right")
    for axis, signals in summary["axes"].items():
        torque, turns = signals["torque_a"], "following_error_deg" in signals
        error = signals["following_error_deg" if turns else "following_error_mm"]
        unit = "mdeg" if turns else "µm"
        table.add_row(f"following error {axis.upper()}", unit, f"{1000 * error['rms']:.1f}", f"{1000 * error['peak']:.1f}")
        table.add_row(f"torque command {axis.upper()}", "A", f"{torque['rms']:.3f}", f"{torque['peak']:.3f}")
    if force := summary.get("cutting_force_n"):
        table.add_row("cutting force, while cutting", "N", f"{force['rms']:.1f}", f"{force['peak']:.1f}")
    if load := summary.get("spindle_load_pct"):
        table.add_row("spindle load", "%", "", f"{load['peak']:.1f}")
    if heat := summary.get("spindle_temp_c"):
        table.add_row("spindle temperature", "°C", "", f"{heat['peak']:.1f}")
    return table
