"""The plain mirror: any client reads it, any JSON parser takes it, and nothing stays good when its edge is gone."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processors.mirror import PROCESSOR, mirrored
from processors.plain_topic import topic_level, topic_path
from sparkplug.host_session import EventKind
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.processors.streams import T0_MS, birth, data, death, engine_of, event, fed, hole, plain, reading

THERMAL = NodeId("cnc", "twin-thermal")


def mirror(*events: Any) -> dict[str, dict[str, Any]]:
    """Return what the retained topics hold after these events."""
    return {topic: json.loads(payload) for topic, payload in plain(fed(engine_of(PROCESSOR), *events)).items()}


def test_a_signal_is_one_retained_json_object() -> None:
    assert mirror(birth(2.25, spindle_rpm=2400.0)) == {
        "cnc/okuma/spindle_rpm": {"value": 2400.0, "t": "2022-02-10T13:51:02.250Z", "unit": "rev/min", "quality": "good"}
    }


def test_only_what_changed_is_published_again() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, spindle_rpm=1.0, program="A"))
    assert list(plain(fed(engine, data(1.0, program="B")))) == ["cnc/okuma/program"]


def test_twin_metrics_stand_beside_the_raw_ones_with_their_slash() -> None:
    topics = mirror(birth(0.0, spindle_rpm=1.0), birth(0.1, node=THERMAL, **{"twin/spindle_temp_c": 31.5}))
    assert topics["cnc/okuma/twin/spindle_temp_c"]["value"] == 31.5
    assert topics["cnc/okuma/spindle_rpm"]["quality"] == "good"


def test_at_a_death_the_signals_of_that_edge_are_stale_and_keep_value_and_time() -> None:
    twin = birth(0.1, node=THERMAL, **{"twin/spindle_temp_c": 31.5})
    topics = mirror(birth(0.0, spindle_rpm=7.0), twin, death(9.0))
    stale = topics["cnc/okuma/spindle_rpm"]
    assert (stale["value"], stale["quality"], stale["t"]) == (7.0, "stale", "2022-02-10T13:51:00.000Z")
    assert stale["reason"] == "device offline"
    assert topics["cnc/okuma/twin/spindle_temp_c"]["quality"] == "good"
    assert (
        mirror(birth(0.0, spindle_rpm=7.0), death(9.0), birth(10.0, spindle_rpm=0.0))["cnc/okuma/spindle_rpm"]["quality"]
        == "good"
    )


def test_a_null_stays_null_with_its_reason() -> None:
    null = reading("tool_number", None, 1.0, quality=Quality.BAD, reason="no tool in the spindle")
    shown = mirror(birth(0.0, tool_number=1), event(EventKind.DATA, 1.0, null))["cnc/okuma/tool_number"]
    assert (shown["value"], shown["quality"], shown["reason"]) == (None, "bad", "no tool in the spindle")


def test_history_does_not_overwrite_the_present() -> None:
    assert (
        mirror(birth(100.0, spindle_rpm=7.0), data(1.0, history=True, spindle_rpm=1.0))["cnc/okuma/spindle_rpm"]["value"] == 7.0
    )


def test_a_hole_publishes_nothing() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    assert fed(engine, hole(1.0)) == []


def test_the_mirror_says_goodbye_by_marking_everything_stale() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    (last,) = engine.farewell(T0_MS)
    assert json.loads(last.payload)["quality"] == "stale"


@pytest.mark.parametrize(
    ("value", "quality", "reason"),
    [
        (float("nan"), "bad", "not a finite number: nan"),
        (float("inf"), "bad", "not a finite number: inf"),
        (b"\x00", "good", "a bytes has no plain form; read it by Sparkplug"),
        ((1.0, float("nan")), "bad", "an array with a number that is not finite"),
    ],
)
def test_what_json_cannot_say_is_null_with_a_reason(value: Any, quality: str, reason: str) -> None:
    shown = json.loads(mirrored(Reading("x", value, T0_MS, Quality.GOOD, None, None, False)))
    assert (shown["value"], shown["quality"], shown["reason"]) == (None, quality, reason)


def test_arrays_texts_and_truths_are_themselves() -> None:
    for value in ((1.0, 2.0), "Fräsen", True, 2**63):
        shown = json.loads(mirrored(Reading("x", value, T0_MS, Quality.GOOD, None, None, False)))["value"]
        assert shown == (list(value) if isinstance(value, tuple) else value)


def test_a_time_beyond_the_calendar_is_null() -> None:
    assert json.loads(mirrored(Reading("x", 1, 2**64 - 1, Quality.GOOD, None, None, False)))["t"] is None


@given(st.text(), st.text())
def test_no_two_names_share_a_topic_and_none_holds_a_wildcard(one: str, other: str) -> None:
    assert (topic_path(one) == topic_path(other)) is (one == other)
    assert (topic_level(one) == topic_level(other)) is (one == other)
    assert not set("+#\0") & set(topic_path(one))
    assert "/" not in topic_level(one)


@given(st.lists(st.floats() | st.floats(1e-5, 1e17) | st.floats(-1e4, 1e4).map(lambda value: round(value, 3)), max_size=20))
def test_numbers_of_one_message_are_written_as_each_would_be_alone(values: list[float]) -> None:
    readings = [reading(f"s{place}", value) for place, value in enumerate(values)]
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    shown = plain(fed(engine, event(EventKind.DATA, 0.0, *readings)))
    assert shown == {f"cnc/okuma/{one.name}": mirrored(one) for one in readings}
    for one, value in zip(readings, values, strict=True):
        if math.isfinite(value):
            assert f'"value":{value!r},'.encode() in mirrored(one)


_plain_numbers = st.floats(-1e4, 1e4).map(lambda value: round(value, 3)) | st.sampled_from(
    (0.0, -0.0, 1e-4, 9e-5, 10.00001, 1e15)
)


@given(
    st.lists(st.tuples(_plain_numbers, st.sampled_from((None, "%", "°C", "mm/min", '"'))), min_size=1, max_size=20),
    st.sampled_from((None, True, 1, "1", 1e16, math.nan)),
    st.sampled_from((None, "", "why")),
    st.sampled_from((Quality.GOOD, Quality.BAD)),
)
def test_a_message_of_good_numbers_is_written_as_each_would_be_alone(
    numbers: list[tuple[float, str | None]], last: object, reason: str | None, quality: Quality
) -> None:
    readings = [
        Reading(f"s{place}", value, T0_MS, Quality.GOOD, unit, None, False) for place, (value, unit) in enumerate(numbers)
    ]
    for others in ([], [Reading("last", last, T0_MS, quality, None, reason, False)]):
        engine = engine_of(PROCESSOR)
        fed(engine, birth(0.0, spindle_rpm=1.0))
        shown = plain(fed(engine, event(EventKind.DATA, 0.0, *readings, *others)))
        assert shown == {f"cnc/okuma/{one.name}": mirrored(one) for one in [*readings, *others]}
