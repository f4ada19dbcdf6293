"""`cnctwin import`: run logs from a recording, or from a stretch of a store."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import AsJson, Device, Devices, From, To
from cnctwin.errors import UsageError
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import stretch_ms
from cnctwin.terminal.spinner import working


def import_recording(
    recordings: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="SINUMERIK trace XML, TwinCAT Scope or DynoWare text, any CSV, TSV or Parquet; the time|key|value text of the "
            "NIST test bed; an SHDR log, with --devices; a store, with --machine. Several files in a row are one recording",
        ),
    ],
    out: Annotated[Path, typer.Option(help="The run log, .parquet or .csv; numbered where there are several runs")],
    map_file: Annotated[
        Path | None,
        typer.Option("--map", help="columns.toml: which column is what, in which unit; without it, one is drafted where needed"),
    ] = None,
    devices: Devices = None,
    device: Device = None,
    machine: Annotated[str | None, typer.Option(help="Name of the machine, as the store has it")] = None,
    from_: From = None,
    to: To = None,
    as_json: AsJson = False,
) -> None:
    """Turn a recording into run logs: of files with columns one; else one for each program execution or stretch without a gap."""
    if machine is not None:
        _from_store(recordings, machine, from_, to, out)
        return
    paths = [Path(recording) for recording in recordings]
    with needed_by("the twin", "twin"):
        from cnctwin.importing.program_runs import import_program_runs, is_observations
    if map_file is not None and devices is not None:
        raise UsageError(f"--map {map_file} and --devices {devices}: a file has columns or is an SHDR log; give one of them")
    if devices is not None:
        with needed_by("the twin", "twin"):
            from cnctwin.importing.shdr import import_shdr
        import_shdr(paths, devices, device, out, standard_output())
    elif map_file is None and is_observations(paths[0]):
        import_program_runs(paths, out, standard_output())
    else:
        _from_files(paths, map_file, out, as_json)


def _from_store(recordings: Sequence[str], machine: str, from_: str | None, to: str | None, out: Path) -> None:
    if from_ is None:
        raise UsageError(f"--machine {machine}: say which stretch of the store with --from, and --to where it is not until now")
    if len(recordings) > 1:
        raise UsageError(f"--machine {machine}: {recordings[1]} is one store too many; give one")
    with needed_by("a run log", "twin"):
        from cnctwin.memory.store.run_export import export
    rows = export(recordings[0], machine, stretch_ms(from_, to), out)
    standard_output().print(f"{out}: {rows} rows", markup=False, highlight=False)


def _from_files(paths: Sequence[Path], map_file: Path | None, out: Path, as_json: bool) -> None:
    with needed_by("reading files", "twin"):
        from cnctwin.importing import import_report
        from cnctwin.importing.column_map import read_map
        from cnctwin.importing.recorded_files import MapNeededError, import_files
    chosen = None if map_file is None else read_map(map_file)
    try:
        with working(f"reading {', '.join(path.name for path in paths)}"):
            account = import_files(paths, chosen, out)
    except MapNeededError as needed:
        sys.stdout.write(needed.draft)
        raise
    if as_json:
        sys.stdout.write(import_report.as_json(account, out))
    else:
        import_report.show(account, out, standard_output())
