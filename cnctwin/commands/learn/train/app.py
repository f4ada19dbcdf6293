"""The commands below `cnctwin train`; what they do is imported when one of them is run."""

import shlex
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer
from rich.console import Console

from cnctwin.commands.learn.train.detector import train_detector
from cnctwin.commands.learn.train.residual import train_residual
from cnctwin.commands.options import AsJson, Seed
from cnctwin.errors import UsageError

train_app = typer.Typer(
    no_args_is_help=True,
    help="Models of a machine from its recordings: anomaly scores, tool changes, what the heat model gets wrong.",
)
train_app.command("detector")(train_detector)
train_app.command("residual")(train_residual)
FILES = "Run logs (Parquet or CSV) as [NAME=]FILE; several files of a NAME are one after the other, several NAMEs a cell"


@train_app.command("anomaly")
def train_anomaly(
    files: Annotated[list[str], typer.Argument(help=FILES)],
    out: Annotated[Path, typer.Option(help="Folder for the models: <out>/<machine>/current is what scores")] = Path("models"),
    features: Annotated[
        str,
        typer.Option(help="Signals, as a,b,c; else those of load, speed, feed, heat and vibration that all files have"),
    ] = "",
    detector: Annotated[
        str, typer.Option(help="isolation_forest, or a detector of PyOD: IForest, ECOD, KNN, …")
    ] = "isolation_forest",
    parameter: Annotated[list[str] | None, typer.Option(help="NAME=VALUE for the detector, as its library names it")] = None,
    alerts_per_week: Annotated[
        float, typer.Option(min=0.001, help="False alerts a machine-week that the threshold is fitted to")
    ] = 1.0,
    tick_s: Annotated[float, typer.Option(min=0.001, max=3600.0, help="A score at each multiple of this")] = 1.0,
    dwell: Annotated[int, typer.Option(min=1, max=3600, help="Ticks in a row that are an alarm")] = 3,
    calm_s: Annotated[float, typer.Option(min=0.0, max=86_400.0, help="Judged time without it that ends an alarm")] = 600.0,
    common_mode: Annotated[
        str,
        typer.Option(
            help="parts: each cut beside earlier parts, the twin and the peers; features: each one beside the peers'; "
            "source: the published ratio rule; residual: spreads over the peers"
        ),
    ] = "parts",
    common_mode_factor: Annotated[float, typer.Option(min=0.001, help="A peer with this share of a score makes it common")] = 0.5,
    exclude_gated_peers: Annotated[bool, typer.Option(help="Ignore peers while they change tools")] = False,
    tail_s: Annotated[float, typer.Option(min=0.0, max=600.0, help="Gated after the end of a tool change")] = 8.0,
    look_back_s: Annotated[
        float, typer.Option(min=0.0, max=600.0, help="Gated before its begin, where the control tells late")
    ] = 0.0,
    expectations: Annotated[
        Path | None, typer.Option(help="Folder with what the twin expects of the programs: what `cnctwin expect --out` wrote")
    ] = None,
    train_share: Annotated[
        float, typer.Option(min=0.05, max=0.95, help="First part of the time, trained on; the rest calibrates")
    ] = 0.5,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Train a model of each machine, and fit its threshold to so many alerts a week."""
    training = _training()
    names = tuple(dict.fromkeys(name.strip() for name in features.split(",") if name.strip()))
    if features and not names:
        raise UsageError("--features is empty: name at least one signal")
    if common_mode not in (methods := [method.value for method in training.Method]):
        raise UsageError(f"--common-mode {common_mode}: it is one of {', '.join(methods)}")
    asked = training.TrainingSettings(
        features=names,
        detector=training.Detector(detector, dict(_parameter(one) for one in parameter or ()), seed),
        alerts_per_week=alerts_per_week,
        train_share=train_share,
        tick_s=tick_s,
        dwell_ticks=dwell,
        calm_s=calm_s,
        common_mode=training.Method(common_mode),
        common_mode_factor=common_mode_factor,
        exclude_gated_peers=exclude_gated_peers,
        tail_s=tail_s,
        look_back_s=look_back_s,
        expectations=training.expectations_in(expectations),
        expectations_from="" if expectations is None else str(expectations),
        at=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    training.train_anomaly(files, asked, out, as_json=as_json, console=Console())


@train_app.command("sample")
def train_sample(
    out: Annotated[Path, typer.Option(help="Folder for the recordings")] = Path("sample-week"),
    machines: Annotated[int, typer.Option(help="Machines of a cell", min=1, max=99)] = 2,
    days: Annotated[int, typer.Option(help="From a Monday on", min=1, max=60)] = 7,
    seed: Annotated[int, typer.Option(help="Seed for drawing the weeks; a different seed draws different weeks", min=0)] = 1,
) -> None:
    """Make a sample week of simulated machines in production, for `train anomaly` to learn from."""
    from cnctwin.files.output import write
    from cnctwin.processes.extras import needed_by
    from cnctwin.terminal.spinner import working

    with needed_by("the simulated machine", "twin"):
        from cnctwin.training.anomaly.sample_week import SampleWeek, sample_weeks
    made: list[SampleWeek] = []

    def write_weeks() -> None:
        for week in sample_weeks(out, machines, days, seed):
            print(f"{week.file}: {days} days of {week.machine}, {week.rows} rows")
            made.append(week)

    with working("simulating"):
        write(write_weeks, out)
    print(f"train from it: cnctwin train anomaly {shlex.join(f'{week.machine}={week.file}' for week in made)}")


@train_app.command("check")
def train_check(
    model: Annotated[Path, typer.Argument(help="Folder with models, of one machine, or of one version")],
    files: Annotated[list[str] | None, typer.Argument(help="Recordings to count alerts in, instead of the golden week")] = None,
    against: Annotated[
        Path | None, typer.Option(help="Judge on the golden week of this other model, or folder of models")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say whether models still give the scores and alerts of their golden week. Exit code 1: one does not."""
    raise typer.Exit(_training().check_models(model, files or [], against, as_json=as_json, console=Console()))


@train_app.command("promote")
def train_promote(
    models: Annotated[Path, typer.Argument(help="Folder with models")],
    machine: Annotated[str, typer.Argument(help="Name of the machine")],
    version: Annotated[str, typer.Argument(help="The version, or its first digits")],
) -> None:
    """Let another version of a machine's model score; also the way back."""
    _training().promote_model(models, machine, version, Console())


def _parameter(text: str) -> tuple[str, Any]:
    """NAME=VALUE, the value a whole number, a number, true, false, none or a text."""
    name, named, value = text.partition("=")
    if not named or not name:
        raise UsageError(f"--parameter {text}: it has to be NAME=VALUE")
    words: dict[str, Any] = {"true": True, "false": False, "none": None}
    if value.lower() in words:
        return name, words[value.lower()]
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def _training() -> ModuleType:
    """Return the module that trains, which needs what the twin needs."""
    try:
        from cnctwin.training.anomaly import train as command
    except ImportError as error:
        raise UsageError(f"{error.name} is not installed, which trains models: pip install 'cnctwin[anomaly]'") from None
    return command
