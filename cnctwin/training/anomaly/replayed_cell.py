"""The recordings of a cell, sent through the processor itself: scores as they will come out on the day.

Messages between two ticks are put together to one, since a score sees only what was last said before its tick; a change of
`tool_change_active` keeps its own time.
"""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.training.anomaly.held_rows import held_rows, milliseconds
from cnctwin.training.anomaly.parts_cell import PartTicks, cell_of_parts, tracks_of_parts
from cnctwin.training.anomaly.recorded_cell import TOOL_CHANGE, Stretch
from cnctwin.training.anomaly.track import Track
from processors.actions import DeadLetter
from processors.config import Configuration
from processors.contract import Output, Outputs, Sample
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.member import ADJUSTED, GATE
from processors.joint_anomaly.parts_member import RAW
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scorings
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from twin.anomaly.common_mode import Method
from twin.anomaly.model import AnomalyModel
from twin.anomaly.preparation import CONTEXT, SPEED, TURNS_RPM_MIN
from twin.runlog import RunLog

Floats = NDArray[np.float64]
START_MS = 1_767_225_600_000  # 1 January 2026 UTC: t_s = 0


class _Times(NamedTuple):
    start_ms: int
    tick_ms: int
    gap_ms: int


@dataclass(slots=True)
class _MachineScores:
    """The fold's output for one machine; rows of (time, adjusted, gated)."""

    raw: dict[int, float] = field(default_factory=dict)
    judged: list[list[Any]] = field(default_factory=list)
    is_gated: bool = False


def replayed(stretch: Stretch, models: Mapping[str, AnomalyModel], settings: Mapping[str, Any]) -> dict[str, Track]:
    """The scores of each machine. `settings` are the processor's. Raises UsageError where a sample cannot be folded."""
    if settings.get("common_mode", Config().common_mode) == Method.PARTS:
        return _replayed_parts(stretch, models, settings)
    told = {name: _MachineScores() for name in stretch}
    configuration = Configuration(Config, settings, name=PROCESSOR.name, reads=lambda config: scorings(config, models))

    def step(config: Configuration[Config], state: Any, sample: Sample) -> tuple[Any, Outputs]:
        state, outputs = PROCESSOR.step(config, state, sample)
        for output in outputs:
            if isinstance(output, Output):
                _note(told[output.machine or sample.machine], output, sample.at_s)
        return state, outputs

    engine = Engine(replace(PROCESSOR, step=step), configuration)
    tick_ms, gap_ms = round(configuration.default.tick_s * 1000), round(configuration.default.gap_s_max * 1000)
    start_ms = START_MS - START_MS % tick_ms  # so that ticks are multiples in t_s as well
    streams = [_messages(name, run, models[name].features, _Times(start_ms, tick_ms, gap_ms)) for name, run in stretch.items()]
    for event in heapq.merge(*streams, key=lambda one: one.timestamp_ms):
        for action in engine.feed(event, 0.0):
            if isinstance(action, DeadLetter):
                raise UsageError(f"{event.device}: a sample cannot be scored: {action.payload.decode('utf-8', 'replace')[:300]}")
    tracks = {}
    for name, one in told.items():
        at_ms = np.array([row[0] - start_ms for row in one.judged], dtype=np.int64)
        tracks[name] = _track(one, at_ms, start_ms, _stands(models[name], stretch[name], at_ms, (tick_ms, gap_ms)))
    return tracks


def _replayed_parts(stretch: Stretch, models: Mapping[str, AnomalyModel], settings: Mapping[str, Any]) -> dict[str, Track]:
    """The scores of parts; they alarm and learn by the threshold of each model, whatever that of the settings."""
    config = Config.model_validate(settings)
    parts = {name: model.parts for name, model in models.items() if name in stretch and model.parts is not None}
    if other := [name for name in stretch if name not in parts]:
        raise UsageError(f"the model of {other[0]} was not trained for common_mode = parts: train it again")
    first = next(iter(parts.values()))
    ticks = PartTicks(
        signals=first.signals,
        tick_ms=config.tick_ms,
        gap_ms=round(config.gap_s_max * 1000),
        tail_s=config.tail_s,
        look_back_s=config.look_back_s,
    )
    rules = [None if found is None else found.rule for found in (models[name].calibration for name in parts)]
    cell = cell_of_parts(tuple(parts), [stretch], ticks)
    return dict(zip(parts, tracks_of_parts(cell, tuple(parts.values()), rules), strict=True))


def _note(told: _MachineScores, output: Output, at_s: float) -> None:
    if output.name == RAW:
        told.raw[round(at_s * 1000)] = np.nan if output.value is None else float(output.value)  # type: ignore[arg-type]
    elif output.name == ADJUSTED:
        at_ms = round((at_s if output.at_s is None else output.at_s) * 1000)
        told.judged.append([at_ms, np.nan if output.value is None else output.value, told.is_gated])
    elif output.name == GATE:
        told.is_gated = output.value is True
        told.judged[-1][2] = told.is_gated


def _track(told: _MachineScores, at_ms: NDArray[np.int64], start_ms: int, stands: NDArray[np.bool_]) -> Track:
    gated = np.array([row[2] for row in told.judged], dtype=np.bool_)
    raw = np.array([told.raw.get(at + start_ms, np.nan) for at in at_ms.tolist()], dtype=np.float64)
    return Track(at_ms / 1000.0, raw, np.array([row[1] for row in told.judged], dtype=np.float64), gated, gated | stands)


def _stands(model: AnomalyModel, run: RunLog, at_ms: NDArray[np.int64], periods_ms: tuple[int, int]) -> NDArray[np.bool_]:
    if model.preparation is None or SPEED not in model.features:
        return np.zeros(len(at_ms), dtype=np.bool_)
    ticks, rows = held_rows(run, (SPEED,), *periods_ms)
    return np.asarray(rows[np.searchsorted(ticks, at_ms), 0] < TURNS_RPM_MIN)


def _messages(machine: str, run: RunLog, features: Sequence[str], times: _Times) -> Iterator[HostEvent]:
    node, at_ms = NodeId("cnc", machine), milliseconds(run.t_s)
    others = [name for name in (TOOL_CHANGE, *CONTEXT) if name in run.text or (name in run.columns and name not in features)]
    names = [*features, *others]
    columns = [run.text[name] if name in run.text else run.columns[name] for name in names]
    known = np.column_stack([_is_told(column) for column in columns])
    flags = run.columns[TOOL_CHANGE] if TOOL_CHANGE in names else np.full(len(at_ms), np.nan)
    sent = _sent(flags, at_ms, times)
    told = np.maximum.accumulate(np.where(known, np.arange(len(at_ms))[:, None], -1), axis=0)
    before = np.concatenate([np.full((1, len(names)), -1), told[sent[:-1]]])
    kind = EventKind.BIRTH
    for row, earlier in zip(sent.tolist(), before, strict=True):
        stamp = times.start_ms + int(at_ms[row])
        readings = []
        for column, name in enumerate(names):
            if told[row, column] > earlier[column]:
                readings.append(_reading(name, _value(name, columns[column][told[row, column]]), stamp))
            elif kind is EventKind.BIRTH:
                readings.append(_reading(name, None, stamp))
        yield HostEvent(kind, node, machine, stamp, tuple(readings))
        kind = EventKind.DATA


def _is_told(column: NDArray[Any]) -> NDArray[np.bool_]:
    if column.dtype == object:
        return np.array([value is not None and value != "" for value in column], dtype=np.bool_)
    return np.asarray(np.isfinite(column))


def _value(name: str, value: Any) -> float | bool | str:
    if isinstance(value, str):
        return value
    return bool(value > 0.0) if name == TOOL_CHANGE else float(value)


def _reading(name: str, value: float | bool | str | None, stamp: int) -> Reading:
    return Reading(name, value, stamp, Quality.GOOD if value is not None else Quality.BAD, None, None, False)


def _sent(flag: Floats, at_ms: NDArray[np.int64], times: _Times) -> NDArray[np.intp]:
    """Rows at whose time a message is sent: the first, the last before each tick, one after a silence, one that tells an edge."""
    sent = np.ones(len(at_ms), dtype=np.bool_)
    sent[:-1] = at_ms[1:] // times.tick_ms != at_ms[:-1] // times.tick_ms
    sent[1:] |= np.diff(at_ms) > times.gap_ms // 2
    sent[0] = True
    told = np.flatnonzero(np.isfinite(flag))
    edges = told[1:][np.diff(flag[told] > 0.0)]
    sent[edges] = True
    sent[np.maximum(edges - 1, 0)] = True
    return np.flatnonzero(sent)
