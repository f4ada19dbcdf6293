"""Frames of an OPC UA server become samples."""

import json

from hypothesis import given, settings
from hypothesis import strategies as st

from edge.config import EdgeConfig, SignalSection
from edge.controls.opcua.config import Config, OpcUaConfig
from edge.controls.opcua.cursor import Cursor, parse, place, resume, start
from edge.sample import EdgeSample, SampleSet
from edge.sweep import Fact, Hole, Plain, Sweep
from sparkplug.quality import Quality


def config(name: str = "sinumerik", **signals: SignalSection) -> Config:
    return EdgeConfig(source=OpcUaConfig(map=name), signals=signals)


def frame(number: int, *facts: Fact, holes: tuple[Hole, ...] = (), life: str = "a") -> bytes:
    return Sweep(life, number, 1_000 * number + 1_000, facts, holes).encode()


def played(edge: Config, *frames: bytes) -> tuple[Cursor, list[SampleSet]]:
    cursor, given_ = start(edge), list[SampleSet]()
    for raw in frames:
        cursor, one = parse(edge, cursor, raw)
        assert one.accounted()
        given_.append(one)
    return cursor, given_


def shown(one: SampleSet) -> list[tuple[str, object, str | None]]:
    return [(sample.signal, sample.value, sample.reason) for sample in one.samples]


def test_values_come_in_the_order_of_their_own_stamps_whatever_the_order_of_the_items() -> None:
    facts = (Fact("tool_number", 0, "", 30), Fact("tool_number", 5, "", 50), Fact("nc_block", "M6", "", 20), Fact("nc_line", 7))
    _, (_, one) = played(config(), frame(0), frame(1, *facts))
    assert [(sample.signal, sample.timestamp_ms) for sample in one.samples] == [
        ("nc_block", 20), ("tool_number", 30), ("tool_number", 50), ("nc_line", 2_000),
    ]  # fmt: skip


def test_native_words_become_those_of_the_vocabulary_and_others_are_refused() -> None:
    facts = Fact("exec_state", 3), Fact("controller_mode", 2.0), Fact("alarm", 0), Fact("exec_state", 77)
    _, (one,) = played(config(), frame(0, *facts))
    assert shown(one) == [
        ("exec_state", "ACTIVE", None),
        ("controller_mode", "AUTOMATIC", None),
        ("alarm", "", None),
        ("exec_state", None, "no word of the vocabulary: '77'"),
    ]


def test_a_bad_status_is_a_null_with_the_status_name() -> None:
    _, (one,) = played(config(), frame(0, Fact("spindle_rpm", fault="BadSensorFailure", t_ms=7)))
    assert one.samples == (EdgeSample("spindle_rpm", None, 7, Quality.BAD, "BadSensorFailure", is_baseline=True),)


def test_the_configuration_has_the_last_word_on_unit_scale_and_what_is_published() -> None:
    own = config(
        "cnc_40502",
        feed_mm_min=SignalSection(native_unit="METER/MINUTE"),
        spindle_load_pct=SignalSection(scale=100.0, high=120.0),
        program=SignalSection(publish=False),
    )
    facts = Fact("feed_mm_min", 3.5), Fact("spindle_load_pct", 0.5), Fact("spindle_load_pct", 1.3), Fact("program", "O1")
    _, (one,) = played(own, frame(0, *facts))
    assert shown(one) == [
        ("feed_mm_min", 3500.0, None), ("spindle_load_pct", 50.0, None), ("spindle_load_pct", None, "outside 0 to 120 %: 130"),
    ]  # fmt: skip
    assert one.dropped == {"unmapped": 1}


def test_axes_are_named_by_the_server_and_names_that_are_no_axis_are_left_out() -> None:
    facts = Fact("axis_x_pos_mm", 1.5), Fact("axis_b2_pos_deg", 90.0), Fact("axis_turret_pos_mm", 3.0), Fact("nc_line", "N120")
    _, (one,) = played(config("cnc_40502"), frame(0, *facts))
    assert shown(one) == [("axis_x_pos_mm", 1.5, None), ("axis_b2_pos_deg", 90.0, None), ("nc_line", 120, None)]
    assert {offer.signal for offer in one.offers or ()} == {"axis_x_pos_mm", "axis_b2_pos_deg", "nc_line"}


def tool(index: int, number: int, where: str, at_ms: int | None = None) -> tuple[Fact, ...]:
    fields: dict[str, Plain] = {"ControlIdentifier1": number, "Location/Name": where, "Location/PlaceNumber": index}
    return tuple(Fact(f"tool:{index}:{name.rpartition('/')[2]}", value, "", at_ms) for name, value in fields.items())


def test_the_tool_is_the_one_whose_place_is_the_spindle_and_between_two_there_is_none() -> None:
    moved = lambda index, where, at_ms: Fact(f"tool:{index}:Name", where, "", at_ms)  # noqa: E731
    _, given_ = played(
        config("machinetool_40501"),
        frame(0, *tool(0, 11, "Magazine"), *tool(1, 22, "Main Spindle"), *tool(2, 33, "Magazine")),
        frame(1, moved(1, "Magazine", 1_500)),
        frame(2, moved(2, "Main Spindle", 2_700), Fact("tool:2:PlaceNumber", 1, "", 2_700)),
    )
    assert [shown(one) for one in given_] == [
        [("tool_number", 22, None)], [("tool_number", None, "empty")], [("tool_number", 33, None)],
    ]  # fmt: skip
    assert given_[0].dropped == {"unchanged": 8}
    assert "tool_number" in {offer.signal for offer in given_[0].offers or ()}


def test_two_tools_in_one_spindle_or_none_that_tells_its_place_is_nothing_to_go_by() -> None:
    both = (*tool(0, 11, "Spindle"), *tool(1, 22, "Spindle"))
    _, (one,) = played(config("machinetool_40501"), frame(0, *both))
    assert shown(one) == [("tool_number", None, "no one tool is at the place 'spindle'")]
    _, (one,) = played(config("machinetool_40501"), frame(0, Fact("tool:0:Name", fault="BadNoData")))
    assert one.samples[0].quality is Quality.BAD


def test_a_hole_makes_a_baseline_of_what_comes_with_it() -> None:
    _, (_, one) = played(
        config(), frame(0, Fact("nc_line", 1)), frame(1, Fact("nc_line", 2), holes=(Hole("session lost", 1, 9, 5),))
    )
    assert one.samples[0].is_baseline
    assert one.gaps[0].lost == 5


def test_an_edge_that_was_away_knows_until_when_it_had_everything() -> None:
    cursor, _ = played(config(), frame(0, Fact("nc_line", 1)))
    kept = place(cursor)
    assert kept is not None
    _, one = parse(config(), resume(config(), kept), frame(9, Fact("nc_line", 2), life="b"))
    assert one.gaps[0].reason == "edge restarted"
    assert one.samples[0].is_baseline


_plain = st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False) | st.text(max_size=8)
_keys = st.sampled_from(
    [
        "tool_number",
        "exec_state",
        "nc_block",
        "spindle_rpm",
        "axis_x_pos_mm",
        "tool:0:Name",
        "tool:x:y",
        "tool:1:",
        "event",
        "events",
        "refresh",
        "tool_life",
        "tool_life_used_min",
        "alarm",
    ]
)


@settings(max_examples=40)
@given(
    st.sampled_from(["sinumerik", "cnc_40502", "machinetool_40501"]),
    st.lists(
        st.tuples(_keys | st.text(max_size=6), _plain, st.sampled_from(["", "Bad"]), st.none() | st.integers(0, 2**61)),
        max_size=8,
    ),
)
def test_whatever_a_server_says_each_value_is_a_sample_or_a_counted_drop(
    name: str, entries: list[tuple[str, Plain, str, int]]
) -> None:
    _, (one,) = played(config(name), frame(0, *(Fact(*entry) for entry in entries)))
    assert one.received == len(entries)
    assert all(sample.value is not None or sample.reason for sample in one.samples)


@settings(max_examples=40)
@given(
    st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=5), lambda c: st.lists(c, max_size=4), max_leaves=8)
)
def test_json_that_is_no_frame_is_refused_in_words(junk: object) -> None:
    _, one = parse(config(), start(config()), json.dumps({"facts": junk, "holes": junk}).encode())
    assert one.error
    assert not one.samples
