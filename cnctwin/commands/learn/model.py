"""The commands below `cnctwin model`: versions of models, which of them counts, what a challenger has to show."""

import json
import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from cnctwin.commands.options import AsJson, From, StorePlace, To
from cnctwin.errors import UsageError
from cnctwin.models import registry
from cnctwin.models.card import DIGITS, faults_of
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import stretch_ms
from cnctwin.terminal.table import text_table
from edge.state_dir import state_dir

VARIABLE = "CNCTWIN_MODELS"
model_app = typer.Typer(
    no_args_is_help=True, help="Versions of models: which counts, what a challenger has to show, the way back."
)
Kind = Annotated[str, typer.Argument(help="residual, anomaly, detector")]
Machine = Annotated[str, typer.Argument(help="Name of the machine")]
Version = Annotated[str, typer.Argument(help="Version: its digits, or the first of them")]
Models = Annotated[Path | None, typer.Option(help=f"Folder of the registry; else ${VARIABLE} or `models` in the state folder")]
Runs = Annotated[list[Path] | None, typer.Option(help="Run log, in place of the store; may be given again")]
DAY_MS = 86_400_000


@model_app.command("list")
def list_models(models: Models = None, as_json: AsJson = False) -> None:
    """All versions, by kind and machine. * counts, ~ is kept warm."""
    rows = [_row(own, version) for own in registry.shelves(_place(models)) for version in own.versions()]
    if as_json:
        _json(rows)
        return
    columns = ("", "kind", "machine", "version", "trained", "features", "added")
    standard_output().print(text_table(columns, map(_cells, rows)))


@model_app.command()
def show(kind: Kind, machine: Machine, version: Version, models: Models = None, as_json: AsJson = False) -> None:
    """All that is known of a version. Exit code 1: its files are not what was registered."""
    own = registry.shelf(_place(models), kind, machine)
    folder = own.named(version)
    faults = faults_of(folder)
    told = _row(own, folder.name) | {"faults": faults, "folder": str(folder)}
    told["comparisons"] = [one for one in registry.comparisons(own) if folder.name in (one["champion"], one["challenger"])]
    if as_json:
        _json(told)
    else:
        for name, value in told.items():
            text = json.dumps(value, ensure_ascii=False) if isinstance(value, (dict, list, tuple)) else str(value)
            _say(f"{name}: {text}")
    raise typer.Exit(1 if faults else 0)


@model_app.command()
def add(
    kind: Kind,
    machine: Machine,
    folder: Annotated[Path, typer.Argument(help="What `cnctwin train` wrote")],
    models: Models = None,
) -> None:
    """Put a trained model into the registry. The first one of a machine counts at once, the next have to win or be promoted."""
    place = _place(models)
    version = registry.add(place, kind, machine, folder, time.time())
    pointer = registry.shelf(place, kind, machine).pointer()
    counts = pointer is not None and pointer.champion == version
    _say(f"{kind} of {machine}: {version} {'counts' if counts else 'waits: cnctwin model compare'}")


@model_app.command()
def promote(
    kind: Kind,
    machine: Machine,
    version: Version,
    because: Annotated[
        str, typer.Option("--why", "--because", help="Why, for the log; needed where it has not won a comparison")
    ] = "",
    models: Models = None,
) -> None:
    """Let a version count. The one before is kept warm for 48 h."""
    with needed_by("promoting", "twin"):
        from cnctwin.challenge.comparing import won
    own = registry.shelf(_place(models), kind, machine)
    folder, before = own.named(version), own.pointer()
    is_won = before is None or won(own, folder.name, registry.comparisons(own))
    if not is_won and not because.strip():
        raise UsageError(f"{folder.name} has not won against {before and before.champion}: compare it, or give --why")
    pointer = registry.promoted(own, folder.name, because.strip() or "it won its comparison", time.time())
    _say(_turned(own, pointer.champion, pointer.previous, pointer.warm_until))


@model_app.command()
def rollback(
    kind: Kind,
    machine: Machine,
    because: Annotated[str, typer.Option("--why", "--because", help="Why, for the log")] = "rolled back",
    models: Models = None,
) -> None:
    """Let the champion before count again."""
    own = registry.shelf(_place(models), kind, machine)
    pointer = registry.rolled_back(own, because.strip() or "rolled back", time.time())
    _say(_turned(own, pointer.champion, pointer.previous, pointer.warm_until))


@model_app.command()
def prune(
    kind: Kind,
    machine: Machine,
    keep: Annotated[int, typer.Option(help="How many of the newest versions to keep", min=1)] = 5,
    models: Models = None,
) -> None:
    """Delete old versions; never the champion, the one that is warm, or the golden week."""
    own = registry.shelf(_place(models), kind, machine)
    gone = registry.pruned(own, keep, time.time())
    _say(f"{kind} of {machine}: deleted {', '.join(gone) or 'nothing'}")


@model_app.command()
def golden(
    kind: Kind,
    machine: Machine,
    run: Annotated[Path | None, typer.Option("--runs", "--run", help="Run log, in place of the store")] = None,
    store: StorePlace = None,
    from_: From = None,
    to: To = None,
    models: Models = None,
) -> None:
    """Freeze a stretch of data, a week as a rule, as the standing test of every challenger."""
    with needed_by("a golden week", "twin"):
        from cnctwin.models.golden import freeze
    own = registry.shelf(_place(models), kind, machine)
    (log,) = _stretches(machine, [run] if run else [], store, from_, to)
    told = freeze(own, log, log.source, time.time())
    _say(f"{kind} of {machine}: {told['rows']} rows of {told['source']} are frozen as {told['sha256'][:DIGITS]}")


@model_app.command()
def compare(
    kind: Kind,
    machine: Machine,
    version: Annotated[str, typer.Argument(help="The challenger, or its first digits")],
    runs: Runs = None,
    store: StorePlace = None,
    from_: From = None,
    to: To = None,
    tolerance_pct: Annotated[
        float, typer.Option(min=0.0, max=100.0, help="Worse on the golden week by so much still passes")
    ] = 5.0,
    hours_min: Annotated[float, typer.Option(min=0.0, help="Hours that the holdout has to have")] = 24.0,
    does_promote: Annotated[bool, typer.Option("--promote", help="Let the challenger count where it wins")] = False,
    models: Models = None,
    as_json: AsJson = False,
) -> None:
    """Champion against challenger on data that neither has seen, and on the golden week. Exit code 1: the champion stays."""
    with needed_by("comparing", "twin"):
        from cnctwin.challenge.comparing import Test, compared, sha256_of
    own = registry.shelf(_place(models), kind, machine)
    logs = _stretches(machine, runs or [], store, from_, to)
    data = tuple(sha256_of(path) for path in runs or [])
    test = Test(tuple(logs), data, tolerance_pct / 100.0, hours_min)
    challenger, found, notes = compared(own, version, test, time.time())
    pointer = own.pointer()
    champion = "" if pointer is None else pointer.champion
    if found.wins and does_promote:
        registry.promoted(own, challenger, found.reason, time.time())
    told = {"champion": champion, "challenger": challenger, "promoted": found.wins and does_promote, "notes": notes}
    if as_json:
        _json(told | found.as_json())
    else:
        interval = "–" if found.low is None or found.high is None else f"{found.low:.4g} … {found.high:.4g}"
        _say(f"{challenger} {'wins' if found.wins else 'does not win'}: {found.reason}")
        _say(
            f"mean loss of the champion {found.champion_loss:.4g}, of the challenger {found.challenger_loss:.4g}; difference "
            f"{found.difference:.4g} (95 %: {interval}), {found.hours:.3g} h, {found.blocks} blocks"
        )
        if found.golden_change_pct is not None:
            _say(f"golden week: {found.golden_change_pct:+.3g} %")
        for note in [*notes, *(["it counts now"] if told["promoted"] else [])]:
            _say(note)
    raise typer.Exit(0 if found.wins else 1)


@model_app.command()
def export(
    kind: Kind,
    machine: Machine,
    version: Version,
    mlflow: Annotated[str, typer.Option(help="URL of an MLflow server")],
    models: Models = None,
) -> None:
    """Tell an MLflow server of a version: parameters, figures, checksums, its manifest."""
    from cnctwin.models.mlflow_export import export as exported

    own = registry.shelf(_place(models), kind, machine)
    folder = own.named(version)
    told = exported(own.card(folder.name), folder, mlflow, round(1000.0 * time.time()))
    artifacts = told["artifacts"]
    _say(f"run {told['run_id']}; artifacts: {artifacts if isinstance(artifacts, str) else ', '.join(artifacts)}")


def _stretches(machine: str, runs: list[Path], store: str | None, from_: str | None, to: str | None) -> list[Any]:
    """The data that was named: run logs, or a stretch of a store."""
    with needed_by("reading data", "twin,historian"):
        from cnctwin.challenge.stretch import read_stretch, stretch_of_store
        from cnctwin.memory.store.opening import default_place, open_store
    if runs:
        if store is not None or from_ is not None:
            raise UsageError("run logs and a stretch of the store: give one of them")
        return [read_stretch(path) for path in runs]
    if from_ is None:
        raise UsageError("no data is named: give run logs, or --from and --to of the store")
    where = store or str(default_place())
    opened = open_store(where, writable=False)
    try:
        return [stretch_of_store(opened, machine, *stretch_ms(from_, to), where)]
    finally:
        opened.close()


def _place(models: Path | None) -> Path:
    named = os.environ.get(VARIABLE)
    return models or (Path(named) if named else state_dir() / "models")


def _row(own: registry.Shelf, version: str) -> dict[str, Any]:
    pointer, beside = own.pointer(), own.warm(time.time())
    is_champion = pointer is not None and pointer.champion == version
    return own.card(version).as_json() | {"champion": is_champion, "warm": beside is not None and beside.name == version}


def _cells(row: Mapping[str, Any]) -> list[str]:
    trained = f"{row['from']} … {row['to']}" if row["from"] else "–"
    mark = "*" if row["champion"] else "~" if row["warm"] else ""
    return [mark, row["kind"], row["machine"], row["version"], trained, str(len(row["features"])), row["added_at"][:16]]


def _turned(own: registry.Shelf, champion: str, previous: str | None, warm_until: str) -> str:
    beside = f"; {previous} is kept warm until {warm_until}" if previous else ""
    return f"{own.kind} of {own.machine}: {champion} counts{beside}"


def _say(text: str) -> None:
    standard_output().print(text, markup=False, highlight=False, soft_wrap=True)


def _json(value: Any) -> None:
    sys.stdout.write(json.dumps(value, default=str) + "\n")
