"""SHDR lines, stamps, values: bytes of an adapter to observations."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.standins.mtconnect_agent.data_set import changes, merged, parse_data_set
from cnctwin.standins.mtconnect_agent.shdr import LINE_CHARS_MAX, Command, Entry, Line, Unusable, entries, parse_line, parse_lines
from cnctwin.standins.mtconnect_agent.stamp import microsecond_text, read_stamp, stamp_text
from cnctwin.standins.mtconnect_agent.units import conversion
from tests.cnctwin.standins.mtconnect_agent.small_machine import at, fetch, observations, played, values


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("2022-08-08T13:51:34Z", 1659966694.0),
        ("2022-08-08T13:51:34.5Z", 1659966694.5),
        ("2022-08-08T13:51:34.7167146Z", 1659966694.7167146),
        ("2022-08-08T13:51:34.716714612", 1659966694.716714612),
        ("2022-08-08 13:51:34Z", None),
        ("2022-13-08T13:51:34Z", None),
        ("2022-08-08T13:51:34.Z", None),
        ("20175", None),
        ("", None),
    ],
)
def test_stamps_have_up_to_nine_digits(text: str, seconds: float | None) -> None:
    stamp = read_stamp(text)
    assert (stamp.seconds if stamp else None) == pytest.approx(seconds)


@given(st.integers(0, 4_000_000_000_000_000))
def test_a_stamp_we_write_is_one_we_read(microseconds: int) -> None:
    stamp = read_stamp(stamp_text(microseconds / 1e6))
    assert stamp is not None
    assert stamp.seconds == pytest.approx(microseconds / 1e6, abs=2e-6)
    assert microsecond_text(stamp.text) == stamp.text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("20175", Unusable("truncated", "20175")),
        ("2017-02-01T13:59:35Z|Block_Number", Unusable("truncated", "2017-02-01T13:59:35Z|Block_Number")),
        ("yesterday|Block_Number|12", Unusable("bad_stamp", "yesterday|Block_Number|12")),
        ("* PONG 10000", Command("* PONG 10000")),
    ],
)
def test_a_line_that_is_no_observation_says_why(text: str, expected: object) -> None:
    assert parse_line(text) == expected


def test_a_line_without_end_is_refused() -> None:
    assert parse_line("2017-02-01T13:59:35Z|a|" + "x" * LINE_CHARS_MAX)[0] == "line_too_long"


def test_an_escaped_bar_is_part_of_the_value() -> None:
    line = parse_line(r'2017-02-01T13:59:35Z|block|"G1 \| G2"|next|1')
    assert isinstance(line, Line)
    assert line.fields == ("block", "G1 | G2", "next", "1")


def test_a_multiline_asset_is_one_line() -> None:
    parsed = list(parse_lines(["2024-05-01T12:00:00Z|@ASSET@|1|T|--multiline--AB", "<T>", "</T>", "--multiline--AB", "x"]))
    assert isinstance(parsed[0], Line)
    assert parsed[0].fields == ("@ASSET@", "1", "T", "<T>\n</T>")
    assert parsed[1] == Unusable("truncated", "x")


def test_a_multiline_asset_that_never_ends_is_truncated() -> None:
    parsed = list(parse_lines(["2024-05-01T12:00:00Z|@ASSET@|1|T|--multiline--AB", "<T>"]))
    assert [p[0] for p in parsed] == ["truncated"]


def test_a_condition_takes_five_values_even_if_nobody_knows_it() -> None:
    assert list(entries(("cond", "Normal", "", "", "", ""), lambda _: 0)) == [Entry("cond", ("Normal", "", "", "", ""))]
    assert list(entries(("a", "1", "b"), lambda _: 1)) == [Entry("a", ("1",)), Entry("b", ())]


@given(st.text(max_size=200))
def test_no_text_crashes_the_parser(text: str) -> None:
    for line in parse_lines(text.split("\n")):
        assert isinstance(line, Line | Command | Unusable)


@pytest.mark.parametrize(
    ("native", "units", "value", "expected"),
    [
        ("INCH", "MILLIMETER", 2.0, 50.8),
        ("MILLIMETER/MINUTE", "MILLIMETER/SECOND", 5.0, 0.0833333333333333),
        ("REVOLUTION/SECOND", "REVOLUTION/MINUTE", 10.0, 600.0),
        ("RADIAN", "DEGREE", 3.141592653589793, 180.0),
        ("FAHRENHEIT", "CELSIUS", 212.0, 100.0),
        ("METER/SECOND^2", "MILLIMETER/SECOND^2", 1.0, 1000.0),
        ("KILOWATT", "WATT", 1.5, 1500.0),
    ],
)
def test_native_units_are_converted(native: str, units: str, value: float, expected: float) -> None:
    found = conversion(native, units)
    assert found is not None
    assert found.apply(value) == pytest.approx(expected)


@pytest.mark.parametrize("native", [None, "MILLIMETER", "FURLONG"])
def test_equal_and_unknown_units_are_left_alone(native: str | None) -> None:
    assert conversion(native, "MILLIMETER") is None


_SETS = st.dictionaries(st.sampled_from("abcd"), st.sampled_from(["1", "2", None]))


@given(_SETS, _SETS)
def test_the_changes_of_a_set_lead_to_the_same_set(old: dict[str, str | None], new: dict[str, str | None]) -> None:
    known = merged({}, old)
    assert merged(known, changes(known, new)) == merged(known, new)


def test_a_table_has_cells() -> None:
    assert parse_data_set("G54={X=1 Y=2} G55", is_table=True) == {"G54": {"X": "1", "Y": "2"}, "G55": None}


def test_each_kind_of_value_becomes_its_element(tmp_path: Path) -> None:
    lines = [
        at(0, "Xpos|2|X_LOAD_RAW|12.50|exec|active|tool|"),
        at(1, "place|1 2.0 3"),
        at(2, "msg|M17|tool broken"),
        at(3, "vars|a=1 b={two words}"),
        at(4, "vars|a=1 b"),
        at(5, "offsets|G54={X=1 Y=2}"),
        at(6, "wave|3|100|1 2 3"),
        at(7, "VMC-3:exec|READY"),
        at(8, "Xload|none"),
    ]
    agent = played(tmp_path, lines)
    with agent:
        text = fetch(agent, "/VMC-3/sample?count=1000")
    assert values(text, "xp") == ["UNAVAILABLE", "50.8"]
    assert values(text, "xl") == ["UNAVAILABLE", "12.5", "UNAVAILABLE"]  # what is no number is no sample
    assert values(text, "exec") == ["UNAVAILABLE", "ACTIVE", "READY"]
    assert values(text, "tool") == ["UNAVAILABLE", None]  # empty, and not UNAVAILABLE
    assert values(text, "place") == ["UNAVAILABLE", "1 2 3"]
    assert values(text, "cm") == ["SPINDLE"]
    found = {o.get("dataItemId"): o for o in observations(text)}
    assert (found["msg"].tag, found["msg"].text, found["msg"].get("nativeCode")) == ("Message", "tool broken", "M17")
    assert (found["wave"].tag, found["wave"].text, found["wave"].get("sampleRate")) == ("LoadTimeSeries", "1 2 3", "100")
    assert found["vars"].tag == "VariableDataSet"
    assert [(e.get("key"), e.get("removed"), e.text) for e in found["vars"]] == [("b", "true", None)]
    assert [(c.get("key"), c.text) for c in found["offsets"].iter("Cell")] == [("X", "1"), ("Y", "2")]


def test_agent_1_4_hands_on_stamps_and_numbers_as_they_are(tmp_path: Path) -> None:
    lines = ["2024-05-01T12:00:00.1234567Z|Xload|12.50", "2024-05-01T12:00:01.1200000Z|Xload|", at(2, "Xpos|2")]
    agent = played(tmp_path, lines, style="1.4")
    with agent:
        text = fetch(agent, "/sample")
    assert values(text, "xl") == ["UNAVAILABLE", "12.50", None]
    assert values(text, "xp") == ["UNAVAILABLE", "50.8"]  # a conversion is a conversion
    stamps = [o.get("timestamp") for o in observations(text) if o.get("dataItemId") == "xl"]
    assert stamps[1:] == ["2024-05-01T12:00:00.1234567Z", "2024-05-01T12:00:01.1200000Z"]
