"""What is trained on is what the processor scores: the same ticks, the same held values, the same gate, message by message."""

from typing import Any

import numpy as np
import pytest

from cnctwin.training.anomaly.held_rows import held_rows, milliseconds
from cnctwin.training.anomaly.recorded_cell import part
from cnctwin.training.anomaly.replayed_cell import replayed
from processors.actions import Publish
from processors.config import Configuration
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scorings
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.cnctwin.training.anomaly.cells import FEATURES, machine_log
from twin.runlog import RunLog, run_log

START_MS = 1_767_225_600_000


class Watching:
    """A model that notes the rows that it is given; its score is the load."""

    features, calibration, preparation, in_words = FEATURES, None, None, "a model for tests"

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def score_one(self, values: Any) -> float:
        self.rows.append(tuple(values))
        return float((values[0] - 50.0) / 100.0)


def message_by_message(
    runs: dict[str, RunLog], model: Any, settings: dict[str, Any]
) -> dict[tuple[str, str], list[tuple[float, Any]]]:
    """Return what the processor publishes where each row of the logs is a message of its own: by machine and metric."""
    models = dict.fromkeys(runs, model)
    configuration = Configuration(Config, settings, name="joint_anomaly", reads=lambda config: scorings(config, models))
    engine, events = Engine(PROCESSOR, configuration), []
    for machine, run in runs.items():
        names = [*FEATURES, "tool_change_active"]
        for row, at_ms in enumerate(milliseconds(run.t_s).tolist()):
            readings = []
            for name in names:
                value: Any = float(run.columns[name][row])
                told = np.isfinite(value)
                value = value > 0.0 if name == "tool_change_active" else value
                if told or row == 0:
                    quality = Quality.GOOD if told else Quality.BAD
                    readings.append(Reading(name, value if told else None, START_MS + at_ms, quality, None, None, False))
            kind = EventKind.DATA if row else EventKind.BIRTH
            events.append(HostEvent(kind, NodeId("cnc", machine), machine, START_MS + at_ms, tuple(readings)))
    found: dict[tuple[str, str], list[tuple[float, Any]]] = {}
    for event in sorted(events, key=lambda one: one.timestamp_ms):
        for action in engine.feed(event, 0.0):
            assert isinstance(action, Publish) or type(action).__name__ == "Declare", action
            for change in action.changes if isinstance(action, Publish) else ():
                found.setdefault((action.machine, change.name), []).append(
                    ((change.timestamp_ms - START_MS) / 1000, change.value)
                )
    return found


def with_a_hole(run: RunLog, from_s: float, to_s: float) -> RunLog:
    kept = (run.t_s < from_s) | (run.t_s > to_s)
    return run_log({"t_s": run.t_s[kept], **{name: values[kept] for name, values in run.columns.items()}})


LOGS = {
    "each signal every half second": machine_log(500.0, 1),
    "signals now and then": machine_log(500.0, 2, sparse=True),
    "faster than the ticks": machine_log(120.0, 3, period_s=0.02, sparse=True),
    "slower than the ticks": machine_log(1800.0, 4, period_s=13.0, sparse=True),
    "on the ticks": run_log({**machine_log(300.0, 5, period_s=1.0).columns, "t_s": np.arange(300.0)}),
    "with a hole": with_a_hole(machine_log(1700.0, 6), 500.0, 1300.0),
    "with a short silence": with_a_hole(machine_log(500.0, 7), 200.0, 320.0),
}


@pytest.mark.parametrize("tick_s", [1.0, 0.1, 0.7])
@pytest.mark.parametrize("name", LOGS)
def test_rows_at_ticks_are_those_that_the_processor_scores(name: str, tick_s: float) -> None:
    run, model = LOGS[name], Watching()
    message_by_message({"a": run}, model, {"tick_s": tick_s, "threshold": 1.0, "common_mode": "source"})
    tick_ms = round(tick_s * 1000)
    since_tick_s = START_MS % tick_ms / 1000  # this test's clock may begin within a tick
    shifted = run_log({**run.columns, "t_s": run.t_s + since_tick_s})
    _, rows = held_rows(shifted, FEATURES, tick_ms, 600_000)
    known = rows[np.isfinite(rows).all(axis=1)]
    assert len(known) > 50
    assert np.array_equal(known, np.array(model.rows))


@pytest.mark.parametrize("name", LOGS)
@pytest.mark.parametrize("settings", [{}, {"look_back_s": 10.0}, {"tail_s": 0.0}, {"gate_s_max": 3.0}])
def test_what_is_replayed_in_few_messages_is_what_comes_out_of_all(name: str, settings: dict[str, Any]) -> None:
    run, model, settings = LOGS[name], Watching(), {"threshold": 1.0, "common_mode": "source", **settings}
    track = replayed({"a": run}, {"a": model}, settings)["a"]  # type: ignore[dict-item]
    published = message_by_message({"a": run}, model, settings)
    adjusted = {t: value for t, value in published["a", "twin/adjusted_score"] if value is not None}
    raw = {t: value for t, value in published["a", "twin/raw_score"] if value is not None}
    at = dict(
        zip(track.t_s.tolist(), zip(track.raw.tolist(), track.adjusted.tolist(), track.gated.tolist(), strict=True), strict=True)
    )
    assert len(raw) > 50
    assert {t: at[t][1] for t in adjusted} == adjusted
    assert {t: at[t][0] for t in raw if t in at} == {t: value for t, value in raw.items() if t in at}
    gates = [(t, value is True) for t, value in published["a", "twin/tool_change_gate"] if t in at]
    assert [(t, at[t][2]) for t, _ in gates] == gates


def test_machines_of_a_cell_are_judged_beside_each_other() -> None:
    runs = {"a": machine_log(900.0, 1, burst_s=[300.0]), "b": machine_log(900.0, 2, burst_s=[305.0]), "c": machine_log(900.0, 3)}
    settings = {"threshold": 1.0, "common_mode": "source", "common_mode_factor": 0.8}
    tracks = replayed(runs, dict.fromkeys(runs, Watching()), settings)  # type: ignore[arg-type]
    published = message_by_message(runs, Watching(), settings)
    for name, track in tracks.items():
        at = dict(zip(track.t_s.tolist(), track.adjusted.tolist(), strict=True))
        told = dict(published[name, "twin/adjusted_score"])
        assert {t: at[t] for t in told} == told
    a = tracks["a"]
    assert ((a.adjusted == 0.0) & (a.raw > 0.5)).sum() > 5


def test_a_part_of_a_run_begins_with_what_was_said_before_it() -> None:
    columns = {"t_s": np.arange(4.0), "spindle_rpm": np.array([1000.0, np.nan, np.nan, 900.0])}
    run = run_log(columns | {"program": np.array(["O1", None, None, "O2"], dtype=object)})
    rest = part(run, 2.0, np.inf)
    assert rest is not None
    assert rest["spindle_rpm"].tolist() == [1000.0, 900.0]
    assert rest.text["program"].tolist() == ["O1", "O2"]
