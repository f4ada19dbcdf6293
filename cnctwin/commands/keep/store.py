"""`cnctwin store`: what a store holds, what it costs, and a stretch of it for other programs.

Exit codes: 0 = done, 1 = bad news (the plan does not fit the disk; something is wrong with the store), 2 = wrong input.
"""

import csv
import json
import re
import shutil
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from cnctwin.commands.options import AsJson, Device, Devices, FromNeeded, StorePlace, To
from cnctwin.errors import UsageError
from cnctwin.memory.row_numbers import holes_text, saved_holes
from cnctwin.memory.store.contract import Column, Query, Store, StoreError
from cnctwin.memory.store.opening import check_machine, default_place, open_store
from cnctwin.memory.store.plan import Load, Plan, load_of, plan
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.moment import length_ms, moment_text, stretch_ms

store_app = typer.Typer(no_args_is_help=True, help="The store: what it holds, what it costs, a stretch of it.")

Machine = Annotated[str, typer.Argument(help="Name of the machine")]
_BYTES = re.compile(r"(\d+(?:\.\d+)?)\s*([kMGT]?)B?", re.IGNORECASE)
_POWERS = {"": 0, "k": 1, "m": 2, "g": 3, "t": 4}


@store_app.command("plan")
def plan_command(
    where: StorePlace = None,
    machines: Annotated[int | None, typer.Option(help="How many machines; else as the store has seen", min=1)] = None,
    signals: Annotated[int, typer.Option(help="Slow signals of each", min=1)] = 20,
    rate_hz: Annotated[float, typer.Option("--rate-hz", help="Changes a second of each signal", min=0.001)] = 10.0,
    vibration_hz: Annotated[float, typer.Option(help="Samples a second of each vibration axis", min=0.0)] = 0.0,
    vibration_axes: Annotated[int, typer.Option(help="Vibration axes of each machine", min=1)] = 3,
    disk: Annotated[str | None, typer.Option(help="How much the store may take, as 40GB; else what the disk has left")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what a year of these machines costs on this disk, and propose how long to keep what."""
    load = _measured(where) if machines is None else None
    if load is None:
        load = load_of(machines or 1, signals, rate_hz, vibration_hz=vibration_hz, vibration_axes=vibration_axes)
        if machines is None:
            load = replace(load, basis=f"{load.basis} (assumed: there is no store at {where or default_place()} to measure)")
    made = plan(load, _bytes(disk) if disk else _free(where))
    if as_json:
        sys.stdout.write(json.dumps(made.as_json()) + "\n")
    else:
        _show_plan(made, Console())
    raise typer.Exit(0 if made.fits else 1)


@store_app.command("status")
def status_command(where: StorePlace = None, as_json: AsJson = False) -> None:
    """Say what a store holds, by machine, and what is wrong with it."""
    with _opened(where) as store:
        status = store.status()
        machines = {name: _about(store, name) for name in store.machines()}
        pins = [pinned._asdict() for pinned in store.pins()]
        holes = saved_holes(store, _now_ms())
    if as_json:
        told = {name: getattr(status, name) for name in status.__slots__}
        sys.stdout.write(
            json.dumps(told | {"machines": machines, "pins": pins, "sequence_holes": [hole._asdict() for hole in holes]}) + "\n"
        )
    else:
        console = Console()
        table = Table(title=f"{where or default_place()}", title_justify="left")
        for column in ("machine", "signals", "from", "to"):
            table.add_column(column)
        for name, about in machines.items():
            span = ("–" if at_ms is None else moment_text(at_ms) for at_ms in (about["from_ms"], about["to_ms"]))
            table.add_row(name, str(about["signals"]), *span)
        console.print(table)
        left = (
            "the day on which the disk is full is not known yet"
            if status.days_left is None
            else f"room for {status.days_left:.0f} more days before anything is deleted early"
        )
        a_sample = f" ({status.bytes / status.samples:.2f} bytes a sample)" if status.samples else ""
        kept = f"{status.samples} samples in {status.bytes / 1e6:.1f} MB{a_sample}"
        pinned = f"{len(pins)} pin" + "s" * (len(pins) != 1)
        console.print(f"{kept}; {left}; {pinned}", highlight=False, soft_wrap=True)
        if holes:
            console.print(f"rows of edges are missing: {holes_text(holes)}", markup=False, highlight=False, soft_wrap=True)
        if status.trouble:
            console.print(f"trouble: {status.trouble}", markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(1 if status.trouble else 0)


@store_app.command("query")
def query_command(
    machine: Machine,
    signals: Annotated[list[str], typer.Argument(help="Names of signals")],
    from_: FromNeeded,
    to: To = None,
    every: Annotated[str | None, typer.Option(help="Windows, as 100ms, 1s or 1m; else each sample as it came")] = None,
    where: StorePlace = None,
    as_json: AsJson = False,
) -> None:
    """Print samples or windows as CSV, or JSON."""
    query = Query(machine, tuple(signals), *stretch_ms(from_, to), length_ms(every) if every else None)
    with _opened(where) as store:
        check_machine(store, machine)
        columns = store.query(query)
    if as_json:
        told = [{n: getattr(c, n) for n in c.__slots__} | {"quality": [q.name.lower() for q in c.quality]} for c in columns]
        sys.stdout.write(json.dumps(told, default=list) + "\n")
        return
    writer = csv.writer(sys.stdout)
    is_windowed = query.every_ms is not None
    writer.writerow(["signal", "t", "value", "unit", "quality", "reason", *(["low", "high", "count"] if is_windowed else [])])
    for column in columns:
        for row in _rows(column, is_windowed=is_windowed):
            writer.writerow(["" if value is None else value for value in row])


@store_app.command("export")
def export_command(
    machine: Machine,
    from_: FromNeeded,
    out: Annotated[Path, typer.Option(help="Run log to write, .parquet or .csv")],
    to: To = None,
    every: Annotated[str | None, typer.Option(help="Windows, as 100ms, 1s or 1m; else each sample as it came")] = None,
    held: Annotated[bool, typer.Option("--held", help="A signal keeps its last value until the next one comes")] = False,
    where: StorePlace = None,
) -> None:
    """Write a stretch of a machine as a run log, which gap diagnosis, identification and training read."""
    with needed_by("a run log", "twin"):
        from cnctwin.memory.store.run_export import export
    span_ms, every_ms = stretch_ms(from_, to), length_ms(every) if every else None
    rows = export(where or default_place(), machine, span_ms, out, every_ms=every_ms, held=held)
    sys.stdout.write(f"{rows} rows in {out}\n")


@store_app.command("import")
def import_command(
    recording: Annotated[Path, typer.Argument(help="An SHDR log, or time|key|value text")],
    devices: Devices = None,
    machine: Annotated[str | None, typer.Option(help="Under which name; else the device's, else the file's")] = None,
    device: Device = None,
    where: StorePlace = None,
) -> None:
    """Put a recording into a store as if an edge had said it, and pin it; then it can be replayed."""
    for path in (recording, devices):
        if path is not None and not path.is_file():
            raise UsageError(f"{path}: no such file; give a recording, and its device model with --devices")
    with needed_by("a recording", "twin"):
        from cnctwin.importing.into_store import import_recording
    store = open_store(where or default_place(), writable=True)
    try:
        done = import_recording(store, recording, devices, machine, device)
    finally:
        store.close()
    lost = f", {done.repeated} were there, {done.refused} refused" if done.repeated or done.refused else ""
    stretch = f"from {done.from_ms} to {done.to_ms} (ms since 1970)"
    sys.stdout.write(f"{done.machine}: {done.stored} samples of {done.messages} messages stored{lost}, {stretch}\n")


@store_app.command("seal")
def seal_command(where: StorePlace = None) -> None:
    """Seal, roll up and sweep at once what is due, while no historian runs."""
    store = open_store(where or default_place(), writable=True)
    try:
        sealed = swept = freed = 0
        for _ in range(10_000):
            done = store.tidy(_now_ms())
            sealed, swept, freed = sealed + done.sealed, swept + done.swept, freed + done.bytes_freed
            if not done.sealed and not done.swept:
                break
    finally:
        store.close()
    sys.stdout.write(f"{sealed} hours sealed, {swept} files swept, {freed / 1e6:.1f} MB given back\n")


class _Opened:
    def __init__(self, where: str | None) -> None:
        self._store = open_store(where or default_place())

    def __enter__(self) -> Store:
        return self._store

    def __exit__(self, *_: object) -> None:
        self._store.close()


def _opened(where: str | None) -> _Opened:
    return _Opened(where)


def _now_ms() -> int:
    return time.time_ns() // 1_000_000


def _bytes(text: str) -> int:
    match = _BYTES.fullmatch(text.strip())
    if match is None or float(match[1]) <= 0:
        raise UsageError(f"--disk {text!r}: write 40GB")
    return round(float(match[1]) * 1000.0 ** _POWERS[match[2].lower()])


def _free(where: str | None) -> int:
    """Return the free bytes of the disk."""
    place = Path(where or default_place())
    there = next((p for p in (place, *place.absolute().parents) if p.exists()), Path("/"))
    return shutil.disk_usage(there).free


def _measured(where: str | None) -> Load | None:
    """Return the load that the store has seen; None where there is no store."""
    from cnctwin.memory.store.database import FILE_NAME, Readers
    from cnctwin.memory.store.measured_load import measured_load

    folder = Path(where or default_place())
    if not (folder / FILE_NAME).is_file():
        return None
    readers = Readers(folder / FILE_NAME)
    try:
        return measured_load(readers)
    except StoreError as error:
        raise UsageError(f"{folder}: {error}") from None
    finally:
        readers.close()


def _show_plan(made: Plan, console: Console) -> None:
    load, proposed = made.load, made.proposed
    console.print(f"A year of {load.basis}", highlight=False, soft_wrap=True)
    table = Table()
    for column in ("", "a day", "a year", "kept"):
        table.add_column(column, justify="left" if column in ("", "kept") else "right")
    kept = (f"{proposed.raw_days:g} days", f"{proposed.block_days:g} days", "for ever", "for ever")
    rows = (
        ("slow signals", load.slow),
        ("vibration and arrays", load.blocks),
        ("features (twin/…)", load.features),
        ("roll-ups, 1 min", load.rollups),
    )
    for (name, a_day), days in zip(rows, kept, strict=True):
        if a_day:
            table.add_row(name, f"{a_day / 1e6:.1f} MB", f"{a_day * 365.25 / 1e9:.2f} GB", days)
    console.print(table)
    full = "for ever" if made.days_to_full is None else f"{made.days_to_full:.0f} days"
    room = "" if made.years_for_ever is None else f"; what is never swept has room for {made.years_for_ever:.0f} years"
    fits = "" if made.fits else " A year of raw and a week of vibration do not fit; what does is proposed:"
    console.print(f"{made.disk_bytes / 1e9:.1f} GB last {full} with nothing swept{room}.{fits}", soft_wrap=True)
    console.print("[historian]", markup=False)
    console.print(
        f"raw_days = {proposed.raw_days:g}\nblock_days = {proposed.block_days:g}\ndisk_gb = {made.disk_bytes / 1e9:g}",
        highlight=False,
    )


def _about(store: Store, machine: str) -> dict[str, Any]:
    series = store.series(machine)
    first = min((s.first_us for s in series), default=None)
    last = max((s.last_us for s in series), default=None)
    return {
        "signals": len({s.signal for s in series}),
        "from_ms": None if first is None else first // 1000,
        "to_ms": None if last is None else last // 1000,
    }


def _rows(column: Column, *, is_windowed: bool) -> list[list[Any]]:
    stamps = [datetime.fromtimestamp(t / 1e6, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z") for t in column.t_us]
    rows = [
        [column.signal, t, value, column.unit, quality.name.lower(), reason]
        for t, value, quality, reason in zip(stamps, column.value, column.quality, column.reason, strict=True)
    ]
    if is_windowed:
        rows = [
            [*row, low, high, count] for row, low, high, count in zip(rows, column.low, column.high, column.count, strict=True)
        ]
    return rows
