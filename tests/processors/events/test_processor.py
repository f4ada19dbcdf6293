"""Execution states as events, cycle times, stops with their reasons, and the record of each part."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from processors.actions import Publish
from processors.events.processor import PROCESSOR
from processors.events.record import BYTES_MAX
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.quality import Quality
from tests.cnctwin.memory.replay.mazak import mazak_hours
from tests.processors.streams import T0_MS, birth, data, death, engine_of, event, published, reading

SCHEMA = json.loads((Path(__file__).parents[3] / "docs" / "reference" / "part_record.schema.json").read_text(encoding="utf-8"))
READY = {
    "exec_state": "READY",
    "program": "O1",
    "controller_mode": "AUTOMATIC",
    "tool_number": 1,
    "alarm": "",
    "spindle_temp_c": 22.0,
}


def told(*events: HostEvent, **table: Any) -> list[tuple[float, str, Any]]:
    """Return what is published: (s after the start, metric, value)."""
    engine = engine_of(PROCESSOR, **table)
    actions = [action for one in events for action in engine.feed(one, 0.0)]
    return [(at_ms / 1000, name.removeprefix("twin/"), value) for at_ms, name, value, _ in published(actions)]


def of(found: list[tuple[float, str, Any]], name: str) -> list[tuple[float, Any]]:
    return [(at_s, value) for at_s, metric, value in found if metric == name and value is not None]


def records(found: list[tuple[float, str, Any]]) -> list[dict[str, Any]]:
    parsed = [json.loads(text) for _, text in of(found, "part_record")]
    for record in parsed:
        jsonschema.validate(record, SCHEMA)
    return parsed


def state(at_s: float, name: str | None, **more: Any) -> HostEvent:
    values = reading(
        "exec_state", name, at_s, quality=Quality.GOOD if name else Quality.BAD, reason=None if name else "unavailable"
    )
    return event(EventKind.DATA, at_s, values, *(reading(key, value, at_s) for key, value in more.items()))


def test_a_cycle_is_from_active_to_its_end_and_interruptions_are_counted_apart() -> None:
    found = told(
        birth(0.0, **READY),
        state(10.0, "ACTIVE"),
        state(30.0, "FEED_HOLD"),
        state(35.0, "ACTIVE"),
        state(70.0, "PROGRAM_COMPLETED"),
    )
    assert of(found, "execution_state") == [
        (0.0, "READY"), (10.0, "ACTIVE"), (30.0, "FEED_HOLD"), (35.0, "ACTIVE"), (70.0, "PROGRAM_COMPLETED")
    ]  # fmt: skip
    assert of(found, "cycle_time_s") == [(70.0, 60.0)]
    assert of(found, "interrupted_s") == [(70.0, 5.0)]
    (record,) = records(found)
    assert record["complete"]
    assert record["cycle"] | {"stops": {"feed hold": 5.0}, "active_s": 55.0} == record["cycle"]


def test_a_control_that_tells_no_completion_ends_a_run_where_it_is_ready_and_another_program_begins_another_part() -> None:
    found = told(
        birth(0.0, **READY), state(10.0, "ACTIVE"), state(40.0, "READY"), state(50.0, "ACTIVE"), state(80.0, "STOPPED"),
        state(90.0, "ACTIVE", program="O2"), state(120.0, "READY"),
    )  # fmt: skip
    assert of(found, "cycle_time_s") == [(40.0, 30.0), (90.0, 40.0), (120.0, 30.0)]
    assert [(one["program"], one["ended_by"]) for one in records(found)] == [
        ("O1", "ready"),
        ("O1", "next start"),
        ("O2", "ready"),
    ]


def test_a_reconnect_makes_no_event() -> None:
    """A burst of UNAVAILABLE, then everything is said again: still the same run, with a hole in it."""
    found = told(
        birth(0.0, **READY), state(10.0, "ACTIVE"), state(30.0, None, program=None), state(60.0, "ACTIVE", program="O1"),
        state(100.0, "READY"), state(110.0, None), state(150.0, "READY"),
    )  # fmt: skip
    assert of(found, "cycle_number") == [(100.0, 1)]
    assert of(found, "execution_since")[-1][0] == 100.0
    (record,) = records(found)
    assert (record["complete"], record["cycle"]["unknown_s"], record["cycle"]["cycle_time_s"]) == (False, 30.0, 90.0)


def test_what_began_or_ended_unseen_has_no_cycle_time() -> None:
    found = told(
        birth(0.0, **READY | {"exec_state": "ACTIVE"}),
        state(30.0, "READY"),
        state(40.0, "ACTIVE"),
        state(60.0, None),
        state(90.0, "READY"),
    )
    assert of(found, "cycle_time_s") == []
    assert [one["reasons"][0] for one in records(found)] == ["its beginning was not seen", "its end was not seen"]


@pytest.mark.parametrize(
    ("heard", "is_seen"),
    [
        ([birth(0.0, **READY | {"exec_state": "STOPPED", "alarm": "EX1012 NO OIL"})], False),
        ([birth(0.0, **READY), death(2.0), birth(5.0, **READY | {"exec_state": "STOPPED"})], False),
        ([birth(0.0, **READY), birth(5.0, **READY | {"exec_state": "ACTIVE"})], False),
        ([birth(0.0, **READY), state(5.0, "STOPPED", alarm="EX1012 NO OIL")], True),
        ([birth(0.0, **READY | {"exec_state": "STOPPED"}), state(5.0, "READY")], True),
    ],
    ids=["first heard standing", "back while it stands", "told by a birth", "an alarm between two parts", "reset meanwhile"],
)
def test_going_on_with_a_program_that_began_unheard_is_no_beginning(heard: list[HostEvent], is_seen: bool) -> None:
    (record,) = records(told(*heard, state(10.0, "ACTIVE", alarm=""), state(70.0, "PROGRAM_COMPLETED")))
    assert record["complete"] is is_seen
    assert ("its beginning was not seen" in record["reasons"]) is not is_seen


def test_the_part_after_one_that_was_joined_is_whole() -> None:
    started = birth(0.0, **READY | {"exec_state": "STOPPED"})
    turns = (state(10.0 * n, name) for n, name in enumerate(("ACTIVE", "READY", "ACTIVE", "STOPPED", "ACTIVE", "READY"), 1))
    assert [record["complete"] for record in records(told(started, *turns))] == [False, True]


def test_a_run_by_hand_is_no_part() -> None:
    found = told(birth(0.0, **READY | {"controller_mode": "MANUAL_DATA_INPUT"}), state(10.0, "ACTIVE"), state(40.0, "READY"))
    assert of(found, "cycle_number") == []


@pytest.mark.parametrize(
    ("told_now", "reason"),
    [
        ({"exec_state": "FEED_HOLD"}, "feed hold"),
        ({"exec_state": "PROGRAM_STOPPED"}, "program stop (M0)"),
        ({"exec_state": "OPTIONAL_STOP"}, "optional stop (M1)"),
        ({"exec_state": "INTERRUPTED", "tool_change_active": True}, "tool change"),
        ({"exec_state": "FEED_HOLD", "tool_change_active": True}, "feed hold"),
        ({"exec_state": "WAIT", "tool_change_active": True}, "tool change"),
        ({"exec_state": "STOPPED", "tool_change_active": True, "alarm": "EX1012 NO OIL"}, "alarm: EX1012 NO OIL"),
        ({"exec_state": "FEED_HOLD", "tool_change_active": True, "alarm": "FAULT 414 SERVO"}, "alarm: FAULT 414 SERVO"),
        ({"exec_state": "STOPPED", "tool_change_active": True, "alarm": "WARNING 101 COOLANT LOW"}, "tool change"),
        ({"exec_state": "STOPPED", "alarm": "WARNING 101 COOLANT LOW"}, "alarm: WARNING 101 COOLANT LOW"),
        ({"exec_state": "INTERRUPTED"}, "not told"),
        ({"exec_state": "STOPPED", "alarm": "FAULT 414 SERVO"}, "alarm: FAULT 414 SERVO"),
        ({"exec_state": "FEED_HOLD", "alarm": "FAULT 414 SERVO"}, "alarm: FAULT 414 SERVO"),
        ({"exec_state": "FEED_HOLD", "alarm": "WARNING 101 SOFT LIMIT"}, "feed hold"),
        ({"exec_state": "STOPPED", "controller_mode": "MANUAL"}, "mode MANUAL"),
        ({"exec_state": "ACTIVE", "feed_override_pct": 0.0}, "feed override 0 %"),
        ({"exec_state": "ACTIVE", "feed_override_pct": 80.0}, "none"),
    ],
)  # fmt: skip
def test_a_stop_has_the_reason_that_is_told(told_now: dict[str, Any], reason: str) -> None:
    offered = READY | {"tool_change_active": False, "feed_override_pct": 100.0}
    found = told(
        birth(0.0, **offered), state(10.0, "ACTIVE"), data(20.0, **told_now), data(32.0, **offered | {"exec_state": "ACTIVE"})
    )
    assert [value for at_s, value in of(found, "stop_reason") if at_s == 20.0] in ([reason], [] if reason == "none" else [reason])
    if reason != "none":
        assert (32.0, 12.0) in of(found, "stop_s")


def test_an_edge_that_dies_is_offline_and_the_time_is_no_ones() -> None:
    found = told(
        birth(0.0, **READY), state(600.0, "ACTIVE"), death(1200.0), birth(5000.0, **READY), data(5700.0, **READY), seen_s_min=60.0
    )
    assert (1200.0, "OFFLINE") in of(found, "execution_state")
    assert of(found, "utilisation_pct")[-1][1] == pytest.approx(100.0 * 600.0 / (600.0 + 600.0 + 600.0), abs=1.0)
    assert of(found, "stop_s")[-1][1] > 0.0


def test_tools_force_and_temperature_of_a_part_are_in_its_record() -> None:
    force = NodeId("cnc", "twin-cutting_force")
    found = told(
        birth(0.0, **READY),
        birth(0.5, node=force, **{"twin/cutting_force_n": 0.0}),
        state(10.0, "ACTIVE"),
        data(10.5, node=force, **{"twin/cutting_force_n": 500.0}),
        data(40.0, tool_number=2, spindle_temp_c=30.0),
        data(40.5, node=force, **{"twin/cutting_force_n": 900.0}),
        data(60.0, tool_number=1),
        state(130.0, "PROGRAM_COMPLETED"),
    )
    (record,) = records(found)
    assert [(use["tool"], use["changes"], use["active_s"]) for use in record["tools"]] == [(1, 1, 100.0), (2, 1, 20.0)]
    assert record["tool_changes"] == 2
    assert [use["force_n"]["max"] for use in record["tools"]] == [900.0, 900.0]
    assert record["tools"][0]["force_n"]["mean"] == pytest.approx((30 * 500 + 70 * 900) / 100, abs=10)
    assert (record["temperature"]["min"], record["temperature"]["max"], len(record["temperature"]["profile"])) == (22.0, 30.0, 2)
    assert record["provenance"]["force"] == "inferred"
    assert "no vibration" in record["reasons"]


def test_a_record_is_bounded_whatever_a_run_was_like() -> None:
    engine, flags = engine_of(PROCESSOR), ("twin/rule_vibration", "twin/anomaly_alarm")
    rules, actions = NodeId("cnc", "twin-rules"), []
    stream = [
        birth(0.0, **READY | {"program": "🂡" * 100}),
        birth(0.1, node=rules, **dict.fromkeys(flags, False)),
        state(1.0, "ACTIVE"),
    ]
    for number in range(300):
        at_s = 10.0 + 60.0 * number
        stream.append(state(at_s, "STOPPED", alarm=f"FAULT {number} " + "Ω" * 90, tool_number=number))
        stream.append(state(at_s + 5.0, "ACTIVE", alarm=""))
        stream.append(data(at_s + 6.0, node=rules, **dict.fromkeys(flags, number % 2 == 0)))
    for one in [*stream, state(20_000.0, "PROGRAM_COMPLETED")]:
        actions += [action for action in engine.feed(one, 0.0) if isinstance(action, Publish)]
    text = [change.value for action in actions for change in action.changes if change.name == "twin/part_record"][-1]
    assert len(text.encode()) <= BYTES_MAX
    jsonschema.validate(json.loads(text), SCHEMA)
    assert len(engine.snapshot("okuma")) < 30_000


def test_hours_of_a_real_mazak_make_no_event_by_a_reconnect(tmp_path: Path) -> None:
    """Bursts of UNAVAILABLE, lines that go back in time; after each burst everything is said again."""
    engine, found = engine_of(PROCESSOR), []
    told_states: list[Any] = []
    for message in mazak_hours(tmp_path):
        told_states += [r.value for r in message.event.readings if r.name == "exec_state" and r.quality is Quality.GOOD]
        found += published(engine.feed(message.event, 0.0))
    told_runs = [one for number, one in enumerate(told_states) if number == 0 or one != told_states[number - 1]]
    since = [value for _, name, value, _ in found if name == "twin/execution_since"]
    assert len(since) == len(told_runs), "as many changes as the control has told, and none more"
    parts = [json.loads(value) for _, name, value, _ in found if name == "twin/part_record"]
    for part in parts:
        jsonschema.validate(part, SCHEMA)
    assert len({part["id"] for part in parts}) == len(parts) >= 3
    assert Counter(part["program"] for part in parts) == {"793": len(parts)}
    assert all(
        part["complete"] == (part["cycle"]["unknown_share_pct"] <= 1.0 and part["cycle"]["cycle_time_s"] is not None)
        for part in parts
    )


def test_the_stream_begins_at_a_whole_second() -> None:
    assert T0_MS % 1000 == 0
