"""Judging feature by feature, on baselines that can be read off: load 30 ± 2 %, speed 4000 ± 10 rev/min in O1 with tool 3."""

from typing import Any

import pytest

from processors.actions import Action, Publish
from processors.errors import ConfigurationError
from processors.joint_anomaly.member import ADJUSTED, ALARM, COMMON, GATE, PEER
from processors.joint_anomaly.parts_member import RAW
from processors.joint_anomaly.processor import PROCESSOR
from processors.running.engine import Engine
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from tests.processors.joint_anomaly.test_processor import PlainModel, engine_with, metric, together
from tests.processors.streams import birth, data, fed
from twin.anomaly.preparation import Preparation, Regime

USUAL = Regime(center=(30.0, 4000.0), spread=(2.0, 10.0))
SIGNALS = ("spindle_load_pct", "spindle_rpm")
PREPARATION = Preparation(
    signals=SIGNALS,
    overall=USUAL,
    smoothing_s=10.0,
    regimes={"O1|3|100": USUAL, "standing": Regime(center=(0.0, 0.0), spread=(1.0, 1.0))},
    up=(1.0, 1.0),
    down=(1.0, 1.0),
)
AT_WORK = {"spindle_load_pct": 30.0, "spindle_rpm": 4000.0, "program": "O1", "tool_number": 3, "feed_override_pct": 100.0}


class PreparedModel(PlainModel):
    """A model that is told what is usual."""

    features = SIGNALS
    preparation = PREPARATION

    def score_one(self, values: Any) -> float:
        return float(max(abs(value) for value in values)) - 5.0


def cell(*machines: str, **table: Any) -> Engine:
    return engine_with(dict.fromkeys(machines, PreparedModel()), {"threshold": 2.0, "common_mode": "features"} | table)


def work(machine: str, until_s: int, changes: dict[float, dict[str, Any]]) -> list[HostEvent]:
    """A machine at work, and what it says besides."""
    node = NodeId("cnc", machine)
    times_s = sorted({float(second) + 0.5 for second in range(until_s)} | set(changes))
    says = {"feed_override_pct": 100.0}
    return [
        birth(0.0, device=machine, node=node, tool_change_active=False, **AT_WORK),
        *(data(at_s, device=machine, node=node, **says | changes.get(at_s, {})) for at_s in times_s),
    ]


def reasons(actions: list[Action], name: str, machine: str = "a") -> list[str | None]:
    return [
        change.reason
        for action in actions
        if isinstance(action, Publish) and action.machine == machine
        for change in action.changes
        if change.name == name and change.value is None
    ]


def test_a_load_that_is_four_spreads_too_high_comes_up_with_the_smoothing_and_is_an_alarm() -> None:
    actions = fed(cell("a"), *work("a", 40, {1.5: {"spindle_load_pct": 38.0}}))
    assert dict(metric(actions, RAW))[2.0] == -1.0  # |y| = 4, at once
    adjusted = dict(metric(actions, ADJUSTED))
    assert adjusted[2.0] == pytest.approx(4.0 * (1.0 - 2.718281828**-0.1), abs=1e-6)
    assert metric(actions, ALARM)[-1] == (10.0, True)  # 4 (1 − exp(−t/10)) is at 2 after 7 s; three ticks
    assert max(adjusted.values()) < 4.0


def test_what_the_peers_share_is_no_fault_and_what_they_do_not_still_is() -> None:
    high = {1.5: {"spindle_load_pct": 38.0}}
    shared = fed(cell("a", "b"), *together(work("a", 40, high), work("b", 40, high)))
    assert True not in [on for name in "ab" for _, on in metric(shared, ALARM, name)]
    assert metric(shared, COMMON)[-1][1] is True
    assert metric(shared, PEER)[-1][1] == "b"
    fault = {1.5: {"spindle_load_pct": 38.0, "spindle_rpm": 3960.0}}  # the speed is a's alone
    actions = fed(cell("a", "b"), *together(work("a", 40, fault), work("b", 40, high)))
    assert metric(actions, ALARM)[-1][1] is True
    assert True not in [on for _, on in metric(actions, ALARM, "b")]


def test_a_peers_tool_change_neither_hides_a_fault_nor_makes_one() -> None:
    change = {3.5: {"tool_change_active": True, "spindle_load_pct": 90.0}, 30.5: {"tool_change_active": False}}
    actions = fed(cell("a", "b"), *together(work("a", 40, {3.5: {"spindle_load_pct": 38.0}}), work("b", 40, change)))
    assert metric(actions, ALARM)[-1][1] is True
    assert metric(actions, GATE, "b")[1] == (4.0, True)
    assert True not in [on for _, on in metric(actions, ALARM, "b")]


def test_a_tool_that_was_not_in_the_training_is_not_judged_and_that_is_said() -> None:
    actions = fed(cell("a"), *work("a", 20, {3.5: {"tool_number": 9, "spindle_load_pct": 60.0}}))
    assert "no baseline for program O1, tool_number 9, feed_override_pct 100" in reasons(actions, ADJUSTED)
    assert [at_s for at_s, raw in metric(actions, RAW) if raw is not None][-1] == 4.0  # the raw score is there all the same


def test_a_standing_spindle_is_no_fault_and_no_peer() -> None:
    stands = {3.5: {"spindle_rpm": 0.0, "spindle_load_pct": 0.0}}
    actions = fed(cell("a"), *work("a", 20, stands))
    assert {score for _, score in metric(actions, ADJUSTED)} == {0.0}
    assert reasons(actions, ADJUSTED) == []
    assert True not in [on for _, on in metric(actions, ALARM)]


def test_a_restart_in_the_middle_changes_nothing() -> None:
    stream = together(work("a", 40, {1.5: {"spindle_load_pct": 38.0}}), work("b", 40, {}))
    whole, first, second = (cell("a", "b", look_back_s=3.0) for _ in range(3))
    expected = fed(whole, *stream)
    before = fed(first, *stream[:30])
    second.restore(first.snapshot("all"))
    for machine in second._machines.values():  # the same edges live on, with the values they have
        machine.online.add(NodeId("cnc", machine.name))
        machine.live.is_restored = False
        machine.live.fold.show(machine.name, machine.live.row)
    after = fed(second, *stream[30:])
    for name in (RAW, ADJUSTED, ALARM):
        assert metric(before, name) + metric(after, name) == metric(expected, name)


def test_a_model_without_baselines_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processors.joint_anomaly.scoring._models_in", lambda _: {"a": PlainModel()})
    with pytest.raises(ConfigurationError, match="the model of a was not trained for it"):
        PROCESSOR.configured({"models": "somewhere", "common_mode": "features"})
