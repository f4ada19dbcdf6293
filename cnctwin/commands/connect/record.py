"""`cnctwin record`: seconds from a control's own oscilloscope, as a run log."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from cnctwin.commands.options import AsJson
from cnctwin.errors import UsageError
from cnctwin.processes.extras import needed_by
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.table import text_table

if TYPE_CHECKING:
    from cnctwin.importing.control_recording import Wanted
    from cnctwin.importing.recorded_files import Account
    from edge.controls.heidenhain.oscilloscope import Oscilloscope, ScopeSignal


def record(
    control: Annotated[
        str, typer.Argument(help="lsv2://host[:port], an iTNC 530; other controls save a file for `cnctwin import`")
    ],
    out: Annotated[Path | None, typer.Option(help="The run log, .parquet or .csv")] = None,
    signals: Annotated[
        str | None,
        typer.Option(help="x_ref,x_pos,x_torque,… or the control's own names; without it they are listed"),
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long to record, in seconds", min=0.02, max=86_400.0)] = 10.0,
    interval: Annotated[int, typer.Option(help="µs between two values: 600, 3000 or 21000")] = 3000,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="columns.toml, for signals that have no column of their own")
    ] = None,
    password_env: Annotated[str | None, typer.Option(help="Environment variable with the password of the log-in OSZI")] = None,
    as_json: AsJson = False,
) -> None:
    """Record signals at the servo's own rate from a control's oscilloscope. It only reads; Ctrl-C keeps what came."""
    with needed_by("a run log", "twin"):
        from cnctwin.importing import import_report
        from cnctwin.importing.column_map import read_map
        from cnctwin.importing.control_recording import wanted
    from edge.controls.heidenhain.oscilloscope import Oscilloscope

    if password_env is not None and password_env not in os.environ:
        raise UsageError(f"--password-env {password_env}: there is no such environment variable; set it")
    chosen = None if map_file is None else read_map(map_file)
    names = [name.strip() for name in (signals or "").split(",") if name.strip()]
    scope = Oscilloscope(control, password=os.environ[password_env] if password_env else "")
    try:
        scope.open()
        offered = scope.signals()
        if not names and chosen is None:
            _list(scope, offered)
            return
        if out is None:
            raise UsageError("--out is missing: name the run log, such as --out run.parquet")
        account = _record(scope, wanted(offered, names, chosen), seconds, interval, out)
    finally:
        scope.close()
    if as_json:
        sys.stdout.write(import_report.as_json(account, out))
    else:
        import_report.show(account, out, standard_output())


def _record(scope: "Oscilloscope", signals: "list[Wanted]", seconds: float, interval: int, out: Path) -> "Account":
    from cnctwin.importing.control_recording import record as recorded

    console = Console(stderr=True)
    columns = (
        TextColumn("recording"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:g} s"),
        TimeRemainingColumn(),
    )
    with (
        stopped_by_signals() as stop,
        Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar,
    ):
        task = bar.add_task("recording", total=seconds)
        return recorded(
            scope,
            signals,
            seconds,
            interval,
            out,
            is_over=stop.is_set,
            progress=lambda done_s: bar.update(task, completed=min(done_s, seconds)),
        )


def _list(scope: "Oscilloscope", offered: "Sequence[ScopeSignal]") -> None:
    from cnctwin.importing.control_recording import column_of

    rows = [(one.name, column_of(one) or "", str(one.interval_us)) for one in offered]
    console = standard_output()
    console.print(text_table(("signal", "column", "µs at best"), rows))
    console.print(f"{scope.control}: {len(rows)} signals; name some with --signals", markup=False, highlight=False)
