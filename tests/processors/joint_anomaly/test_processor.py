"""The joint anomaly score: gate, common mode and alarm on a cell whose model is so plain that every figure is checked by hand."""

import json
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from processors.actions import Action, DeadLetter, Publish
from processors.config import Configuration
from processors.errors import ConfigurationError
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.member import ADJUSTED, ALARM, COMMON, GATE, GATE_SOURCE, NO_MODEL, PEERS
from processors.joint_anomaly.parts_member import RAW
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scorings
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.processors.streams import T0_MS, birth, data, death, event, fed, named, reading
from twin.anomaly.common_mode import Method

A_TENTH = 0.1


class PlainModel:
    """(load − 50) / 100: 50 % is as unusual as is normal, 90 % is 0.4 worse."""

    features = ("spindle_load_pct",)
    in_words = "a model for tests"
    preparation: Any = None

    def __init__(self, calibration: Any = None) -> None:
        self.calibration = calibration

    def score_one(self, values: Sequence[float]) -> float:
        return (values[0] - 50.0) / 100.0


def engine_with(models: Mapping[str, Any], table: dict[str, Any]) -> Engine:
    """An engine whose machines have these models; judged by the published rule, where the table says nothing else."""
    table = {"common_mode": "source"} | table
    configuration = Configuration(
        Config, {"calm_s": 0.0} | table, name="joint_anomaly", reads=lambda config: scorings(config, models)
    )
    return Engine(PROCESSOR, configuration)


def cell(*machines: str, calibration: Any = None, **table: Any) -> Engine:
    """An engine whose machines all have the plain model and a threshold of 0.1."""
    return engine_with(dict.fromkeys(machines, PlainModel(calibration)), {"threshold": A_TENTH} | table)


def metric(actions: list[Action], name: str, machine: str = "a") -> list[tuple[float, Any]]:
    """(seconds after the start, value) of what was published of a metric."""
    return [
        ((change.timestamp_ms - T0_MS) / 1000, change.value)
        for action in actions
        if isinstance(action, Publish) and action.machine == machine
        for change in action.changes
        if change.name == name
    ]


def born(*machines: str, load: float = 30.0, **values: Any) -> list[HostEvent]:
    """All machines are there and idle; no tool change."""
    values = {"tool_change_active": False} | values
    return [birth(0.0, device=machine, node=NodeId("cnc", machine), spindle_load_pct=load, **values) for machine in machines]


def says(at_s: float, machine: str, **values: Any) -> HostEvent:
    return data(at_s, device=machine, node=NodeId("cnc", machine), **values)


def course(machine: str, until_s: int, changes: dict[float, dict[str, Any]]) -> list[HostEvent]:
    """Return what a machine says each second and at the changes; the load is the last one said."""
    load, stream = 30.0, []
    for at_s in sorted({float(s) + 0.5 for s in range(until_s)} | set(changes)):
        values = dict(changes.get(at_s, {}))
        load = values.pop("load", load)
        stream.append(says(at_s, machine, spindle_load_pct=load, **values))
    return stream


def together(*streams: list[HostEvent]) -> list[HostEvent]:
    """As they come when nothing is late."""
    return sorted((one for stream in streams for one in stream), key=lambda one: one.timestamp_ms)


def test_without_a_model_the_score_is_null_and_says_what_to_do() -> None:
    actions = fed(cell(), *born("a"), says(1.5, "a", spindle_load_pct=99.0))
    reasons = {change.name: change.reason for action in actions if isinstance(action, Publish) for change in action.changes}
    assert reasons[RAW] == reasons[ALARM] == NO_MODEL


def test_the_raw_score_is_of_the_values_as_last_reported_at_each_tick() -> None:
    engine = cell("a")
    actions = fed(engine, *born("a"), says(1.2, "a", spindle_load_pct=70.0), says(3.4, "a", spindle_load_pct=60.0))
    assert metric(actions, RAW) == [(1.0, -0.2), (2.0, 0.2)]  # at 3 s as at 2 s


def test_an_unknown_feature_makes_the_score_unknown_and_names_it() -> None:
    actions = fed(cell("a"), *born("a"), says(1.5, "a", spindle_load_pct=None), says(3.0, "a", tool_number=1))
    last = next(
        change for action in reversed(actions) if isinstance(action, Publish) for change in action.changes if change.name == RAW
    )
    assert last.value is None
    assert last.reason == "spindle_load_pct is null"


def test_an_alarm_needs_three_ticks_in_a_row() -> None:
    two = course("a", 12, {2.5: {"load": 90.0}, 4.5: {"load": 30.0}})
    assert True not in [on for _, on in metric(fed(cell("a"), *born("a"), *two), ALARM)]
    three = course("a", 12, {2.5: {"load": 90.0}, 5.5: {"load": 30.0}})
    assert metric(fed(cell("a"), *born("a"), *three), ALARM)[1] == (5.0, True)


def change_of_15_s(machine: str = "a", load_until_s: float = 31.2) -> list[HostEvent]:
    """A tool change from 10.2 s to 25.2 s with a load of 120 %, and the spindle's run-up after it."""
    return course(
        machine,
        60,
        {
            10.2: {"load": 120.0, "tool_change_active": True},
            25.2: {"tool_change_active": False},
            load_until_s: {"load": 30.0},
        },
    )


def test_a_tool_change_is_gated_and_its_tail_runs_from_its_end() -> None:
    """The change says once that it is on, 15 s before its end; the gate holds that, and 8 s from the falling edge."""
    actions = fed(cell("a"), *born("a"), *change_of_15_s())
    assert metric(actions, GATE) == [(1.0, False), (11.0, True), (34.0, False)]
    assert True not in [on for _, on in metric(actions, ALARM)]
    assert max(score for _, score in metric(actions, RAW)) == pytest.approx(0.7)  # suppressing hides no data
    assert max(score for _, score in metric(actions, ADJUSTED)) <= 0.0


def test_without_the_gate_the_same_tool_change_is_an_alarm() -> None:
    actions = fed(
        cell("a", tail_s=0.0), *born("a"), *[named(one._replace(readings=one.readings[:1])) for one in change_of_15_s()]
    )
    assert True in [on for _, on in metric(actions, ALARM)]


def test_a_run_up_that_outlasts_the_tail_is_an_alarm() -> None:
    actions = fed(cell("a"), *born("a"), *change_of_15_s(load_until_s=45.2))
    assert metric(actions, ALARM)[-2:] == [(36.0, True), (48.0, False)]


def test_a_fault_that_begins_in_a_gate_is_caught_on_the_first_clean_ticks_after_it() -> None:
    stream = course("a", 60, {10.2: {"tool_change_active": True}, 12.2: {"load": 90.0}, 14.2: {"tool_change_active": False}})
    actions = fed(cell("a"), *born("a"), *stream)
    assert metric(actions, GATE)[-1] == (23.0, False)
    assert metric(actions, ALARM)[-1] == (25.0, True)


def test_a_label_that_comes_late_gates_what_was_before_it() -> None:
    """A Hurco stops its spindle 9.8 s before it tells: scores wait for the look-back, and are then gated."""
    late = course(
        "a",
        60,
        {10.4: {"load": 120.0}, 20.2: {"tool_change_active": True}, 21.2: {"tool_change_active": False}, 24.2: {"load": 30.0}},
    )
    assert True in [on for _, on in metric(fed(cell("a"), *born("a"), *late), ALARM)]
    actions = fed(cell("a", look_back_s=10.0), *born("a"), *late)
    assert True not in [on for _, on in metric(actions, ALARM)]
    assert metric(actions, GATE) == [(1.0, False), (11.0, True), (30.0, False)]


def test_nobody_who_tells_of_tool_changes_is_not_taken_for_no_change() -> None:
    stream = [birth(0.0, device="a", node=NodeId("cnc", "a"), spindle_load_pct=30.0), *course("a", 10, {2.5: {"load": 90.0}})]
    actions = fed(cell("a"), *stream)
    gate = next(c for e in actions if isinstance(e, Publish) for c in e.changes if c.name == GATE)
    assert (gate.value, gate.reason) == (None, "not gated: tool_change_active is not offered")
    assert metric(actions, GATE_SOURCE) == [(1.0, "none")]
    assert True in [on for _, on in metric(actions, ALARM)]


def test_a_source_that_dies_makes_the_gate_stale() -> None:
    vibration, control = NodeId("cnc", "edge-vibration"), NodeId("cnc", "edge-control")
    engine = cell("a")
    actions = fed(
        engine,
        birth(0.0, device="a", node=control, tool_change_active=False),
        birth(0.0, device="a", node=vibration, spindle_load_pct=30.0),
        data(2.5, device="a", node=vibration, spindle_load_pct=31.0),
        death(3.2, device="a", node=control),
        data(5.5, device="a", node=vibration, spindle_load_pct=32.0),
    )
    assert metric(actions, GATE) == [(1.0, False), (4.0, None)]
    assert metric(actions, GATE_SOURCE)[-1] == (4.0, "stale")


def test_a_change_that_never_ends_gates_for_three_minutes_and_then_says_so() -> None:
    stream = course("a", 300, {10.2: {"tool_change_active": True}})
    actions = fed(cell("a"), *born("a"), *stream)
    assert metric(actions, GATE) == [(1.0, False), (11.0, True), (191.0, None)]


def test_the_detector_is_asked_where_the_control_tells_nothing() -> None:
    detector = NodeId("cnc", "twin-tool_change_detector")
    engine = cell("a")
    stream = [
        birth(0.0, device="a", node=NodeId("cnc", "a"), spindle_load_pct=30.0),
        birth(0.0, device="a", node=detector, **{"twin/tool_change_active": False}),
        data(2.5, device="a", node=detector, **{"twin/tool_change_active": True}),
        says(4.5, "a", spindle_load_pct=31.0),
    ]
    actions = fed(engine, *stream)
    assert metric(actions, GATE)[-1] == (3.0, True)
    assert metric(actions, GATE_SOURCE) == [(1.0, "detector")]


@pytest.mark.parametrize(
    ("own", "peer", "is_common", "adjusted"),
    [
        (90.0, 80.0, True, 0.0),  # 0.4, and the peer has 0.3 ≥ 0.5 · 0.4
        (90.0, 70.0, True, 0.0),  # exactly half
        (90.0, 69.0, False, 0.4),
        (40.0, 99.0, False, -0.1),  # a score that is not above 0 is never common mode
    ],
)
def test_the_published_ratio_rule(own: float, peer: float, is_common: bool, adjusted: float) -> None:
    actions = fed(
        cell("a", "b"),
        *born("a", load=own),
        *born("b", load=peer),
        *together(course("a", 3, {0.5: {"load": own}}), course("b", 3, {0.5: {"load": peer}})),
    )
    assert metric(actions, COMMON)[0] == (1.0, is_common)
    assert metric(actions, ADJUSTED)[0] == (1.0, pytest.approx(adjusted))
    assert metric(actions, PEERS)[0] == (1.0, 1)


def fault_beside_a_peers_change() -> list[HostEvent]:
    return [
        *born("a", "b"),
        *together(
            course("a", 30, {10.2: {"load": 100.0}}),
            course("b", 30, {10.2: {"load": 120.0, "tool_change_active": True}}),
        ),
    ]


def test_taken_literally_a_peers_tool_change_hides_a_fault_and_without_gated_peers_it_does_not() -> None:
    literal = fed(cell("a", "b"), *fault_beside_a_peers_change())
    assert True not in [on for _, on in metric(literal, ALARM)]
    left_out = fed(cell("a", "b", exclude_gated_peers=True), *fault_beside_a_peers_change())
    assert metric(left_out, ALARM)[-1] == (13.0, True)
    assert metric(left_out, PEERS)[-1] == (11.0, 0)


def test_the_residual_keeps_a_fault_that_comes_with_a_common_disturbance() -> None:
    calibrated = SimpleNamespace(raw_center=-0.2, raw_spread=0.1, threshold=1.0, in_words="", hourly_means=())
    engine = cell("a", "b", "c", "d", common_mode="residual", threshold=1.0, calibration=calibrated)
    loads = {"a": 90.0, "b": 60.0, "c": 60.0, "d": 62.0}  # z: 6.0, and 3.0, 3.0, 3.2 of the peers
    actions = fed(engine, *born(*loads), *together(*(course(name, 10, {1.5: {"load": load}}) for name, load in loads.items())))
    assert metric(actions, ADJUSTED)[-1] == (2.0, pytest.approx(3.0))
    assert metric(actions, ALARM)[-1] == (4.0, True)
    assert True not in [on for name in "bcd" for _, on in metric(actions, ALARM, name)]


def test_frames_are_of_one_moment_however_late_a_peer_is() -> None:
    """b's messages come 3 s after those of a, of the same moments; the scores are those of the same moments."""
    a = course("a", 40, {10.2: {"load": 90.0}})
    b = course("b", 40, {10.2: {"load": 90.0}, 20.2: {"load": 30.0}})
    prompt = fed(cell("a", "b"), *born("a", "b"), *together(a, b))
    late_ms = {id(one): 3000 for one in b}
    by_arrival = sorted([*a, *b], key=lambda one: one.timestamp_ms + late_ms.get(id(one), 0))
    late = fed(cell("a", "b"), *born("a", "b"), *by_arrival)
    for name in (ADJUSTED, COMMON, ALARM):
        assert metric(late, name)[:15] == metric(prompt, name)[:15]
    assert (21.0, pytest.approx(0.4)) in metric(prompt, ADJUSTED)


def test_nobody_waits_for_a_machine_whose_clock_is_an_hour_off() -> None:
    off = [
        birth(-3600.0, device="c", spindle_load_pct=99.0),
        *(
            data(one.timestamp_ms / 1000 - T0_MS / 1000 - 3600.0, device="c", spindle_load_pct=99.0)
            for one in course("x", 20, {})
        ),
    ]
    on_time = together(course("a", 20, {5.2: {"load": 90.0}}), course("b", 20, {}))
    mixed = [one for pair in zip(on_time, off * 2, strict=False) for one in pair]
    actions = fed(cell("a", "b", "c"), *born("a", "b"), *mixed)
    assert metric(actions, PEERS)[0] == (1.0, 1)
    assert metric(actions, ADJUSTED)[-1][1] == pytest.approx(0.4)


def test_a_known_clock_offset_is_taken_off_before_machines_are_compared() -> None:
    """b's control is 100 s ahead, and says so: its 100.5 s are the others' 0.5 s."""
    ahead = [says(100.0 + (one.timestamp_ms - T0_MS) / 1000, "b", spindle_load_pct=90.0) for one in course("b", 20, {})]
    b = [birth(100.0, device="b", node=NodeId("cnc", "b"), spindle_load_pct=90.0, clock_offset_s=100.0), *ahead]
    a = course("a", 20, {0.5: {"load": 90.0}})
    actions = fed(cell("a", "b"), *born("a", load=90.0), *(one for pair in zip(a, b, strict=False) for one in pair))
    assert metric(actions, COMMON)[0] == (1.0, True)


@pytest.mark.parametrize(("stamped_by", "common"), [("edge", [True]), ("control", [])])
def test_the_offset_of_a_clock_is_taken_off_the_stamps_of_that_clock_only(stamped_by: str, common: list[bool]) -> None:
    """b's control is 100 s ahead too, but the samples carry the time of the edge, which is that of a's."""
    told = {"clock_offset_s": 100.0, "stamp_clock": stamped_by}
    b = [birth(0.0, device="b", node=NodeId("cnc", "b"), spindle_load_pct=90.0, **told)]
    b += [says((one.timestamp_ms - T0_MS) / 1000, "b", spindle_load_pct=90.0) for one in course("b", 20, {})]
    a = course("a", 20, {0.5: {"load": 90.0}})
    actions = fed(cell("a", "b"), *born("a", load=90.0), *(one for pair in zip(a, b, strict=False) for one in pair))
    assert [value for at_s, value in metric(actions, COMMON) if value] == common


def test_a_restart_in_the_middle_of_a_change_loses_nothing() -> None:
    whole, first, second = (cell("a", look_back_s=5.0) for _ in range(3))
    stream = change_of_15_s(load_until_s=45.2)
    expected = fed(whole, *born("a"), *stream)
    before = fed(first, *born("a"), *stream[:20])
    second.restore(first.snapshot("all"))
    at_s = (stream[19].timestamp_ms - T0_MS) / 1000
    again = event(
        EventKind.BIRTH,
        at_s,
        reading("spindle_load_pct", 120.0, at_s),
        reading("tool_change_active", True, 10.2),
        node=NodeId("cnc", "a"),
        device="a",
    )
    after = fed(second, again, *stream[20:])
    for name in (RAW, ADJUSTED, GATE, ALARM):
        assert metric(before, name) + metric(after, name) == metric(expected, name)


def test_a_clock_that_jumps_starts_the_dwell_anew_and_crashes_nothing() -> None:
    stream = [
        *born("a"),
        *course("a", 5, {2.5: {"load": 90.0}}),
        says(90_000.0, "a", spindle_load_pct=90.0),
        says(90_001.5, "a", spindle_load_pct=90.0),
    ]
    actions = fed(cell("a"), *stream)
    assert [action for action in actions if isinstance(action, DeadLetter)] == []


def test_history_that_comes_late_wakes_nobody() -> None:
    engine = cell("a")
    fed(engine, *born("a"), says(1.5, "a", spindle_load_pct=30.0))
    late = [data(at_s, device="a", node=NodeId("cnc", "a"), history=True, spindle_load_pct=99.0) for at_s in range(-20, -5)]
    assert fed(engine, *late) == []


def test_a_threshold_is_refused_for_settings_that_it_was_not_fitted_with(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted = Config(common_mode=Method.SOURCE).model_dump() | {"tick_s": 0.1}
    model = SimpleNamespace(features=("spindle_load_pct",), calibration=SimpleNamespace(**fitted), preparation=None)
    monkeypatch.setattr("processors.joint_anomaly.scoring._models_in", lambda _: {"a": model})
    with pytest.raises(ConfigurationError, match=r"tick_s = 1.0, but the threshold of a was fitted with 0.1"):
        PROCESSOR.configured({"models": "somewhere", "common_mode": "source"})
    assert PROCESSOR.configured({"models": "somewhere", "common_mode": "source", "threshold": 0.3}).default.threshold == 0.3


def test_the_snapshot_of_a_cell_stays_small() -> None:
    engine = cell("a", "b", look_back_s=30.0)
    fed(engine, *born("a", "b"), *together(course("a", 200, {}), course("b", 200, {})))
    assert len(json.dumps(json.loads(engine.snapshot("all")))) < 12_000


def test_what_holds_for_the_cell_cannot_be_set_for_one_machine_and_then_be_ignored() -> None:
    with pytest.raises(ConfigurationError, match=r"machines.a\] tail_s = 20.0 holds for all machines; .* threshold"):
        Configuration(Config, {"machines": {"a": {"tail_s": 20.0}}}, name="joint_anomaly")


def test_nobody_waits_for_a_machine_that_is_off_while_the_detector_still_speaks_of_it() -> None:
    detector = NodeId("cnc", "twin-tool_change_detector")
    engine = cell("a", "b")
    fed(engine, *born("a", "b"), birth(0.0, device="a", node=detector, **{"twin/tool_change_active": False}))
    fed(engine, *together(course("a", 4, {}), course("b", 4, {})), death(3.6, device="a", node=NodeId("cnc", "a")))
    actions = fed(engine, says(4.2, "b", spindle_load_pct=40.0), says(5.2, "b", spindle_load_pct=30.0))
    assert metric(actions, ADJUSTED, "b")[-1][0] == 5.0
