"""What a client must handle (seen on real agents of both generations), on small hand-made documents."""

import json

import pytest
from pydantic import TypeAdapter

from edge.config import EdgeConfig, SignalSection
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.cursor import next_request
from edge.controls.mtconnect.state import Cursor, Phase
from edge.sample import Drop
from sparkplug.quality import Quality
from tests.edge.controls.mtconnect.agent_documents import CONFIG, DIALECTS, error, fed, probe, streams, value, values

dialects = pytest.mark.parametrize("version", DIALECTS)


def sampling(version: str = "2.3", next_sequence: int = 10, **probe_options: int) -> Cursor:
    """A cursor that has seen the device and its first baseline."""
    baseline = streams(next_sequence, [value("rpm", 3, "100"), value("tool", 5, "7")], version=version)
    cursor, frame = fed(probe(version, **probe_options), baseline)
    assert values(frame) == [("spindle_rpm", 100.0), ("tool_number", 7)]
    return cursor


@pytest.mark.parametrize("version", ["1.2", "1.3", "1.4", "1.8", "2.0", "2.3", "2.7"])
def test_any_schema_version_is_read(version: str) -> None:
    cursor = sampling(version)
    assert (cursor.phase, cursor.device_name, cursor.next_sequence) == (Phase.SAMPLE, "VMC", 10)


def test_requests_follow_the_phases() -> None:
    cursor = Cursor()
    assert next_request(CONFIG, cursor).path == "/probe"
    cursor, _ = fed(probe())
    assert next_request(CONFIG, cursor).path == "/VMC/current"
    request = next_request(CONFIG, sampling(next_sequence=42))
    assert request.path == "/VMC/sample"
    assert dict(request.parameters)["from"] == 42


def test_the_count_never_exceeds_the_buffer_of_the_agent() -> None:
    assert dict(next_request(CONFIG, sampling(buffer_size=64)).parameters)["count"] == 128  # the newest header counts
    assert dict(next_request(CONFIG, fed(probe(buffer_size=64), streams(5, buffer_size=64))[0]).parameters)["count"] == 64


def test_sampling_continues_at_the_next_sequence_of_the_header_not_after_the_last_element() -> None:
    document = streams(20, [value("rpm", 18, "3"), value("load", 12, "1"), value("xload", 15, "2")])
    cursor, frame = fed(document, cursor=sampling())
    assert cursor.next_sequence == 20
    assert [sample.sequence for sample in frame.samples] == [12, 15, 18]


@dialects
def test_nothing_new_is_an_empty_document_and_the_place_is_kept(version: str) -> None:
    cursor = sampling(version)
    after, frame = fed(streams(10, version=version), cursor=cursor)
    assert after == cursor
    assert (frame.received, frame.samples, frame.error) == (0, (), None)


def test_a_document_that_comes_twice_gives_nothing_new() -> None:
    document = streams(12, [value("rpm", 10, "3"), value("load", 11, "1")])
    once, first = fed(document, cursor=sampling())
    twice, second = fed(document, cursor=once)
    assert len(first.samples) == 2
    assert (twice, second.samples, second.dropped) == (once, (), {Drop.DUPLICATE: 2})


def test_backward_time_stamps_are_data_and_the_order_is_that_of_the_sequence() -> None:
    document = streams(
        12, [value("rpm", 10, "3", time="2026-01-01T10:00:00Z"), value("load", 11, "1", time="2022-08-08T13:51:34.7167146Z")]
    )
    _, frame = fed(document, cursor=sampling())
    assert [sample.timestamp_ms for sample in frame.samples] == [1767261600000, 1659966694716]


def test_an_empty_tool_number_is_a_value_and_not_nothing() -> None:
    _, frame = fed(streams(11, [value("tool", 10)]), cursor=sampling())
    (sample,) = frame.samples
    assert (sample.value, sample.quality, sample.reason) == (None, Quality.GOOD, "empty")


def test_an_empty_block_is_an_empty_text_and_an_empty_figure_is_bad() -> None:
    _, frame = fed(streams(12, [value("block", 10), value("rpm", 11)]), cursor=sampling())
    block, speed = frame.samples
    assert (block.value, block.quality) == ("", Quality.GOOD)
    assert (speed.value, speed.quality, speed.reason) == (None, Quality.BAD, "empty")


def test_unavailable_is_null_with_the_reason() -> None:
    _, frame = fed(streams(11, [value("rpm", 10, "UNAVAILABLE")]), cursor=sampling())
    (sample,) = frame.samples
    assert (sample.value, sample.quality, sample.reason) == (None, Quality.BAD, "unavailable")


def test_conditions_say_their_level_by_the_name_of_their_element() -> None:
    fault = value("servo", 10, "OVERHEAT", element="Fault", nativeCode="430")
    cursor, frame = fed(streams(11, conditions=[fault]), cursor=sampling())
    (said, listed) = frame.samples
    assert (said.signal, said.value, listed.signal) == ("alarm", "FAULT 430 OVERHEAT", "alarms")
    assert json.loads(str(listed.value)) == [
        {
            "code": "430",
            "text": "OVERHEAT",
            "severity": "fault",
            "active": True,
            "acknowledged": None,
            "since": "2026-01-01T00:00:10.000Z",
        }
    ]
    cursor, frame = fed(streams(12, conditions=[value("servo", 11, element="Normal")]), cursor=cursor)
    assert values(frame) == [("alarm", ""), ("alarms", "[]")]
    cursor, frame = fed(streams(13, conditions=[value("servo", 12, element="Unavailable")]), cursor=cursor)
    assert [(s.value, s.reason) for s in frame.samples] == [(None, "unavailable")] * 2


@dialects
def test_the_agent_is_no_machine_and_its_observations_are_of_another_device(version: str) -> None:
    document = streams(11, [value("aa", 10, "AVAILABLE")], version=version, device=("Agent", "agent-1"))
    _, frame = fed(document, cursor=sampling(version))
    assert (frame.samples, frame.dropped) == ((), {Drop.OTHER_DEVICE: 1})


def test_of_several_machines_one_must_be_named() -> None:
    cursor, frame = fed(probe(other=True))
    assert cursor.phase is Phase.PROBE
    assert frame.error == "mtconnect.device = '': the agent has 2 devices; choose one of VMC, OTHER"
    named = EdgeConfig(source=MtconnectConfig(device="vmc-1"))
    assert fed(probe(other=True), config=named)[0].device_name == "VMC"


def test_a_name_that_no_device_has_is_refused_with_those_there_are() -> None:
    _, frame = fed(probe(), config=EdgeConfig(source=MtconnectConfig(device="LATHE")))
    assert frame.error == "mtconnect.device = 'LATHE': the agent has no such device; it has VMC"


def test_a_data_item_that_no_device_has_is_refused_with_what_is_near() -> None:
    config = EdgeConfig(source=MtconnectConfig(), signals={"feed_mm_min": SignalSection(data_item="fed")})
    _, frame = fed(probe(), config=config)
    assert frame.error == "signals.feed_mm_min.data_item = 'fed': device 'VMC' has no such item; near are feed"


def test_values_in_streams_are_in_the_declared_unit_and_not_in_the_native_one() -> None:
    _, frame = fed(streams(11, [value("feed", 10, "2")]), cursor=sampling())
    assert values(frame) == [("feed_mm_min", 120.0)]


def test_the_configuration_may_say_that_a_unit_is_another() -> None:
    config = EdgeConfig(source=MtconnectConfig(), signals={"feed_mm_min": SignalSection(native_unit="INCH/MINUTE")})
    _, frame = fed(probe(), streams(2, [value("feed", 1, "10")]), config=config)
    assert values(frame) == [("feed_mm_min", 254.0)]


def test_a_figure_that_cannot_be_is_null_and_the_reason_keeps_it() -> None:
    _, frame = fed(streams(12, [value("load", 10, "950"), value("temp", 11, "0")]), cursor=sampling())
    assert [(s.value, s.quality, s.reason) for s in frame.samples] == [
        (None, Quality.BAD, "outside 0 to 200 %: 950"),
        (None, Quality.BAD, "outside 1 to 150 °C: 0"),
    ]


def test_data_sets_are_counted_and_not_taken_for_a_value() -> None:
    entries = value("vars", 10, "x", element="VariableDataSet", count="1").replace(">x<", '><Entry key="a">1</Entry><')
    as_tool = entries.replace("vars", "tool").replace('"10"', '"11"')
    _, frame = fed(streams(12, [entries, as_tool]), cursor=sampling())
    assert frame.dropped == {Drop.UNMAPPED: 1}
    assert [(s.signal, s.value, s.reason) for s in frame.samples] == [("tool_number", None, "several values in one observation")]


def test_an_observation_without_a_readable_sequence_or_time_is_counted() -> None:
    document = streams(12, [value("rpm", "x", "3"), value("rpm", 11, "4", time="yesterday"), value("rpm", "-1", "5")])
    _, frame = fed(document, cursor=sampling())
    assert (frame.samples, frame.dropped) == ((), {Drop.UNPARSABLE: 3})


# Holes.


@dialects
def test_out_of_range_is_a_hole_that_is_counted_and_the_baseline_is_taken_anew(version: str) -> None:
    cursor, frame = fed(
        error("OUT_OF_RANGE", "'from' must be greater than or equal to 200", version=version), cursor=sampling(version)
    )
    assert (cursor.phase, cursor.attempt) == (Phase.CURRENT, 1)
    assert frame.error is not None
    assert "OUT_OF_RANGE" in frame.error
    current = streams(328, [value("rpm", 300, "9"), value("tool", 5, "7"), value("load", 150, "3")], version=version, first=200)
    cursor, frame = fed(current, cursor=cursor)
    assert (cursor.phase, cursor.next_sequence, cursor.attempt) == (Phase.SAMPLE, 328, 0)
    assert values(frame) == [("spindle_load_pct", 3.0), ("spindle_rpm", 9.0)]
    assert frame.dropped == {Drop.DUPLICATE: 1}  # the tool number that was taken before
    (gap,) = frame.gaps
    assert (gap.first_sequence, gap.last_sequence, gap.lost) == (10, 327, 316)  # 318 numbers, two of them found


def test_out_of_range_on_what_is_still_there_loses_nothing() -> None:
    current = streams(20, [value("rpm", 15, "9")])
    cursor, frame = fed(error("OUT_OF_RANGE", "count"), current, cursor=sampling())
    assert (cursor.phase, cursor.next_sequence) == (Phase.SAMPLE, 10)
    assert (frame.samples, frame.gaps) == ((), ())
    _, frame = fed(streams(20, [value("rpm", 15, "9")]), cursor=cursor)
    assert values(frame) == [("spindle_rpm", 9.0)]


def test_an_agent_that_answers_from_its_first_sequence_leaves_a_hole_too() -> None:
    cursor, _ = fed(streams(60, [value("rpm", 50, "1")], first=50), cursor=sampling())
    assert cursor.phase is Phase.CURRENT
    _, frame = fed(streams(60, [value("rpm", 50, "1")], first=50), cursor=cursor)
    assert [(g.first_sequence, g.last_sequence, g.lost) for g in frame.gaps] == [(10, 59, 49)]


def test_an_alarm_that_ended_in_a_hole_is_over() -> None:
    fault = value("servo", 10, "OVERHEAT", element="Fault", nativeCode="430")
    cursor, _ = fed(streams(11, conditions=[fault]), error("OUT_OF_RANGE"), cursor=sampling())
    other = value("servo", 250, "LAG", element="Fault", nativeCode="411")
    cursor, frame = fed(streams(328, conditions=[other], first=200), cursor=cursor)
    assert values(frame)[-2] == ("alarm", "FAULT 411 LAG")
    cursor, frame = fed(error("OUT_OF_RANGE"), streams(900, conditions=[other], first=800), cursor=cursor)
    assert values(frame)[0] == ("alarm", "FAULT 411 LAG")
    assert [alarm["code"] for alarm in json.loads(str(values(frame)[1][1]))] == ["411"]


def test_numbers_that_went_back_without_a_new_instance_are_a_hole_and_all_is_taken_anew() -> None:
    cursor, _ = fed(error("OUT_OF_RANGE"), cursor=sampling(next_sequence=500))
    cursor, frame = fed(streams(8, [value("rpm", 6, "9"), value("tool", 5, "7")]), cursor=cursor)
    assert values(frame) == [("tool_number", 7), ("spindle_rpm", 9.0)]
    (gap,) = frame.gaps
    assert (gap.reason, gap.lost) == ("sequence numbers went back from 500 to 8", 5)
    assert (cursor.phase, cursor.next_sequence) == (Phase.SAMPLE, 8)


@dialects
def test_a_restarted_agent_is_probed_anew_and_its_values_are_not_counted_twice(version: str) -> None:
    old = sampling(version)
    cursor, frame = fed(streams(3, [value("rpm", 1, "5")], version=version, instance=2), cursor=old)
    assert (cursor.phase, cursor.instance_id, frame.samples) == (Phase.PROBE, "2", ())
    baseline = streams(6, [value("rpm", 4, "5"), value("tool", 3, "8")], version=version, instance=2)
    cursor, frame = fed(probe(version, instance=2), baseline, cursor=cursor)
    assert values(frame) == [("tool_number", 8), ("spindle_rpm", 5.0)]
    (gap,) = frame.gaps
    assert (gap.first_sequence, gap.last_sequence, gap.lost) == (1, 5, 3)
    assert gap.reason == "agent restarted: instance 1 ended somewhere after sequence 9"
    _, frame = fed(baseline, cursor=cursor)
    assert (frame.samples, frame.dropped) == ((), {Drop.DUPLICATE: 2})


@dialects
def test_a_restart_that_shows_as_out_of_range_is_a_restart(version: str) -> None:
    cursor, _ = fed(error("OUT_OF_RANGE", version=version, instance=2), cursor=sampling(version))
    assert (cursor.phase, cursor.instance_id, cursor.next_sequence) == (Phase.PROBE, "2", 0)


def test_a_restart_between_probe_and_current_is_seen() -> None:
    cursor, _ = fed(probe(), streams(3, [value("rpm", 1, "5")], instance=2))
    assert cursor.phase is Phase.PROBE
    cursor, frame = fed(probe(instance=2), streams(3, [value("rpm", 1, "5")], instance=2), cursor=cursor)
    assert (cursor.phase, values(frame), frame.gaps) == (Phase.SAMPLE, [("spindle_rpm", 5.0)], ())


def test_a_restart_during_a_restart_is_one_hole() -> None:
    cursor, _ = fed(streams(3, instance=2), probe(instance=2), streams(3, instance=3), probe(instance=3), cursor=sampling())
    cursor, frame = fed(streams(2, [value("rpm", 1, "5")], instance=3), cursor=cursor)
    assert [gap.reason for gap in frame.gaps] == ["agent restarted: instance 1 ended somewhere after sequence 9"]


@dialects
@pytest.mark.parametrize("code", ["NO_DEVICE", "INVALID_XPATH", "INVALID_URI"])
def test_an_agent_that_does_not_know_the_device_is_probed_again(version: str, code: str) -> None:
    cursor, frame = fed(error(code, version=version), cursor=sampling(version))
    assert (cursor.phase, cursor.attempt) == (Phase.PROBE, 1)
    assert frame.error == f"the agent answers {code}"


def test_other_errors_are_counted_and_the_place_is_kept() -> None:
    cursor, frame = fed(error("INTERNAL_ERROR", "out of memory"), cursor=sampling())
    assert (cursor.phase, cursor.next_sequence, cursor.attempt) == (Phase.SAMPLE, 10, 1)
    assert frame.error == "the agent answers INTERNAL_ERROR: out of memory"


def test_a_good_document_ends_the_count_of_attempts() -> None:
    cursor, _ = fed(b"", b"<html/>", error("INTERNAL_ERROR"), cursor=sampling())
    assert cursor.attempt == 3
    assert fed(streams(11), cursor=cursor)[0].attempt == 0


def test_a_cursor_is_plain_json() -> None:
    kind = TypeAdapter(Cursor)
    cursor, _ = fed(streams(11, conditions=[value("servo", 10, "HOT", element="Fault")]), cursor=sampling())
    assert kind.validate_json(kind.dump_json(cursor)) == cursor


def test_availability_and_backlog_are_told() -> None:
    _, frame = fed(streams(11, [value("avail", 10, "UNAVAILABLE")]), cursor=sampling())
    assert (frame.available, frame.backlog, frame.dropped) == (False, 0, {Drop.UNMAPPED: 1})


def test_one_document_of_another_instance_in_the_middle_loses_nothing() -> None:
    here, _ = fed(probe(), streams(10, [value("rpm", 3, "100")]), streams(12, [value("rpm", 10, "1"), value("rpm", 11, "2")]))
    lost, frame = fed(streams(40, [value("rpm", 39, "9")], instance=2), cursor=here)
    assert (lost.phase, frame.samples, frame.gaps) == (Phase.PROBE, (), ())
    back, frame = fed(probe(), streams(14, [value("rpm", 13, "4")]), cursor=lost)
    assert (back.next_sequence, frame.samples, frame.gaps) == (12, (), ())
    _, frame = fed(streams(14, [value("rpm", 12, "3"), value("rpm", 13, "4")]), cursor=back)
    assert values(frame) == [("spindle_rpm", 3.0), ("spindle_rpm", 4.0)]
