"""`cnctwin jobs`: run the batch consumer; ask for jobs, look at them, cancel them, over the broker.

Exit codes: 0 = done; 1 = refused, failed, cancelled, or nobody answers; 2 = wrong input.
"""

import json
import logging
import sys
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from cnctwin.commands.options import AsJson, Broker, Dask, Group, Wait
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_encoded, read_text
from cnctwin.jobs.client import JobsClient, NoAnswerError
from cnctwin.jobs.consumer import Consumer, Setting
from cnctwin.jobs.dask_cluster import DaskCluster
from cnctwin.jobs.job_queue import Limits
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.look_around import refuse_second
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import moment_text
from cnctwin.terminal.table import text_table
from edge.state_dir import state_dir
from sparkplug.broker import BrokerAddress
from sparkplug.metric import NodeId
from twin.vocabulary.nodes import JOBS_NODE

jobs_app = typer.Typer(
    no_args_is_help=True, help="Optimise, identify, diagnose as jobs: asked for over the broker, done in turn."
)
JobId = Annotated[str, typer.Argument(metavar="ID", help="Id of the job, as `list` shows it")]
GONE_S_MAX = 60.0
TABLE_WIDTH = 140


class Kind(StrEnum):
    """The kinds of jobs that can be asked for."""

    OPTIMISE = "optimise"
    IDENTIFY = "identify"
    DIAGNOSE = "diagnose"


@jobs_app.command("run")
def run(
    files: Annotated[
        Path | None,
        typer.Option(
            "--jobs-files",
            "--files",
            help="Folder below which requests may name files; else they may name none",
            show_default=False,
        ),
    ] = None,
    folder: Annotated[
        Path | None, typer.Option("--dir", "--jobs", help="Folder of jobs and results; else jobs in the state folder")
    ] = None,
    broker: Broker = None,
    group: Group = "cnc",
    workers: Annotated[int, typer.Option(help="Processes that a job is spread over", min=1, max=256)] = 1,
    dask: Dask = None,
    hours_max: Annotated[float, typer.Option(help="A job that takes longer is ended", min=0.001, max=8760.0)] = 24.0,
    queued_max: Annotated[int, typer.Option(help="Jobs that may wait", min=1, max=10_000)] = 50,
    kept_max: Annotated[int, typer.Option(help="Jobs that are kept when they are over", min=1, max=10_000)] = 100,
    kept_days: Annotated[float, typer.Option(help="Days for which they are kept", min=0.01, max=36_500.0)] = 30.0,
) -> None:
    """Take jobs from the broker and do them, one at a time, until SIGTERM or Ctrl-C; what runs then goes on at the next start."""
    if files is not None and not files.is_dir():
        raise UsageError(f"--files {files}: is no folder")
    if dask is not None:
        DaskCluster.from_text(dask)
    logging.getLogger("cnctwin.jobs").setLevel(logging.INFO)
    kept = folder or state_dir() / "jobs"
    limits = Limits(queued_max=queued_max, kept_max=kept_max, kept_days=kept_days, seconds_max=3600.0 * hours_max)
    setting = Setting(files, group, kept / f"{JOBS_NODE}.json", workers, dask, limits)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as at:
        consumer = Consumer(kept, at, setting)  # which holds the folder and the name on this machine
        refuse_second(at, [NodeId(group, JOBS_NODE)], "end that one first, or give this one another --group")
        below = "no files" if files is None else f"files below {files}"
        print(f"jobs of {at.url} are done here: {below}, results in {kept}", file=sys.stderr)
        consumer.run(stop)


@jobs_app.command("submit")
def submit(
    request: Annotated[Path | None, typer.Argument(help="A request as JSON; else the options", show_default=False)] = None,
    job: Annotated[Kind | None, typer.Option(help="Kind of job", show_default=False)] = None,
    case: Annotated[str | None, typer.Option(help="identify, diagnose: a folder below the consumer's files")] = None,
    free_gains: Annotated[bool, typer.Option("--free-gains", help="identify: fit the loop gains too")] = False,
    program: Annotated[Path | None, typer.Option(help="optimise: a file here, which is sent")] = None,
    machine: Annotated[
        Path | None, typer.Option("--machine", "--machine-file", help="optimise: a machine.toml here, which is sent")
    ] = None,
    objective: Annotated[str | None, typer.Option(help="optimise: time, cost or pareto")] = None,
    force_limit_n: Annotated[float | None, typer.Option(help="optimise: no cutting force above it")] = None,
    probability: Annotated[float | None, typer.Option(help="optimise: probability with which the force limit is kept")] = None,
    seed: Annotated[int | None, typer.Option(help="optimise: seed of the random numbers")] = None,
    evolutions: Annotated[int | None, typer.Option(help="optimise: evolutions of each island")] = None,
    population: Annotated[int | None, typer.Option(help="optimise: programs in each island")] = None,
    speed_changes: Annotated[str | None, typer.Option(help="optimise: anywhere, in_air or per_tool")] = None,
    job_id: Annotated[str | None, typer.Option("--id", help="Id of the job: asking twice with the same one asks once")] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Stay until it is over")] = False,
    broker: Broker = None,
    wait_s: Wait = 15.0,
    as_json: AsJson = False,
) -> None:
    """Ask for a job. Exit code 0: it was accepted (with --follow: it is done); 1: it was not, or nobody answers."""
    given: dict[str, Any] = {"case": case, "objective": objective, "force_limit_n": force_limit_n, "probability": probability}
    given |= {
        "seed": seed,
        "evolutions": evolutions,
        "population": population,
        "speed_changes": speed_changes,
        "free_gains": free_gains or None,
    }
    given |= {**_program(program), "machine_toml": None if machine is None else read_text(machine), "job": job and str(job)}
    document = {key: value for key, value in given.items() if value is not None}
    if request is not None and document:
        raise UsageError(f"{request}: give either a request or options (--{next(iter(document)).replace('_', '-')})")
    if request is None and job is None:
        raise UsageError("give a file with a request, or --job")
    document = document if request is None else _document(request)
    document |= {} if job_id is None else {"id": job_id}
    with JobsClient(_broker(broker)) as jobs:
        answer = _answered(lambda: jobs.submit(document, wait_s))
        if answer["answer"] == "refused":
            _bad_news(f"refused: {answer['reason']}")
        if follow:
            answer = _followed(jobs, answer["id"])
    _print(answer, as_json)
    raise typer.Exit(1 if answer.get("state") in {"failed", "cancelled"} else 0)


@jobs_app.command("list")
def list_jobs(broker: Broker = None, wait_s: Wait = 5.0, as_json: AsJson = False) -> None:
    """List what runs, what waits, what is over."""
    with JobsClient(_broker(broker)) as jobs:
        state = _answered(lambda: jobs.state(wait_s))
        if as_json:
            sys.stdout.write(json.dumps(state) + "\n")
            return
        columns = ("job", "kind", "machine", "state", "%", "attempt", "accepted (UTC)", "what")
        standard_output(TABLE_WIDTH).print(text_table(columns, map(_row, state["jobs"])))
        trouble = state["disk_trouble"]
    if trouble:
        _bad_news(f"the consumer cannot write: {trouble}")


@jobs_app.command("show")
def show(
    job_id: JobId,
    broker: Broker = None,
    wait_s: Wait = 5.0,
    as_json: AsJson = False,
) -> None:
    """One job with its result. Exit code 1: it failed, or was cancelled."""
    with JobsClient(_broker(broker)) as jobs:
        found = jobs.job(job_id, wait_s)
        _print(found, as_json)
        is_lost = found.get("state") in {"failed", "cancelled"}
    raise typer.Exit(1 if is_lost else 0)


@jobs_app.command("cancel")
def cancel(
    job_id: JobId,
    broker: Broker = None,
    wait_s: Wait = 15.0,
    as_json: AsJson = False,
) -> None:
    """End a job that waits or runs. Exit code 1: it was not there, or over."""
    with JobsClient(_broker(broker)) as jobs:
        answer = _answered(lambda: jobs.cancel(job_id, wait_s))
        if answer["answer"] != "cancelled":
            _bad_news(answer["reason"])
        _print(answer, as_json)


def _row(job: Mapping[str, Any]) -> list[str]:
    waits = f"{job['state']}, {job['place']}." if job["state"] == "queued" else job["state"]
    what = job["doing"] if job["state"] == "running" else job["reason"] or job["sentence"]
    row = (job["id"], job["kind"], job["machine"], waits, f"{job['progress_pct']:.0f}", job["attempt"])
    return [str(cell) for cell in (*row, moment_text(job["accepted_ms"]), what)]


def _broker(url: str | None) -> BrokerAddress:
    return address(url) or BrokerAddress()


def _answered(ask: Any) -> dict[str, Any]:
    try:
        return dict(ask())
    except NoAnswerError as error:
        _bad_news(str(error))


def _followed(jobs: JobsClient, job_id: str) -> dict[str, Any]:
    """The job when it is over; a bar meanwhile, where that is a terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(job_id, total=100.0)
        while True:
            found = jobs.job(job_id, GONE_S_MAX)
            bar.update(task, completed=found["progress_pct"], description=str(found["doing"] or found["state"]))
            if found["state"] not in {"queued", "running"}:
                return found
            jobs.until(lambda changed_ms=found["changed_ms"]: jobs.job(job_id)["changed_ms"] != changed_ms, 1.0)  # type: ignore[misc]
            _answered(lambda: jobs.state(GONE_S_MAX))


def _print(told: dict[str, Any], as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(told) + "\n")
        return
    console = Console(soft_wrap=True)
    for key, value in told.items():
        if value not in (None, "", {}):
            shown = moment_text(value) if key.endswith("_ms") else json.dumps(value, ensure_ascii=False)
            console.print(f"{key}: {shown.strip(chr(34))}", markup=False, highlight=False)


def _document(file: Path) -> dict[str, Any]:
    try:
        document = json.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{file}: is not JSON: {error}") from None
    if not isinstance(document, dict):
        raise UsageError(f"{file}: holds no JSON object")
    return document


def _program(file: Path | None) -> dict[str, str]:
    """Its text, and its encoding where that is not the one which is taken without a word."""
    if file is None:
        return {}
    text, encoding = read_encoded(file)
    return {"program_text": text, "name": file.name[-120:]} | ({} if encoding == "utf-8" else {"encoding": encoding})


def _bad_news(line: str) -> NoReturn:
    print(f"cnctwin: {''.join(letter if letter.isprintable() else ' ' for letter in line)}", file=sys.stderr)
    raise typer.Exit(1)
