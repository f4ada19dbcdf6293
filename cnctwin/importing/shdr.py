"""From a recording of an MTConnect adapter to run logs of canonical signals, by the same parts that an edge lives on: agent,
parser, mapping, tool-change machine. Nothing is sent anywhere.

A recording may hold stretches that are hours apart, in any order: a step of the clock beyond `STEP_BACK_S` backwards or
`PAUSE_S_MAX` forwards begins another run. A row holds what changed at one time, the first one all that was known; a signal that
became unknown has no value in a run log, as one that did not change.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlencode

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from cnctwin.errors import UsageError
from cnctwin.files.output import check_suffix, write
from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.dialect import dialect
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from cnctwin.standins.mtconnect_agent.recording import Recording
from cnctwin.standins.mtconnect_agent.request import Answer, answer
from edge.config import EdgeConfig
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.cursor import next_request, parse, start
from edge.running.pipeline import Pipeline
from edge.sample import EdgeSample, SampleSet
from sparkplug.quality import Quality
from twin.runlog import COLUMNS, TEXT_COLUMNS, RunLog, run_log, write_run

LINES = 200
"""That go into the agent before it is asked: far fewer observations than its buffer holds."""
BUFFER_SIZE = 131_072
COUNT = 100_000
PAUSE_S_MAX = 600.0
STEP_BACK_S = 10.0
SETTLED_S = 60.0
"""Silence at the end, so that a tool change is told whose number has stood long enough."""


def recorded_rows(
    recording: Path, devices: Path | None, device: str | None = None, following: Sequence[Path] = ()
) -> Iterator[tuple[EdgeSample, ...]]:
    """Yield what an edge would have published of a recording, a row for each moment. Raises ReplayError, EdgeError.

    following: files that go on where the recording ends; what was known holds in them.
    """
    source, spoken = Recording(recording), dialect("2.3", None)
    model, chosen = source.device_model(devices, device, spoken.schema)
    agent = Agent(model, chosen, spoken, buffer_size=BUFFER_SIZE, assets_max=1024, now=lambda: 0.0)
    config = EdgeConfig(MtconnectConfig(device=chosen.name, count=COUNT))
    cursor, pipeline = start(config), Pipeline(config)
    lines = chain.from_iterable(part.lines() for part in (source, *map(Recording, following)))
    is_over = False
    while not is_over:
        cursor_before = cursor
        path, parameters = next_request(config, cursor, streams=False)
        with agent.changed:
            reply = answer(agent, "GET", f"{path}?{urlencode(parameters)}")
        assert isinstance(reply, Answer)
        cursor, frame = parse(config, cursor, reply.body.encode())
        yield from pipeline.take(frame, 0.0).rows
        if cursor == cursor_before:
            news = list(islice(lines, LINES))
            for line in news:
                agent.receive(line)
            is_over = not news
    yield from pipeline.take(SampleSet(), SETTLED_S).rows


def recorded_runs(
    recording: Path, devices: Path | None, device: str | None = None, following: Sequence[Path] = ()
) -> list[RunLog]:
    """The run logs of a recording, oldest stretch as it stands in the file first. Raises ReplayError, EdgeError."""
    stretches: list[list[_Moment]] = []
    known: dict[str, EdgeSample] = {}
    for row in recorded_rows(recording, devices, device, following):
        told = {sample.signal: sample for sample in row if not (sample.is_baseline and sample.value is None)}
        if not told:
            continue
        at_s = max(sample.timestamp_ms for sample in told.values()) / 1000
        last_s = stretches[-1][-1].at_s if stretches else math.inf
        known = known | told
        if not last_s - STEP_BACK_S <= at_s <= last_s + PAUSE_S_MAX:
            stretches.append([_Moment(at_s, known)])
        elif at_s <= last_s:  # as old as the moment before: what it says holds from then on
            stretches[-1][-1].told.update(told)
        else:
            stretches[-1].append(_Moment(at_s, told))
    return [_run(stretch, str(recording)) for stretch in stretches if len(stretch) > 1]


def import_shdr(recordings: Sequence[Path], devices: Path, device: str | None, out: Path, console: Console) -> None:
    """Write the run logs of a recording in one file or several, and say what is in them. Raises UsageError."""
    check_suffix(out)
    recording, *following = recordings
    names = ", ".join(path.name for path in recordings)
    try:
        runs = recorded_runs(recording, devices, device, following)
    except ReplayError as error:
        raise UsageError(str(error)) from None
    if not runs:
        raise UsageError(f"{names}: no signal of {devices.name} is in it; is it the Devices.xml that belongs to it?")
    table = Table(title=f"{len(runs)} {'stretch' if len(runs) == 1 else 'stretches'} in {names}", title_justify="left")
    for column in ("file", "lasted", "rows", "tool changes", "signals"):
        table.add_column(column)
    for number, run in enumerate(runs, start=1):
        path = out if len(runs) == 1 else out.with_stem(f"{out.stem}-{number}")
        write(lambda run=run, path=path: write_run(run, path), path)  # type: ignore[misc]
        signals = ", ".join(sorted({*run.columns, *run.text} - {"t_s"}))
        table.add_row(str(path), f"{run.t_s[-1]:.0f} s", str(len(run)), str(_changes(run)), signals)
    console.print(table)


def _changes(run: RunLog) -> int:
    """Return the number of tool changes that begin in a run."""
    active = run.columns.get("tool_change_active", np.array([]))
    return int((np.diff(active[np.isfinite(active)]) > 0.0).sum())


_RENAMED = {"nc_line": "line"}


class _Moment(NamedTuple):
    at_s: float
    told: dict[str, EdgeSample]


def _run(moments: Sequence[_Moment], source: str) -> RunLog:
    told = {name for moment in moments for name in moment.told}
    names = {column: name for name in told if (column := _RENAMED.get(name, name)) in COLUMNS | TEXT_COLUMNS}
    columns: dict[str, NDArray[np.generic]] = {"t_s": np.array([moment.at_s for moment in moments]) - moments[0].at_s}
    for column in sorted(names):
        empty = None if column in TEXT_COLUMNS else math.nan
        values = np.array([_value(moment.told.get(names[column]), empty) for moment in moments], dtype=object)
        columns[column] = values if column in TEXT_COLUMNS else values.astype(np.float64)
    return run_log(columns, source)


def _value(sample: EdgeSample | None, empty: float | None) -> object:
    if sample is None or sample.value is None or sample.quality is not Quality.GOOD:
        return empty
    return sample.value if empty is None else float(sample.value)
