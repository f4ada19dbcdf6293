"""Production figures of made-up shifts, whose seconds anybody can add up."""

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.actions import Action, Publish
from processors.events.processor import PROCESSOR as EVENTS
from processors.production.processor import PROCESSOR
from processors.production.state import State
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from sparkplug.host_session import EventKind, HostEvent
from tests.depth import examples
from tests.processors.streams import T0_MS, birth, data, death, engine_of, fed
from twin.vocabulary.twin_signals import PART_RECORD, PRODUCTION, PRODUCTION_NOW

# The streams begin at 13:51:00 UTC; the early shift of this calendar has an hour then, the late one half an hour.
CALENDAR = """
time_zone = "UTC"
[shifts.early]
days = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
start = "13:51"
end = "14:51"
breaks = [["14:11", "14:21"]]
[shifts.late]
days = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
start = "14:51"
end = "15:21"
"""
IDLE = {"exec_state": "READY", "controller_mode": "AUTOMATIC", "program": "O1", "spindle_power_kw": 1.0}


@pytest.fixture(scope="session")
def calendar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("calendar") / "calendar.toml"
    path.write_text(CALENDAR, encoding="utf-8")
    return path


def _records(actions: list[Action], kind: str, signal: str = PRODUCTION) -> list[dict[str, Any]]:
    """The records of one kind; of a part that was told twice, the last."""
    values = [
        change.value for action in actions if isinstance(action, Publish) for change in action.changes if change.name == signal
    ]
    records = [json.loads(value) for value in values if isinstance(value, str)]
    return list({one["id"]: one for one in records if one["kind"] == kind}.values())


def _last(actions: list[Action]) -> Mapping[str, Any]:
    return {
        change.name.removeprefix("twin/"): change.value
        for action in actions
        if isinstance(action, Publish)
        for change in action.changes
    }


def _alive(until_s: float, *events: HostEvent) -> Iterator[HostEvent]:
    """The events, with a message each minute in between that says that the machine is there."""
    coming = sorted(events, key=lambda one: one.timestamp_ms)
    for minute in range(1, int(until_s // 60) + 1):
        at_ms = T0_MS + minute * 60_000
        while coming and coming[0].timestamp_ms <= at_ms:
            yield coming.pop(0)
        yield data(minute * 60.0, ambient_temp_c=20.0 + minute % 2)
    yield from coming


def _shift_of_parts(quality: str | None = "good", mode: str = "AUTOMATIC") -> list[HostEvent]:
    """Parts of 100 s with 20 s in between, from the beginning of the early shift on; an alarm, a feed hold, MANUAL, a death."""
    told = [birth(0.0, **{**IDLE, "controller_mode": mode})]
    for n in range(5):
        told += [data(120.0 * n + 10, exec_state="ACTIVE"), data(120.0 * n + 110, exec_state="READY")]
        if quality is not None:
            told.append(data(120.0 * n + 112, part_quality=f"{quality} {n}"))
    told += [data(610, exec_state="STOPPED", alarm="FAULT: chip conveyor"), data(670, exec_state="READY", alarm="")]
    told += [data(700, exec_state="FEED_HOLD"), data(730, exec_state="READY")]
    told += [data(800, controller_mode="MANUAL"), data(900, controller_mode=mode)]
    told += [death(1000), birth(1100, **IDLE)]
    return told


def test_a_shift_adds_up_by_hand(calendar: Path) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar), ideal_s={"O0001.nc": 90.0})
    actions = fed(engine, *_alive(3700.0, *_shift_of_parts()))
    (shift,) = _records(actions, "shift")
    assert (shift["shift"], shift["over"], (shift["end"] - shift["begin"]) / 1000) == ("early", True, 3600.0)
    assert shift["time_zone"] == "UTC"
    assert shift["planned_s"] == 3000.0  # without the break of ten minutes
    assert shift["production_s"] == 500.0
    assert shift["down_s"] == 60.0
    assert shift["setup_s"] == 100.0
    assert shift["unknown_s"] == pytest.approx(100.0, abs=5.0)  # a death is stamped by the last tick before it
    parts_of_it = ("production_s", "setup_s", "delay_s", "down_s", "unknown_s")
    assert sum(shift[name] for name in parts_of_it) == pytest.approx(3000.0)
    stops = {reason: (stop["kind"], stop["s"], stop["n"]) for reason, stop in shift["stops"].items()}
    assert stops["alarm: FAULT: chip conveyor"] == ("down", 60.0, 1)
    assert stops["feed hold"] == ("delay", 30.0, 1)
    assert stops["mode MANUAL"] == ("setup", 100.0, 1)
    assert sum(seconds for _, seconds, _ in stops.values()) == pytest.approx(2500.0)
    seen_s = 3000.0 - shift["unknown_s"]
    assert shift["ratios"] == {
        "availability": round(500.0 / seen_s, 4),
        "performance": 0.9,
        "quality": 1.0,
        "oee": pytest.approx(0.9 * 500.0 / seen_s, abs=1e-4),
    }


def test_a_part_has_its_times_its_energy_and_its_quality(calendar: Path) -> None:
    told = [birth(0.0, **IDLE)]
    told += [data(10.0, exec_state="ACTIVE", spindle_power_kw=7.2), data(110.0, exec_state="READY", spindle_power_kw=7.2)]
    told += [data(111.0, part_quality="SCRAP 17"), data(120.0, ambient_temp_c=21.0)]
    actions = fed(engine_of(PROCESSOR, calendar=str(calendar)), *told)
    (part,) = _records(actions, "part")
    assert (part["program"], part["shift"], part["quality"], part["complete"]) == ("O1", "early", "scrap", True)
    assert (part["active_s"], part["interrupted_s"], part["unknown_s"], part["ideal_s"]) == (100.0, 0.0, 0.0, None)
    assert part["energy_kwh"] == pytest.approx(7.2 * 100.0 / 3600.0, rel=1e-4)


def test_a_part_is_that_of_the_processor_events(calendar: Path) -> None:
    stream = list(_alive(1300.0, *_shift_of_parts()))
    own = _records(fed(engine_of(PROCESSOR, calendar=str(calendar)), *stream), "part")
    values = [
        change.value
        for action in fed(engine_of(EVENTS), *stream)
        if isinstance(action, Publish)
        for change in action.changes
        if change.name == PART_RECORD and change.value is not None
    ]
    records = [json.loads(str(value)) for value in values]
    assert len(own) == 5
    assert [part["id"] for part in own] == [record["id"] for record in records]
    assert [part["active_s"] for part in own] == [record["cycle"]["active_s"] for record in records]


@pytest.mark.parametrize(
    ("table", "quality", "null", "why"),
    [
        ({}, "good", "availability", "no shift calendar"),
        ({"calendar": True}, "good", "performance", "cnctwin expect"),
        ({"calendar": True, "ideal_s": {"O1": 90.0}}, None, "quality", "part_quality"),
    ],
    ids=["no calendar", "no ideal time", "no quality"],
)
def test_what_is_not_known_is_null_with_its_reason(
    calendar: Path, table: dict[str, Any], quality: str | None, null: str, why: str
) -> None:
    table = table | ({"calendar": str(calendar)} if "calendar" in table else {})
    actions = fed(engine_of(PROCESSOR, **table), *_alive(640.0, *_shift_of_parts(quality)))
    (now,) = _records(actions, "shift", PRODUCTION_NOW)
    nulls = {name for name, value in now["ratios"].items() if value is None}
    assert {null, "oee"} <= nulls
    assert why in now["why"][null]
    assert now["why"]["oee"].startswith(next(name for name in ("availability", "performance", "quality") if name in nulls))
    assert ("availability" in nulls) is ("calendar" not in table)


@pytest.mark.parametrize(
    ("told", "element", "reason"),
    [
        ({"exec_state": "ACTIVE"}, "production_s", None),
        ({"exec_state": "ACTIVE", "controller_mode": "MANUAL_DATA_INPUT"}, "setup_s", "mode MANUAL_DATA_INPUT"),
        ({"controller_mode": "EDIT"}, "setup_s", "mode EDIT"),
        ({"exec_state": "ACTIVE", "feed_override_pct": 0.0}, "delay_s", "feed override 0 %"),
        ({"exec_state": "PROGRAM_STOPPED"}, "delay_s", "program stop (M0)"),
        ({"exec_state": "INTERRUPTED", "tool_change_active": True}, "delay_s", "tool change"),
        ({"exec_state": "STOPPED", "tool_change_active": True, "alarm": "EX1012 NO OIL"}, "down_s", "alarm: EX1012 NO OIL"),
        ({"exec_state": "READY", "program": ""}, "delay_s", "no program"),
        ({"exec_state": "READY"}, "delay_s", "not told"),
        ({"exec_state": "STOPPED", "alarm": "FAULT: door", "controller_mode": "MANUAL"}, "down_s", "alarm: FAULT: door"),
        ({"exec_state": None}, "unknown_s", "no data"),
        ({"exec_state": "DANCING"}, "unknown_s", "no data"),
    ],
)
def test_what_the_control_tells_counts_to_one_time_element(
    calendar: Path, told: dict[str, Any], element: str, reason: str | None
) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar), told_s=1.0)
    (now,) = _records(fed(engine, birth(0.0, **IDLE | told), data(200.0, ambient_temp_c=20.0)), "shift", PRODUCTION_NOW)
    assert (now[element], now["planned_s"]) == (200.0, 200.0)
    assert list(now["stops"]) == ([] if reason is None else [reason])


def test_a_control_without_execution_state_produces_while_it_feeds(calendar: Path) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar), told_s=1.0)
    stream = [birth(0.0, feed_mm_min=0.0, program="O1"), data(50.0, feed_mm_min=800.0), data(150.0, feed_mm_min=0.0)]
    (now,) = _records(fed(engine, *stream, data(200.0, program="O2")), "shift", PRODUCTION_NOW)
    assert now["production_s"] == pytest.approx(100.0, abs=1.0)


def test_performance_can_be_above_one(calendar: Path) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar), ideal_s={"O1": 125.0})
    assert _last(fed(engine, *_alive(640.0, *_shift_of_parts())))["performance"] == 1.25


def test_a_part_that_was_joined_in_its_middle_says_nothing_of_the_performance(calendar: Path) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar), ideal_s={"O1": 114.0})
    stream = [birth(0.0, **IDLE | {"exec_state": "STOPPED", "alarm": "EX1012 NO OIL"}), data(10.0, exec_state="ACTIVE", alarm="")]
    actions = fed(engine, *stream, data(75.0, exec_state="READY"), data(90.0, ambient_temp_c=20.0))
    (part,) = _records(actions, "part")
    assert (part["complete"], part["active_s"], _last(actions)["performance"]) == (False, 65.0, None)


def test_silence_is_unknown_and_never_running(calendar: Path) -> None:
    """The machine is ACTIVE and is not heard for an hour: it ran for as long as it was heard, and ten minutes of patience."""
    stream = [birth(0.0, **IDLE, ambient_temp_c=20.0), data(10.0, exec_state="ACTIVE"), data(3700.0, ambient_temp_c=21.0)]
    stream.append(data(3710.0, ambient_temp_c=20.0))
    (shift,) = _records(fed(engine_of(PROCESSOR, calendar=str(calendar)), *stream), "shift")
    assert shift["production_s"] == 600.0
    assert shift["unknown_s"] == 3000.0 - 10.0 - 600.0
    assert shift["ratios"]["availability"] is None
    assert "not heard" in shift["why"]["availability"]


def test_what_runs_in_a_break_or_outside_all_shifts_is_counted_beside(calendar: Path) -> None:
    stream = [birth(0.0, **IDLE), data(1100.0, exec_state="ACTIVE"), data(2000.0, exec_state="READY")]
    engine = engine_of(PROCESSOR, calendar=str(calendar), gap_s_max=7200.0)
    (shift,) = _records(fed(engine, *stream, data(3700.0, program="O2")), "shift")
    assert (shift["beside_s"], shift["production_s"]) == (600.0, 300.0)  # the break is from 1200 s to 1800 s


def test_a_shift_that_is_joined_late_says_that_its_beginning_is_unknown(calendar: Path) -> None:
    stream = [birth(300.0, **IDLE), *(data(300.0 + 60 * n, ambient_temp_c=20.0 + n % 2) for n in range(1, 60))]
    (shift,) = _records(fed(engine_of(PROCESSOR, calendar=str(calendar)), *stream), "shift")
    assert (shift["planned_s"], shift["unknown_s"]) == (3000.0, 300.0)


def test_energy_over_a_hole_is_not_made_up(calendar: Path) -> None:
    stream = [birth(0.0, **IDLE), data(1.0, spindle_power_kw=3.6), data(61.0, spindle_power_kw=3.6), death(61.0)]
    stream += [birth(400.0, **IDLE | {"spindle_power_kw": 3.6}), data(430.0, ambient_temp_c=20.0)]
    (now,) = _records(
        fed(engine_of(PROCESSOR, calendar=str(calendar)), *stream, data(480.0, program="O2")), "shift", PRODUCTION_NOW
    )
    assert now["energy_s"] <= 61.0 + 80.0
    assert now["energy_kwh"] == pytest.approx(3.6 * now["energy_s"] / 3600.0, abs=0.002)


def test_leaps_of_years_end_and_give_no_shift_that_nobody_saw(calendar: Path) -> None:
    engine = engine_of(PROCESSOR, calendar=str(calendar))
    far_s = (datetime(2400, 1, 1, 14, 0, tzinfo=UTC).timestamp() * 1000 - T0_MS) / 1000
    records = _records(fed(engine, birth(0.0, **IDLE), data(5.0, exec_state="ACTIVE"), data(far_s, exec_state="READY")), "shift")
    assert len(records) < 200
    assert sum(one["production_s"] for one in records) == 600.0


_TOLD = st.sampled_from(
    [
        {"exec_state": "ACTIVE"},
        {"exec_state": "READY"},
        {"exec_state": "FEED_HOLD"},
        {"exec_state": None},
        {"alarm": "FAULT: x"},
        {"alarm": ""},
        {"controller_mode": "MANUAL"},
        {"controller_mode": "AUTOMATIC"},
        {"program": "O2"},
        {"spindle_power_kw": 3.0},
        {"part_quality": "good"},
        {"part_quality": "scrap"},
        {"feed_override_pct": 0.0},
        {"feed_override_pct": 100.0},
        None,
    ]
)


@given(steps=st.lists(st.tuples(st.integers(1, 700), _TOLD), max_size=25), cut=st.integers(0, 26))
@settings(max_examples=examples(60, 15), deadline=None)
def test_times_add_up_and_a_restart_in_the_middle_changes_nothing(
    calendar: Path, steps: list[tuple[int, dict[str, Any] | None]], cut: int
) -> None:
    at_s, stream = 0.0, [birth(0.0, **IDLE)]
    for seconds, told in steps:
        at_s += seconds
        stream += [death(at_s), birth(at_s + 1, **IDLE)] if told is None else [data(at_s, **told)]
    whole, again = (engine_of(PROCESSOR, calendar=str(calendar), ideal_s={"O1": 60.0}) for _ in range(2))
    expected = [fed(whole, one) for one in stream]
    actions = [fed(again, one) for one in stream[:cut]]
    _restart(again)
    actions += [fed(again, one) for one in stream[cut:]]
    assert repr(actions) == repr(expected)
    for record in _records([action for some in expected for action in some], "shift"):
        elements = ("production_s", "setup_s", "delay_s", "down_s", "unknown_s")
        if record["shift"] is not None:
            assert sum(record[name] for name in elements) == pytest.approx(record["planned_s"], abs=0.5)
            assert sum(stop["s"] for stop in record["stops"].values()) == pytest.approx(
                record["planned_s"] - record["production_s"], abs=1.5
            )
        ratios = record["ratios"]
        assert all(ratios[name] is None or 0.0 <= ratios[name] <= 1.0 for name in ("availability", "quality"))


def _restart(engine: Engine) -> None:
    adapter: TypeAdapter[State] = TypeAdapter(State)
    for unit in engine.known_units.values():
        if unit.live is not None:
            unit.live.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, unit.live.state))))


def test_history_that_comes_late_changes_nothing(calendar: Path) -> None:
    stream = list(_alive(900.0, *_shift_of_parts()))
    late = [data(200.0, history=True, exec_state="STOPPED"), data(300.0, history=True, exec_state="ACTIVE")]
    plain, with_late = (engine_of(PROCESSOR, calendar=str(calendar)) for _ in range(2))
    expected = fed(plain, *stream)
    actions = fed(with_late, *stream[:-3], *late, *stream[-3:])
    live = [one for one in actions if not (isinstance(one, Publish) and one.changes[0].is_historical)]
    assert _records(live, "shift", PRODUCTION_NOW) == _records(expected, "shift", PRODUCTION_NOW)
    assert EventKind.DATA in {one.kind for one in late}
