"""`cnctwin import`: run logs from a recording, or from a stretch of a store."""

from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.extras import needed_by
from cnctwin.commands.moment import moment_ms
from cnctwin.errors import UsageError
from cnctwin.terminal.console import standard_output


def import_recording(
    recording: Annotated[
        str, typer.Argument(help="time|key|value text of the NIST test bed; an SHDR log, with --devices; a store, with --machine")
    ],
    out: Annotated[Path, typer.Option(help="The run log, .parquet or .csv; numbered where there are several runs")],
    devices: Annotated[Path | None, typer.Option(help="The Devices.xml of the SHDR log")] = None,
    device: Annotated[str | None, typer.Option(help="Which device of it, where there are several")] = None,
    machine: Annotated[str | None, typer.Option(help="Which machine of the store")] = None,
    from_: Annotated[str | None, typer.Option("--from", help="Of the store: UTC, as 2026-11-21T06:00, or ms since 1970")] = None,
    to: Annotated[str | None, typer.Option(help="Of the store")] = None,
) -> None:
    """Turn a recording into run logs: one for each program execution or stretch without a gap; or a stretch of a store."""
    if machine is not None:
        if from_ is None or to is None:
            raise UsageError(f"--machine {machine}: say which stretch of the store with --from and --to")
        with needed_by("a run log", "twin"):
            from cnctwin.memory.store.run_export import export
        rows = export(recording, machine, (moment_ms(from_, "--from"), moment_ms(to, "--to")), out)
        standard_output().print(f"{out}: {rows} rows", markup=False, highlight=False)
    elif devices is None:
        with needed_by("the twin", "twin"):
            from cnctwin.importing.program_runs import import_program_runs
        import_program_runs(Path(recording), out, standard_output())
    else:
        with needed_by("the twin", "twin"):
            from cnctwin.importing.shdr import import_shdr
        import_shdr(Path(recording), devices, device, out, standard_output())
