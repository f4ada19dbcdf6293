"""Parts compared with parts on the stream: what the replay gives over the same ticks, why, what a person says, and a restart."""

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cnctwin.standins.simulated_machine.expectation import EXPECTATION
from processors.actions import Action, DeadLetter, Publish
from processors.config import Configuration
from processors.errors import ConfigurationError
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.introduction import BASIS
from processors.joint_anomaly.member import ADJUSTED, ALARM, GATE
from processors.joint_anomaly.parts_member import CUT_RECORD, KNOWS, NO_ALARM, RAW, VERDICTS, WHY
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scorings
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.processors.joint_anomaly.test_processor import PlainModel, metric, together
from tests.processors.streams import T0_MS, birth, data, event, fed, reading
from tests.twin.anomaly.parts.milled import SIGNALS, fitted, parts, recorded
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.replay import replayed
from twin.anomaly.parts_scorer import PartsScorer
from twin.expected.files import ByProgram, read_expectation
from twin.vocabulary.topics import VERDICT

THRESHOLD = 2.0
PART_S = 92
T0_S = T0_MS / 1000.0


@cache
def models() -> tuple[AnomalyModel, ...]:
    return tuple(AnomalyModel(SIGNALS, PartsScorer(one)) for one in fitted())


def cell(*machines: str, **table: Any) -> Engine:
    by_name = dict(zip(machines, models(), strict=False))
    configuration = Configuration(
        Config,
        {"threshold": THRESHOLD, "tail_s": 2.0, "calm_s": 0.0} | table,
        name="joint_anomaly",
        reads=lambda one: scorings(one, by_name),
    )
    return Engine(PROCESSOR, configuration)


def told(machine: str, rows: list[dict[str, Any]]) -> list[HostEvent]:
    """The birth, and each row half a second before its tick."""
    node, first = NodeId("cnc", machine), {"feed_override_pct": 100.0, "spindle_override_pct": 100.0, **rows[0]}
    later = [data(at + 0.5, device=machine, node=node, **row) for at, row in enumerate(rows[1:], 1)]
    ends = [data(len(rows) + late_s, device=machine, node=node, **rows[-1]) for late_s in (0.5, 1.5)]
    return [birth(0.5, device=machine, node=node, **first), *later, *ends]


def said(machine: str, name: str, actions: list[Action]) -> list[tuple[float, Any, str | None]]:
    return [
        ((change.timestamp_ms - T0_MS) / 1000, change.value, change.reason)
        for action in actions
        if isinstance(action, Publish) and action.machine == machine
        for change in action.changes
        if change.name == name
    ]


def heard(engine: Engine, machine: str, text: str, at_s: float) -> list[Action]:
    """A verdict comes over the broker."""
    return engine.plain(VERDICT + machine, text.encode(), T0_MS + round(at_s * 1000))


FAULTY = parts(2, 6, {4: 1.6})


def by_tick(series: list[tuple[float, Any]], count: int) -> list[float]:
    """The value at each tick from the first on: what did not change is not published again."""
    values, last, found = dict(series), None, []
    for tick in range(1, count + 1):
        last = values.get(float(tick), last)
        found.append(np.nan if last is None else last)
    return found


def test_what_is_published_live_is_what_the_replay_gives() -> None:
    rows = {"a": parts(1, 6), "b": FAULTY}
    actions = fed(cell("a", "b"), *together(*(told(name, own) for name, own in rows.items())))
    cells = [recorded(own, name, first_tick=T0_MS // 1000 + 1) for name, own in rows.items()]
    expected = replayed([one.parts for one in models() if one.parts], cells, [AlarmRule(THRESHOLD)] * 2)
    for place, name in enumerate(rows):
        gated = cells[place].gated
        raw, adjusted = (by_tick(metric(actions, signal, name), len(gated)) for signal in (RAW, ADJUSTED))
        np.testing.assert_array_equal(raw, expected.own_scores[:, place])
        np.testing.assert_array_equal(
            adjusted, np.where(gated & ~np.isnan(expected.scores[:, place]), 0.0, expected.scores[:, place])
        )
        np.testing.assert_array_equal(
            np.nan_to_num(by_tick(metric(actions, ALARM, name), len(gated))).astype(bool), expected.is_alarm[:, place]
        )
        records = [json.loads(value) for _, value, _ in said(name, CUT_RECORD, actions) if value]
        own = [json.loads(record.in_json()) for at, record in expected.records if at == place]
        assert records == own
        assert len(own) >= 10
    assert [on for _, on in metric(actions, ALARM, "b")].count(True) == 1
    assert True not in [on for _, on in metric(actions, ALARM, "a")]
    assert not [one for one in actions if isinstance(one, DeadLetter)]


def test_an_alarm_says_why_while_it_is_on() -> None:
    actions = fed(cell("a"), *told("a", FAULTY))
    came_s = next(at_s for at_s, on in metric(actions, ALARM) if on)
    assert 4 * PART_S < came_s < 5 * PART_S
    whys = said("a", WHY, actions)
    assert whys[0][1:] == (None, NO_ALARM)
    first = json.loads(next(value for at_s, value, _ in whys if at_s == came_s))
    assert (first["signal"], first["program"]) in {("spindle_load_pct", "O1"), ("vibration_rms_g", "O1")}
    assert first["measured"] > 1.1 * first["expected"] > 0.0
    assert first["lines"][0] >= 100
    went_s = [at_s for at_s, on in metric(actions, ALARM) if on is False and at_s > came_s]
    assert [(at_s, reason) for at_s, value, reason in whys if value is None][1:] == [(at_s, NO_ALARM) for at_s in went_s[:1]]


def test_it_says_how_many_parts_it_knows_and_that_it_knows_nothing_of_a_new_program() -> None:
    actions = fed(cell("a"), *told("a", [*parts(3, 2), *parts(4, 3, program="O9")]))
    knows = [value for _, value, _ in said("a", KNOWS, actions) if value]
    assert any(value.endswith("parts") for value in knows[:2])
    assert any(value.startswith("nothing") for value in knows)
    assert knows[-1] == "2 parts"


@pytest.mark.parametrize("cut", [150, 380, 410, 470])
def test_a_restart_anywhere_changes_nothing(cut: int) -> None:
    stream = together(told("a", parts(1, 6)), told("b", FAULTY))
    whole, first, second = (cell("a", "b") for _ in range(3))
    expected = fed(whole, *stream)
    before = fed(first, *stream[: 2 * cut])
    second.restore(first.snapshot("all"))
    births = []
    for machine in "ab":
        row = first._machines[machine].live.row
        values = [reading(name, one.value, (one.timestamp_ms - T0_MS) / 1000) for name, one in row.items()]
        births.append(event(EventKind.BIRTH, cut - 0.5, *values, node=NodeId("cnc", machine), device=machine))
    after = fed(second, *births, *stream[2 * cut :])
    for name in (RAW, ADJUSTED, ALARM, GATE, CUT_RECORD):
        for machine in "ab":
            assert metric(before, name, machine) + metric(after, name, machine) == metric(expected, name, machine)
    assert second.snapshot("all") and not [one for one in after if isinstance(one, DeadLetter)]


def spoken(word: str, at_s: float, **more: Any) -> str:
    return json.dumps({"version": 1, "alarm_at_s": T0_S + at_s, "verdict": word, "by": "ada", "at_s": T0_S + at_s + 5.0, **more})


def test_an_alarm_that_is_called_false_goes_out_at_once_and_the_outcome_can_be_seen() -> None:
    stream = told("a", FAULTY)
    engine = cell("a")
    came_s = next(at_s for at_s, on in metric(fed(cell("a"), *stream), ALARM) if on)
    before = fed(engine, *stream[: round(came_s) + 4])
    assert metric(before, ALARM)[-1][1] is True
    actions = heard(engine, "a", spoken("false", came_s, id="x1", label="new coolant"), came_s + 5.0)
    assert metric(actions, ALARM)[-1][1] is False
    outcome = json.loads(said("a", VERDICTS, actions)[-1][1])
    assert (outcome["outcomes"][0]["id"], outcome["outcomes"][0]["is_done"]) == ("x1", True)
    assert outcome["alarms"][0]["said"]["label"] == "new coolant"
    assert heard(engine, "a", spoken("false", came_s, id="x1", label="new coolant"), came_s + 6.0) == []


def test_an_alarm_that_is_called_true_stands_until_a_part_has_run_without_it() -> None:
    stream = told("a", [*FAULTY, *parts(9, 5)])
    engine = cell("a")
    came_s = next(at_s for at_s, on in metric(fed(cell("a"), *stream), ALARM) if on)
    actions = fed(engine, *stream[: round(came_s) + 4])
    actions += heard(engine, "a", spoken("true", came_s), came_s + 5.0)
    actions += fed(engine, *stream[round(came_s) + 4 :])
    went_s = [at_s for at_s, on in metric(actions, ALARM) if on is False and at_s > came_s]
    by_itself = [at_s for at_s, on in metric(fed(cell("a"), *stream), ALARM) if on is False and at_s > came_s]
    assert went_s[0] > by_itself[0]


def test_a_verdict_that_is_none_is_a_dead_letter_and_one_of_another_cell_is_passed_by() -> None:
    engine = cell("a")
    fed(engine, *told("a", parts(1, 2)))
    before = engine.snapshot("all")
    (letter,) = heard(engine, "a", '{"version":1}', 200.0)
    assert isinstance(letter, DeadLetter)
    assert b"alarm_at_s" in letter.payload
    assert heard(engine, "zzz", "{", 200.0) == []
    assert json.loads(engine.snapshot("all"))["live"]["state"] == json.loads(before)["live"]["state"]


def test_a_part_of_an_alarm_without_a_verdict_is_never_learned() -> None:
    """Three parts at 1.6 of the load: nothing is known of more parts after them than before."""
    engine = cell("a")
    actions = fed(engine, *told("a", parts(5, 8, {4: 1.6, 5: 1.6, 6: 1.6})))
    records = [json.loads(value) for _, value, _ in said("a", CUT_RECORD, actions) if value]
    of_tool_2 = [(one["is_alarmed"], one["parts_known"]) for one in records if one["tool"] == 2]
    known = of_tool_2[4][1]
    assert of_tool_2[4:7] == [(True, known)] * 3


def test_a_model_that_was_trained_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model = PlainModel()
    model.parts = None  # type: ignore[attr-defined]
    monkeypatch.setattr("processors.joint_anomaly.scoring._models_in", lambda _: {"a": model})
    with pytest.raises(ConfigurationError, match="the model of a was not trained for it: train it again, or set the common_mode"):
        PROCESSOR.configured({"models": "somewhere"})
    monkeypatch.setattr("processors.joint_anomaly.scoring._models_in", lambda _: {"a": models()[0]})
    with pytest.raises(ConfigurationError, match=r"tick_s = 0.1, but the model of a was trained with 1"):
        PROCESSOR.configured({"models": "somewhere", "tick_s": 0.1})


def test_the_snapshot_of_a_machine_with_parts_stays_small() -> None:
    engine = cell("a")
    fed(engine, *told("a", FAULTY))
    assert len(engine.snapshot("all")) < 40_000


def test_what_the_twin_expects_is_named_and_is_stale_once_the_machine_is_described_anew() -> None:
    """The expectation was made for description 0123456789ab; `thermal` tells which one is live."""
    expected = {"a": ByProgram([replace(read_expectation(EXPECTATION), machine="a", description="0123456789ab")])}
    by_name = {"a": models()[0]}
    table = {"threshold": THRESHOLD, "tail_s": 2.0}
    engine = Engine(
        PROCESSOR, Configuration(Config, table, name="joint_anomaly", reads=lambda one: scorings(one, by_name, expected))
    )
    rows, named = parts(1, 1), "twin/spindle_temp_basis"
    rows[10][named], rows[30][named] = "description 0123456789ab; started cold", "description ba9876543210; started cold"
    actions = fed(engine, *told("a", rows))
    basis = [value for _, value, _ in said("a", BASIS, actions)]
    assert "; the twin expects base_plate; gate" in basis[0]
    assert ["stale" in text for text in basis] == [False, True]
    assert "cnctwin expect makes them again" in basis[1]
