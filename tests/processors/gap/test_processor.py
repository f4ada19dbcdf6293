"""The processor gap: figures are right, a growing gap is seen, a healthy machine left in peace, what is not known is said."""

import json
import math
from datetime import UTC, datetime
from random import Random
from typing import Any

import pytest
from pydantic import TypeAdapter

from processors.actions import Publish
from processors.errors import ConfigurationError
from processors.gap.growth import BLOCKS_MIN
from processors.gap.processor import BASIS, FINDINGS, GAP, GROWING, GROWING_SIGNAL, LEFT_OUT, PROCESSOR, WINDOW
from processors.gap.state import State
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId
from sparkplug.quality import Quality
from tests.processors.gap.weeks import BEGIN_S, DAY_S, DRIVE, HOUR_S, Weeks
from tests.processors.streams import birth, data, death, engine_of, event, fed, reading

LOAD, TEMPERATURE, AXIS_Z = f"{GAP}spindle_load_pct", f"{GAP}spindle_temp_c", f"{GAP}axis_z_load_pct"
TURNING = {"spindle_rpm": 6000.0, "spindle_load_pct": 4.0, "feed_mm_min": 0.0}
FLOORS = {"spindle_load_pct": 0.5, "spindle_temp_c": 0.3}


def last(engine: Engine) -> dict[str, Change]:
    """Return what a reader knows by now."""
    return engine._machines["okuma"].live.emission.latest


def minutes(count: int, start_s: float = 0.0, **values: Any) -> list[HostEvent]:
    """The same values once more each minute."""
    return [data(start_s + 60.0 * i, **values) for i in range(1, count + 1)]


# The standing figures.


def test_the_figure_is_the_rms_over_the_floor_and_the_mean_has_its_sign_and_unit() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(engine, birth(0.0, **TURNING), *minutes(10, **TURNING))
    assert last(engine)[LOAD].value == pytest.approx(1.0 / 0.5, abs=0.05)  # the twin says 3 %, the machine 4 %
    assert last(engine)[f"{LOAD}/air"].value == last(engine)[LOAD].value
    assert last(engine)[f"{LOAD}/mean"].value == pytest.approx(-1.0, abs=0.01)


def test_a_figure_weighs_by_time_and_not_by_messages() -> None:
    """A minute at 4 % and a minute at 5 %, the first one said once, the other one a hundred times."""
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    often = [data(62.0 + 0.6 * i, spindle_load_pct=5.0) for i in range(100)]
    fed(engine, birth(2.0, **TURNING), *often, data(122.0, spindle_load_pct=5.0))
    assert last(engine)[f"{LOAD}/mean"].value == pytest.approx(-1.5, abs=0.05)


def test_the_gap_of_the_temperature_is_what_the_thermal_processor_says() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS)
    thermal = NodeId("cnc", "twin-thermal")
    twin = {"twin/spindle_temp_residual_k": -0.6, "twin/spindle_temp_rise_k": 9.0}
    fed(engine, birth(0.0, **TURNING), birth(0.0, node=thermal, **twin), *minutes(10, **TURNING))
    assert last(engine)[TEMPERATURE].value == pytest.approx(2.0, abs=0.05)
    assert last(engine)[f"{TEMPERATURE}/steady"].value == pytest.approx(2.0, abs=0.05)
    assert last(engine)[f"{TEMPERATURE}/mean"].value == pytest.approx(0.6, abs=0.01)
    fed(engine, data(601.0, node=thermal, **{"twin/spindle_temp_rise_k": 12.0}), *minutes(3, 600.0, **TURNING))
    assert last(engine)[f"{TEMPERATURE}/warm_up"].value == pytest.approx(2.0, abs=0.05)


def test_what_is_missing_is_said_and_what_was_known_turns_stale() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(engine, birth(0.0, **TURNING), *minutes(5, **TURNING))
    assert last(engine)[TEMPERATURE].reason == "twin/spindle_temp_residual_k is not offered"
    assert last(engine)[AXIS_Z].reason == "axis_z_load_pct is not offered"
    before = last(engine)[LOAD].value
    unknown = reading("spindle_load_pct", None, 301.0, quality=Quality.BAD, reason="UNAVAILABLE")
    fed(engine, event(EventKind.DATA, 301.0, unknown), *minutes(5, 300.0, spindle_rpm=6000.0))
    stale = last(engine)[LOAD]
    assert (stale.value, stale.quality, stale.reason) == (before, Quality.STALE, "spindle_load_pct is bad: UNAVAILABLE")


def test_a_tool_change_and_the_settling_after_it_do_not_count() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    calm = TURNING | {"tool_change_active": False}
    events = [birth(0.0, **calm)]
    for start_s in range(0, 600, 60):
        events += [data(start_s + 20.0, tool_change_active=True, spindle_load_pct=90.0)]
        events += [data(start_s + 30.0, tool_change_active=False), data(start_s + 31.9, spindle_load_pct=4.0)]
    actions = fed(engine, *events, data(601.0, **calm))
    reasons = [c.reason for one in actions if isinstance(one, Publish) for c in one.changes if c.name == AXIS_Z]
    assert reasons == ["axis_z_load_pct is not offered"], "said once, through all tool changes"
    assert last(engine)[f"{LOAD}/mean"].value == pytest.approx(-1.0, abs=0.01)
    assert last(engine)[LEFT_OUT].value == pytest.approx(100.0 * 12.0 / 60.0, abs=2.0)


def test_where_a_tool_change_is_not_known_nothing_is_compared_and_where_nobody_tells_the_basis_says_so() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(engine, birth(0.0, tool_change_active=None, **TURNING), *minutes(5, **TURNING))
    assert last(engine)[LOAD].reason == "tool_change_active is not known: the samples cannot be gated"
    ungated = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(ungated, birth(0.0, tool_change_active=None, tool_change_source="none", **TURNING), *minutes(5, **TURNING))
    assert last(ungated)[LOAD].value is not None
    assert last(ungated)[BASIS].value.endswith("tool changes are not gated: no signal reports them")


def test_where_the_control_tells_nothing_the_detector_is_heeded() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    detector = NodeId("cnc", "twin-tool_change_detector")
    change = "twin/tool_change_active"
    events = [birth(0.0, **TURNING), birth(0.0, node=detector, **{change: False})]
    for start_s in range(0, 600, 60):
        events += [data(start_s + 20.0, node=detector, **{change: True}), data(start_s + 20.1, spindle_load_pct=90.0)]
        events += [data(start_s + 30.0, node=detector, **{change: False}), data(start_s + 31.9, spindle_load_pct=4.0)]
    fed(engine, *events, data(601.0, **TURNING))
    assert last(engine)[f"{LOAD}/mean"].value == pytest.approx(-1.0, abs=0.01)


def test_a_spindle_that_speeds_up_is_not_compared() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(
        engine,
        birth(0.0, **TURNING),
        *(data(0.5 * i, spindle_rpm=500.0 + 30.0 * i, spindle_load_pct=80.0) for i in range(1, 300)),
    )
    assert last(engine)[LOAD].value is None
    assert last(engine)[LOAD].reason == "less than 60 s seen of air or cutting"


def test_a_spike_is_a_spike_and_a_step_is_followed() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    fed(engine, birth(0.0, **TURNING), *minutes(60, **TURNING))
    fed(engine, data(3601.5, spindle_load_pct=900.0), data(3602.5, spindle_load_pct=4.0), *minutes(2, 3600.0, **TURNING))
    assert last(engine)[LOAD].value == pytest.approx(2.0, abs=0.1)
    fed(engine, *minutes(120, 3720.0, **TURNING | {"spindle_load_pct": 34.0}))
    assert last(engine)[f"{LOAD}/mean"].value < -15.0


# Weeks of a machine, folded without an engine.


@pytest.fixture
def machine() -> type[Weeks]:
    """Weeks of a machine; growth changes once an hour, and so much is published here, to be quicker."""
    return Weeks


LOAD_FLOOR = math.hypot(0.5, 0.3)  # of the samples of Weeks: their noise, and that of the hours


def test_a_healthy_year_is_silent(machine: type[Weeks]) -> None:
    weeks = machine(tick_s=1800.0, block_s=7200.0).run(379 * DAY_S)
    assert weeks.alarms == 0
    assert weeks.shown[GROWING] is False
    assert (weeks.shown[GROWING_SIGNAL], weeks.shown[WINDOW], weeks.shown[FINDINGS]) == ("none", "none", "[]")
    assert weeks.shown[AXIS_Z] == pytest.approx(1.0, abs=0.3)
    assert weeks.shown[f"{LOAD}/mean"] == pytest.approx(3.0 - 3.2, abs=0.3)


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_drift_of_one_floor_a_week_is_seen_within_ten_days(machine: type[Weeks], seed: int) -> None:
    """By then it is 1.4 floors; what comes at once is seen the same day, as the next test shows."""
    weeks = machine(seed=seed).run(14 * DAY_S)
    weeks.run(10 * DAY_S, lambda signal, at_s: LOAD_FLOOR * at_s / (7 * DAY_S) if signal == "spindle_load_pct" else 0.0)
    assert 0.5 < weeks.days_to_alarm() < 10.0
    assert weeks.shown[GROWING_SIGNAL].startswith("spindle_load_pct in air: twin minus measured has fallen since 2026-06-")
    start, end = (datetime.fromisoformat(text) for text in weeks.shown[WINDOW].split("/"))
    assert start.timestamp() >= weeks.healthy_until_s
    assert end.timestamp() <= weeks.at_s
    assert (end - start).total_seconds() >= 2 * HOUR_S


# By signal: its floor here, and days to the alarm. The floor of the temperature is mostly what one hour differs by from another.
STEPS = {
    "spindle_load_pct": (LOAD_FLOOR, 1.0),
    "axis_z_load_pct": (math.hypot(0.8, 0.3), 1.0),
    "spindle_temp_c": (math.hypot(0.1, 0.3), 2.0),
}


@pytest.mark.parametrize("signal", STEPS)
def test_a_step_of_three_floors_is_seen_the_same_day_and_the_window_is_where_it_is(machine: type[Weeks], signal: str) -> None:
    floor, days = STEPS[signal]
    weeks = machine().run(16 * DAY_S)
    begin_s = weeks.at_s
    assert weeks.alarms == 0
    weeks.run(2 * DAY_S, lambda name, _: 3.0 * floor if name == signal else 0.0)
    assert weeks.alarms == 1
    assert weeks.growing_since_s is not None
    assert weeks.growing_since_s - begin_s < days * DAY_S
    start, end = (datetime.fromisoformat(text).timestamp() for text in weeks.shown[WINDOW].split("/"))
    assert begin_s - 2 * HOUR_S <= start < end <= weeks.at_s


def test_a_failing_counterbalance_shows_at_standstill_and_drives_that_are_off_do_not(
    machine: type[Weeks],
) -> None:
    weeks = machine().run(14 * DAY_S)
    weeks.run(2 * DAY_S, exec_state="READY", axis_z_load_pct=0.0, spindle_rpm=0.0, spindle_rpm_cmd=0.0)
    assert weeks.alarms == 0
    weeks.run(2 * DAY_S, lambda signal, _: 4.0 if signal == "axis_z_load_pct" else 0.0)
    assert weeks.shown[GROWING_SIGNAL].startswith("axis_z_load_pct in standstill: twin minus measured has fallen")
    assert weeks.shown[f"{AXIS_Z}/mean"] == pytest.approx(-4.0, abs=0.7)
    (found,) = json.loads(weeks.shown[FINDINGS])
    assert weeks.at_s - 2 * DAY_S <= found.pop("since") / 1000.0 < weeks.at_s
    assert found.pop("amount") in (3.0, 4.0, 5.0)
    assert found == {"signal": "axis_z_load_pct", "regime": "standstill", "way": "up", "unit": "%"}


def test_a_scatter_that_doubles_is_a_growing_gap_too(machine: type[Weeks]) -> None:
    weeks = machine(seed=3).run(14 * DAY_S)
    noise = Random(4)
    weeks.run(3 * DAY_S, lambda signal, _: noise.gauss(0.0, 1.5) if signal == "spindle_load_pct" else 0.0)
    assert weeks.shown[GROWING] is True
    assert "spindle_load_pct in air: scatter has grown since" in weeks.shown[GROWING_SIGNAL]
    found = next(one for one in json.loads(weeks.shown[FINDINGS]) if one["signal"] == "spindle_load_pct")
    assert (found["way"], found["regime"], "amount" in found) == ("scatter", "air", False)


def test_a_gap_that_has_gone_is_said_to_be_gone(machine: type[Weeks]) -> None:
    weeks = machine().run(14 * DAY_S).run(3 * DAY_S, lambda signal, _: 3.0 if signal == "spindle_load_pct" else 0.0)
    assert weeks.shown[GROWING] is True
    weeks.run(6 * DAY_S)
    assert (weeks.shown[GROWING], weeks.shown[WINDOW], weeks.alarms) == (False, "none", 1)


def test_drifting_data_never_moves_the_baseline_it_is_judged_by(machine: type[Weeks]) -> None:
    weeks = machine().run(14 * DAY_S)
    known = {key: (cell.healthy, cell.level, cell.spread) for key, cell in weeks.state.cells.items()}
    weeks.run(30 * DAY_S, lambda _, at_s: at_s / DAY_S)
    after = {key: (cell.healthy, cell.level, cell.spread) for key, cell in weeks.state.cells.items()}
    assert all(after[key][0] == known[key][0] for key in known)
    assert max(after[key][1].blocks - known[key][1].blocks for key in known) <= 1, "the block that ends with the healthy period"
    assert weeks.shown[GROWING] is True


def test_the_cut_is_judged_by_program_and_a_new_program_is_no_growth(machine: type[Weeks]) -> None:
    cut = {"feed_mm_min": 800.0, "program": "O1701", "spindle_load_pct": 40.0}
    weeks = machine().run(14 * DAY_S, **cut).run(3 * DAY_S, **cut | {"program": "O2000", "spindle_load_pct": 70.0})
    assert [key for key in weeks.state.cells if key.startswith("spindle_load_pct")] == ["spindle_load_pct/cutting O1701"]
    assert weeks.alarms == 0
    weeks.run(DAY_S, **cut | {"spindle_load_pct": 46.0})
    assert weeks.shown[GROWING_SIGNAL].startswith("spindle_load_pct in cutting O1701: twin minus measured has fallen")


def test_nothing_is_judged_before_it_was_learned_and_too_little_is_said_to_be_too_little(machine: type[Weeks]) -> None:
    weeks = machine().run(3 * DAY_S)
    assert weeks.shown[GROWING] is None
    engine = engine_of(PROCESSOR, healthy_hours=1.0)
    fed(engine, birth(0.0, **TURNING), *minutes(30, **TURNING))
    assert last(engine)[GROWING].reason == "what a healthy machine does is being learned until 2022-02-10T14:51:01Z"
    assert last(engine)[LOAD].reason == last(engine)[GROWING].reason
    fed(engine, *minutes(60, 1800.0, **TURNING))
    assert last(engine)[GROWING].reason == (
        f"fewer than {BLOCKS_MIN} blocks, or too much alike, were seen while the machine was healthy, until 2022-02-10T14:51:01Z"
    )


def test_a_healthy_period_that_is_stated_anew_is_learned_anew(machine: type[Weeks]) -> None:
    weeks = machine(healthy_from=datetime.fromtimestamp(BEGIN_S, UTC)).run(14 * DAY_S)
    assert weeks.shown[GROWING] is False
    assert "(stated)" in weeks.shown[BASIS]
    weeks.config = weeks.config.model_copy(update={"healthy_from": datetime.fromtimestamp(weeks.at_s, UTC)})
    weeks.run(DAY_S)
    assert weeks.shown[GROWING] is None
    assert max(cell.level.blocks for cell in weeks.state.cells.values()) <= 24


# What keeps it running.


def test_a_restart_in_the_middle_of_a_growth_changes_nothing_and_its_state_stays_small(machine: type[Weeks]) -> None:
    def drift(signal: str, at_s: float) -> float:
        return 3.0 * at_s / (7 * DAY_S) if signal == "spindle_load_pct" else 0.0

    whole, restarted = (machine(seed=5).run(14 * DAY_S).run(2 * DAY_S, drift) for _ in range(2))
    adapter: TypeAdapter[State] = TypeAdapter(State)
    text = json.dumps(encode_state(adapter, restarted.state))
    assert len(text) < 1000 * len(restarted.state.cells)
    restarted.state = decode_state(adapter, json.loads(text))
    assert whole.run(2 * DAY_S, drift).shown == restarted.run(2 * DAY_S, drift).shown
    assert whole.shown[GROWING] is True


def test_programs_without_end_do_not_make_a_state_without_end(machine: type[Weeks]) -> None:
    weeks = machine(tick_s=900.0)
    for number in range(50):
        weeks.run(HOUR_S, feed_mm_min=800.0, program=f"O{number}")
    assert sum(key.startswith("spindle_load_pct") for key in weeks.state.cells) == 8


def test_a_clock_that_is_set_back_and_a_night_in_between_leave_what_was_learned() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, tick_s=10.0, **DRIVE)
    fed(engine, birth(0.0, **TURNING), *minutes(300, **TURNING), death(18_010.0))
    fed(engine, birth(60_000.0, **TURNING), *minutes(90, 60_000.0, **TURNING))
    cell = engine._machines["okuma"].live.state.cells["spindle_load_pct/air"]
    assert cell.standing.seconds == pytest.approx(390 * 60, rel=0.03)
    fed(engine, *(data(50_000.0 + i, **TURNING) for i in range(300)))
    assert engine.counts.dead_letters == 0
    assert engine._machines["okuma"].live.state.cells["spindle_load_pct/air"].standing.seconds > cell.standing.seconds


def test_history_that_an_edge_sends_late_is_left_to_the_historian() -> None:
    engine = engine_of(PROCESSOR, floors=FLOORS, **DRIVE)
    actions = fed(engine, birth(0.0, **TURNING), *(data(60.0 * i, history=True, **TURNING) for i in range(30)))
    assert len(actions) == 1
    assert engine._machines["okuma"].history is not None
    assert engine._machines["okuma"].history.state == State()


@pytest.mark.parametrize(
    ("named", "table"),
    {"spindle_lod_pct": {"floors": {"spindle_lod_pct": 1.0}}, "tick_s 600": {"tick_s": 600.0, "block_s": 900.0}}.items(),
)
def test_a_configuration_that_makes_no_sense_is_refused(named: str, table: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match=named):
        engine_of(PROCESSOR, **table)
