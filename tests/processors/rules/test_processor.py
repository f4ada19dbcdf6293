"""The rules: what alarms and what does not, when, and that nobody is told "no" where nobody knows."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.actions import Action, DeadLetter, Publish
from processors.contract import OutputSpec
from processors.errors import ConfigurationError
from processors.rules.alarm import IDLE, Judgement, LimitState, Timing, latched
from processors.rules.processor import DETAIL, PROCESSOR, RULES, SEVERITY, ZONE
from processors.rules.vibration import BOUNDARIES_MM_S
from processors.running.engine import Engine
from processors.sample import Sample, SampleKind
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change
from sparkplug.quality import Quality
from tests.processors.streams import birth, data, death, engine_of, event, fed, reading

LOAD, RUNAWAY, NO_FEED, VIBRATION, *_ = (rule.metric for rule in RULES)
CUTTING = {
    "spindle_rpm": 4000.0,
    "spindle_load_pct": 40.0,
    "feed_mm_min": 800.0,
    "exec_state": "ACTIVE",
    "spindle_temp_c": 30.0,
    "vibration_velocity_mm_s": 1.0,
    "twin/spindle_cut_load_pct": 36.0,
    "twin/expected_cut_least_pct": 34.0,
    "twin/expected_cut_most_pct": 35.0,
    "twin/expected_ratio": 1.02,
}


def last(engine: Engine) -> dict[str, Change]:
    """Return what a reader knows by now."""
    return engine._machines["okuma"].live.emission.latest


def turns(actions: list[Action], name: str) -> list[tuple[float, Any]]:
    """Each value that was published of one output, with the second."""
    return [
        ((c.timestamp_ms - 1_644_501_060_000) / 1000, c.value)
        for action in actions
        if isinstance(action, Publish)
        for c in action.changes
        if c.name == name
    ]


def alarms(actions: list[Action]) -> dict[str, int]:
    """Return how often each rule has alarmed."""
    return {rule.name: sum(value is True for _, value in turns(actions, rule.metric)) for rule in RULES}


def warm_engine(**table: Any) -> Engine:
    """An engine whose machine has been cutting for 200 s: every rule can judge."""
    engine = engine_of(PROCESSOR, **table)
    fed(engine, birth(0.0, **CUTTING), *(data(10.0 * i, spindle_temp_c=30.0) for i in range(1, 21)))
    assert {last(engine)[rule.metric].value for rule in RULES} == {False}
    return engine


def test_alarms_are_booleans_that_history_does_not_raise() -> None:
    specs: dict[str, OutputSpec] = {spec.name: spec for spec in PROCESSOR.outputs}
    assert all(specs[rule.metric].is_alarm and specs[rule.metric].datatype.name == "BOOLEAN" for rule in RULES)


# Load over limit.


def test_an_overload_alarms_after_its_dwell_and_ends_below_the_lower_limit() -> None:
    engine = warm_engine()
    actions = fed(engine, data(201.0, spindle_load_pct=131.4), data(205.9, feed_mm_min=790.0), data(206.1, feed_mm_min=780.0))
    assert turns(actions, LOAD) == [(206.0, True)]
    assert last(engine)[DETAIL].value == ("load_over_limit: spindle_load_pct 131 % over 110 %, since 2022-02-10T13:54:21Z")
    assert last(engine)[SEVERITY].value == "high"
    actions = fed(engine, data(210.0, spindle_load_pct=105.0), data(240.0, spindle_load_pct=99.0), data(246.5, feed_mm_min=1.0))
    assert turns(actions, LOAD) == [(245.0, False)]
    assert last(engine)[DETAIL].value == "none"


def test_a_peak_shorter_than_the_dwell_is_none() -> None:
    engine = warm_engine()
    peaks = [data(200.0 + i, spindle_load_pct=150.0 if i % 5 else 109.0) for i in range(1, 60)]
    assert alarms(fed(engine, *peaks))["load_over_limit"] == 0


def test_110_percent_is_not_over_110_percent() -> None:
    engine = warm_engine()
    assert alarms(fed(engine, data(201.0, spindle_load_pct=110.0), data(300.0, spindle_load_pct=110.0)))["load_over_limit"] == 0


def test_a_spindle_that_runs_up_is_not_overloaded() -> None:
    """12,000 rev/min in 12 s at 160 %, reported three times a second; then it cuts at 40 %."""
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **CUTTING | {"spindle_rpm": 0.0, "spindle_load_pct": 0.0}))
    ramp = [data(10.0 + i / 3, spindle_rpm=1000.0 * i / 3, spindle_load_pct=160.0) for i in range(1, 37)]
    actions = fed(engine, *ramp, data(22.3, spindle_load_pct=40.0), data(60.0, spindle_load_pct=40.0))
    assert alarms(actions)["load_over_limit"] == 0


def test_a_run_up_that_does_not_end_is_an_overload() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **CUTTING | {"spindle_rpm": 0.0, "spindle_load_pct": 0.0}))
    hunting = [data(10.0 + i / 2, spindle_rpm=2000.0 + 300.0 * (i % 2), spindle_load_pct=160.0) for i in range(1, 80)]
    raised = [at_s for at_s, value in turns(fed(engine, *hunting), LOAD) if value]
    assert raised == [pytest.approx(10.5 + 20.0 + 5.0, abs=1.0)]  # ramp_s_max, then the dwell


def test_a_speed_that_changed_after_long_silence_is_a_ramp() -> None:
    """Reported by exception: 4000 rev/min have stood for minutes, and the next report is 1500."""
    engine = warm_engine(load_dwell_s=0.0)
    actions = fed(engine, data(300.0, spindle_rpm=1500.0, spindle_load_pct=170.0), data(301.0, spindle_load_pct=30.0))
    assert alarms(actions)["load_over_limit"] == 0


def test_the_drift_of_constant_surface_speed_is_no_ramp() -> None:
    engine = warm_engine()
    drift = [data(200.0 + i / 3, spindle_rpm=4000.0 + 15.0 * i, spindle_load_pct=140.0) for i in range(1, 40)]
    assert alarms(fed(engine, *drift))["load_over_limit"] == 1


def test_braking_with_a_negative_load_is_judged_by_its_size() -> None:
    engine = warm_engine()
    assert alarms(fed(engine, data(201.0, spindle_load_pct=-140.0), data(220.0, feed_mm_min=1.0)))["load_over_limit"] == 1


# Thermal runaway.


def heat(slope_k_per_min: float, seconds: float, start_s: float, start_c: float = 30.0, digits: int = 0) -> list[HostEvent]:
    """A temperature that rises, once a second, rounded as the sensor rounds."""
    return [
        data(start_s + i, spindle_temp_c=round(start_c + slope_k_per_min * i / 60.0, digits))
        for i in range(1, round(seconds) + 1)
    ]


@pytest.mark.parametrize("digits", [0, 1, 3])
@pytest.mark.parametrize(("slope", "count"), [(-8.0, 0), (3.0, 0), (4.5, 0), (5.6, 1), (12.0, 1)])
def test_the_limit_of_5_k_a_minute_holds_for_whole_degrees_too(slope: float, count: int, digits: int) -> None:
    engine = warm_engine()
    assert alarms(fed(engine, *heat(slope, 400.0, 200.0, digits=digits)))["thermal_runaway"] == count


def test_a_runaway_is_seen_within_two_minutes_and_ends_when_the_rise_does() -> None:
    engine = warm_engine()
    actions = fed(engine, *heat(12.0, 240.0, 200.0), *heat(0.0, 400.0, 440.0, start_c=78.0))
    (_, raised), (_, ended) = [(value, at_s - 200.0) for at_s, value in turns(actions, RUNAWAY)]
    assert 60.0 < raised < 120.0
    assert 240.0 + 30.0 < ended < 240.0 + 180.0
    assert [value for _, value in turns(actions, RUNAWAY)] == [True, False]


def test_zeros_of_the_sensor_are_no_cooling_and_their_end_is_no_heating() -> None:
    """As Mazak's do: 43, 0 for a second, 43, each few seconds; here on a slope of 2 K/min."""
    engine = warm_engine()
    stream = [data(200.0 + i, spindle_temp_c=0.0 if i % 4 == 0 else round(30.0 + i / 30.0)) for i in range(1, 400)]
    actions = fed(engine, *stream)
    assert turns(actions, RUNAWAY) == []  # False before, and ever since
    assert engine._machines["okuma"].live.state.trend.slope_k_per_min == pytest.approx(2.0, abs=0.35)


def test_a_new_level_of_the_sensor_is_no_runaway() -> None:
    engine = warm_engine()
    actions = fed(engine, data(210.0, spindle_temp_c=55.0), data(230.0, spindle_temp_c=55.0), data(600.0, spindle_temp_c=55.0))
    assert [value for _, value in turns(actions, RUNAWAY)] == [None, False]


def test_until_most_of_a_window_is_known_nothing_is_said() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **CUTTING), *heat(20.0, 100.0, 0.0))
    assert last(engine)[RUNAWAY].reason == "spindle_temp_c is known for less than 135 s"


# Load without feed.


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ({}, 1),
        ({"feed_mm_min": 0.9}, 1),
        ({"feed_mm_min": 1.0}, 0),
        ({"spindle_load_pct": 60.0}, 0),
        ({"spindle_rpm": 20.0}, 0),
        ({"exec_state": "FEED_HOLD"}, 0),
        ({"exec_state": "INTERRUPTED"}, 0),
    ],
)
def test_load_without_feed_needs_load_speed_and_a_running_program(values: dict[str, Any], count: int) -> None:
    engine = warm_engine()
    stuck = CUTTING | {"spindle_load_pct": 70.0, "feed_mm_min": 0.0} | values
    actions = fed(engine, data(201.0, **stuck), data(220.0, spindle_temp_c=30.0))
    assert alarms(actions)["load_without_feed"] == count


def test_a_control_that_tells_no_state_can_be_judged_without() -> None:
    nameless = {name: value for name, value in CUTTING.items() if name != "exec_state"}
    stuck = data(10.0, spindle_load_pct=70.0, feed_mm_min=0.0)
    for table, expected in (({}, None), ({"exec_states": []}, True)):
        engine = engine_of(PROCESSOR, **table)
        fed(engine, birth(0.0, **nameless), stuck, data(30.0, spindle_temp_c=30.0))
        assert last(engine)[NO_FEED].value is expected
        assert expected or last(engine)[NO_FEED].reason == "exec_state is not offered"


# Vibration.


@pytest.mark.parametrize("name", ["vibration_velocity_mm_s", "twin/vibration_velocity_mm_s"])
def test_zone_d_alarms_whoever_measures_it(name: str) -> None:
    values = {key: value for key, value in CUTTING.items() if key != "vibration_velocity_mm_s"}
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **values, **{name: 7.0}), data(20.0, spindle_load_pct=40.0))
    assert (last(engine)[ZONE].value, last(engine)[VIBRATION].value) == ("C", False)
    actions = fed(engine, data(21.0, **{name: 7.3}), data(40.0, spindle_load_pct=40.0))
    assert turns(actions, VIBRATION) == [(31.0, True)]
    assert last(engine)[ZONE].value == "D"
    assert "vibration 7.3 mm/s rms in zone D, over 7.1 mm/s" in last(engine)[DETAIL].value


def test_the_edges_own_figure_comes_first_and_the_processors_stands_in_for_it() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **CUTTING, **{"twin/vibration_velocity_mm_s": 20.0}))
    assert last(engine)[ZONE].value == "A"
    fed(engine, event(EventKind.DATA, 5.0, reading("vibration_velocity_mm_s", None, 5.0, quality=Quality.BAD, reason="sensor")))
    assert last(engine)[ZONE].value == "D"


def test_a_zone_is_left_downwards_with_hysteresis() -> None:
    engine = warm_engine()
    zones = []
    for i, velocity in enumerate([1.0, 1.2, 1.05, 1.0, 2.9, 2.6, 2.5, 8.0, 6.5, 6.3, 0.5]):
        fed(engine, data(201.0 + i, vibration_velocity_mm_s=velocity))
        zones.append(last(engine)[ZONE].value)
    assert zones == ["A", "B", "B", "A", "C", "C", "B", "D", "D", "C", "A"]


def test_vibration_is_judged_only_while_the_spindle_turns_and_an_alarm_does_not_end_by_stopping() -> None:
    engine = warm_engine()
    fed(engine, data(201.0, vibration_velocity_mm_s=9.0), data(220.0, spindle_load_pct=39.0))
    assert last(engine)[VIBRATION].value is True
    fed(engine, data(221.0, spindle_rpm=0.0, vibration_velocity_mm_s=0.1), data(300.0, spindle_load_pct=0.0))
    assert last(engine)[VIBRATION].value is True
    assert (last(engine)[ZONE].value, last(engine)[ZONE].reason) == (None, "the spindle stands still")
    fed(engine, data(301.0, spindle_rpm=4000.0, vibration_velocity_mm_s=1.0), data(320.0, spindle_load_pct=1.0))
    assert (last(engine)[VIBRATION].value, last(engine)[ZONE].value) == (False, "A")
    still = engine_of(PROCESSOR)
    fed(still, birth(0.0, **CUTTING | {"spindle_rpm": 0.0, "vibration_velocity_mm_s": 20.0}), data(60.0, spindle_load_pct=0.0))
    assert last(still)[VIBRATION].value is False


def test_boundaries_may_be_your_own_and_each_table_rises() -> None:
    engine = warm_engine(vibration_boundaries_mm_s=[0.4, 0.8, 0.9], vibration_alarm_zone="D", vibration_dwell_s=300.0)
    assert last(engine)[ZONE].value == "D"
    assert all(first < second < third for first, second, third in BOUNDARIES_MM_S.values())


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"vibration_boundaries_mm_s": [2.0, 1.0, 3.0]}, "give A/B, B/C, C/D"),
        ({"vibration_alarm_zone": "A"}, "use B, C or D"),
        ({"load_clear_pct": 120.0}, "above load_limit_pct"),
        ({"no_feed_clear_pct": 61.0}, "above no_feed_load_pct"),
        ({"runaway_clear_k_per_min": 6.0}, "above runaway_k_per_min"),
        ({"tick_s": 10.0}, "more than runaway_window_s / 24"),
    ],
)
def test_limits_that_contradict_each_other_are_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        engine_of(PROCESSOR, **table)


# Severity, and what is not known.


@pytest.mark.parametrize(
    ("rule", "score", "severity"),
    [(False, False, "none"), (False, True, "medium"), (True, False, "high"), (True, True, "high"), (False, None, "none")],
)
def test_a_rule_is_high_and_the_score_alone_medium(rule: bool, score: bool | None, severity: str) -> None:
    engine = warm_engine()
    if score is not None:
        fed(engine, data(201.0, **{"twin/anomaly_alarm": score}))
    fed(engine, data(202.0, spindle_load_pct=150.0 if rule else 40.0), data(220.0, feed_mm_min=800.0))
    assert last(engine)[SEVERITY].value == severity


NEEDS = [(rule.metric, name) for rule in RULES for name in sorted(rule.reads) if not name.startswith("twin/")]


@pytest.mark.parametrize(("metric", "name"), NEEDS)
@pytest.mark.parametrize("quality", [Quality.BAD, Quality.STALE])
def test_an_input_that_is_not_known_is_never_a_silent_no(metric: str, name: str, quality: Quality) -> None:
    engine = warm_engine()
    fed(engine, event(EventKind.DATA, 201.0, reading(name, CUTTING[name], 201.0, quality=quality, reason="because")))
    assert last(engine)[metric].value is None
    assert last(engine)[metric].reason == f"{name} is {'bad' if quality is Quality.BAD else 'stale'}: because"
    assert metric.removeprefix("twin/rule_") in last(engine)[DETAIL].value.partition("not judged: ")[2]
    assert last(engine)[SEVERITY].value == "none"  # the other rules can be judged


def test_where_nothing_can_be_judged_severity_is_null() -> None:
    engine = warm_engine()
    fed(engine, death(201.0))
    known = last(engine)
    assert {known[name].value for name in known} == {None}
    assert all(known[name].reason for name in known)
    empty = engine_of(PROCESSOR)
    fed(empty, birth(0.0, tool_number=1, **{"twin/anomaly_alarm": True}))
    assert last(empty)[SEVERITY].value == "medium"


def test_an_alarm_comes_back_with_its_inputs_and_needs_no_new_dwell() -> None:
    engine = warm_engine()
    fed(engine, data(201.0, spindle_load_pct=150.0), data(220.0, feed_mm_min=700.0))
    gone = reading("spindle_load_pct", None, 221.0, quality=Quality.BAD, reason="UNAVAILABLE")
    actions = fed(engine, event(EventKind.DATA, 221.0, gone), data(290.0, spindle_load_pct=150.0))
    assert [value for _, value in turns(actions, LOAD)] == [None, True]


def test_a_long_silence_ends_every_alarm_as_unknown() -> None:
    engine = warm_engine(gap_s_max=60.0)
    fed(engine, data(201.0, spindle_load_pct=150.0), data(220.0, feed_mm_min=700.0))
    actions = fed(engine, data(1000.0, spindle_load_pct=150.0))
    assert [value for _, value in turns(actions, LOAD)] == [None, False]
    assert not any(isinstance(action, DeadLetter) for action in actions)


def test_what_lasts_is_published_once() -> None:
    engine = warm_engine()
    stream = [
        data(201.0 + i / 10, spindle_load_pct=130.0 + i % 13, vibration_velocity_mm_s=8.0 + i % 5 / 10) for i in range(3000)
    ]
    actions = fed(engine, *stream)
    changes = [change for action in actions if isinstance(action, Publish) for change in action.changes]
    assert len(changes) <= 8


stands = st.lists(st.tuples(st.sampled_from(list(LimitState)), st.floats(0.0, 4.0)), max_size=30)


@given(steps=stands, dwell_s=st.floats(0.0, 6.0), clear_s=st.floats(0.0, 6.0))
@settings(max_examples=300, deadline=None)
def test_an_alarm_needs_its_dwell_without_a_break_and_its_end_too(
    steps: list[tuple[LimitState, float]], dwell_s: float, clear_s: float
) -> None:
    """The latch against the sentence that it implements."""
    latch, at_s, history = IDLE, 0.0, []
    for stand, step_s in steps:
        at_s += step_s
        was = latch.is_alarm
        latch = latched(latch, Judgement(stand, finding="x"), Timing(dwell_s, clear_s), at_s)
        history.append((stand, at_s))
        wanted = LimitState.OVER if not was else LimitState.UNDER
        run = []
        for past in reversed(history):
            if past[0] is not wanted:
                break
            run.append(past[1])
        lasted = bool(run) and at_s - run[-1] >= (clear_s if was else dwell_s)
        assert latch.is_alarm is (was if not lasted else not was)


def test_while_nothing_changes_the_outputs_are_the_same_objects() -> None:
    engine = engine_of(PROCESSOR)
    fed(
        engine, birth(0.0, spindle_rpm=3000.0, spindle_load_pct=20.0, feed_mm_min=500.0, exec_state="ACTIVE", spindle_temp_c=30.0)
    )
    lane = engine.lane_of("okuma")
    assert lane is not None
    config = PROCESSOR.configured().default
    calm = [Sample("okuma", SampleKind.TICK, 1e9 + second, lane.row) for second in range(2)]
    state, first = PROCESSOR.step(config, lane.state, calm[0])
    _, second = PROCESSOR.step(config, state, calm[1])
    assert second is first
