"""One native text, one canonical value."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.errors import ConfigError
from edge.reading import TEXT_LENGTH_MAX, Target, Value, read, read_value, shortest_of_float32
from edge.signals import signal
from edge.units import between, conversion
from sparkplug.quality import Quality
from twin.vocabulary.signals import SIGNALS

GOOD, BAD = Quality.GOOD, Quality.BAD


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("tool_number", "7.000000", (7, GOOD, None)),
        ("tool_number", "2201", (2201, GOOD, None)),
        ("tool_number", "", (None, GOOD, "empty")),
        ("tool_number", "T12A", (None, BAD, "not a number: 'T12A'")),
        ("tool_number", "7.5", (None, BAD, "not a whole number: 7.5")),
        ("nc_line", "99999999999999999999", (None, BAD, "not a whole number: 1e+20")),
        ("spindle_rpm", "1e3", (1000.0, GOOD, None)),
        ("spindle_rpm", "-.5", (-0.5, GOOD, None)),
        ("spindle_rpm", "NaN", (None, BAD, "not a number: 'NaN'")),
        ("spindle_rpm", "inf", (None, BAD, "not a number: 'inf'")),
        ("spindle_rpm", "1_000", (None, BAD, "not a number: '1_000'")),
        ("spindle_rpm", "１２", (None, BAD, "not a number: '１２'")),
        ("spindle_rpm", "1 2 3", (None, BAD, "not a number: '1 2 3'")),
        ("spindle_rpm", "1e999", (None, BAD, "not a finite number: inf")),
        ("spindle_rpm", "60001", (None, BAD, "outside -60000 to 60000 rev/min: 60001")),
        ("spindle_temp_c", "0", (None, BAD, "outside 1 to 150 °C: 0")),
        ("exec_state", "active", ("ACTIVE", GOOD, None)),
        ("exec_state", "DANCING", (None, BAD, "no word of the vocabulary: 'DANCING'")),
        ("controller_mode", "MDI", ("MANUAL_DATA_INPUT", GOOD, None)),
        ("coolant_on", "ON", (True, GOOD, None)),
        ("coolant_on", "INACTIVE", (False, GOOD, None)),
        ("coolant_on", "perhaps", (None, BAD, "neither on nor off: 'perhaps'")),
        ("program", "", ("", GOOD, None)),
        ("program", "x" * (TEXT_LENGTH_MAX + 1), (None, BAD, "text of 8193 characters")),
        ("program", "UNAVAILABLE", (None, BAD, "unavailable")),
    ],
)
def test_texts_become_values_or_reasons(name: str, text: str, expected: object) -> None:
    known = signal(name)
    assert read(Target("x", name, low=known.low, high=known.high), text) == expected


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("tool_number", 7, (7, GOOD, None)),
        ("tool_number", 7.0, (7, GOOD, None)),
        ("tool_number", 0, (0, GOOD, None)),
        ("tool_number", "", (None, GOOD, "empty")),
        ("tool_number", None, (None, BAD, "unavailable")),
        ("tool_number", 7.5, (None, BAD, "not a whole number: 7.5")),
        ("tool_number", True, (None, BAD, "not a number: True")),
        ("nc_line", 2**53 + 1, (2**53 + 1, GOOD, None)),
        ("nc_line", 2**63, (None, BAD, "not a whole number of 64 bits")),
        ("spindle_rpm", 1000, (1000.0, GOOD, None)),
        ("spindle_rpm", -0.5, (-0.5, GOOD, None)),
        ("spindle_rpm", "1e3", (1000.0, GOOD, None)),
        ("spindle_rpm", math.nan, (None, BAD, "not a finite number: nan")),
        ("spindle_rpm", -math.inf, (None, BAD, "not a finite number: -inf")),
        ("spindle_rpm", 10**400, (None, BAD, "not a finite number: above 1e300")),
        ("spindle_rpm", 60001, (None, BAD, "outside -60000 to 60000 rev/min: 60001")),
        ("spindle_rpm", False, (None, BAD, "not a number: False")),
        ("exec_state", "active", ("ACTIVE", GOOD, None)),
        ("exec_state", 3, (None, BAD, "no word of the vocabulary: '3'")),
        ("program", 1234, ("1234", GOOD, None)),
        ("program", True, (None, BAD, "not a text: True")),
        ("coolant_on", True, (True, GOOD, None)),
        ("coolant_on", 0, (False, GOOD, None)),
        ("coolant_on", "ON", (True, GOOD, None)),
        ("coolant_on", 255, (None, BAD, "neither on nor off: 255")),
    ],
)
def test_typed_values_become_values_or_reasons(name: str, value: Value, expected: object) -> None:
    known = signal(name)
    found = read_value(Target("x", name, low=known.low, high=known.high), value)
    assert found == expected
    assert type(found[0]) is type(expected[0])


@pytest.mark.parametrize(
    ("native", "canonical", "value", "expected"),
    [
        ("INCH/MINUTE", "mm/min", 10, 254),
        ("MILLIMETER/SECOND", "mm/min", 2, 120),
        ("FOOT/MINUTE", "mm/min", 1, 304.8),
        ("INCH", "mm", 2, 50.8),
        ("RADIAN", "deg", math.pi, 180),
        ("REV/SECOND", "rev/min", 2, 120),
        ("DEGREE/SECOND", "rev/min", 360, 60),
        ("RADIAN/SECOND", "rev/min", 2 * math.pi, 60),
        ("FAHRENHEIT", "°C", 212, 100),
        ("KELVIN", "°C", 273.15, 0),
        ("WATT", "kW", 1500, 1.5),
        ("RATIO", "%", 0.5, 50),
        ("METER/SECOND^2", "g", 9.80665, 1),
        ("mm/min", "mm/min", 3, 3),
        ("", "mm/min", 3, 3),
    ],
)
def test_units_are_converted(native: str, canonical: str, value: float, expected: float) -> None:
    assert conversion(native, canonical).apply(value) == pytest.approx(expected)


def test_a_unit_that_is_not_known_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match="native unit 'FURLONG' cannot become mm; it may be MILLIMETER, INCH"):
        conversion("FURLONG", "mm")


@pytest.mark.parametrize(
    ("native", "wanted", "value", "expected"),
    [
        ("MILLIMETER/SECOND", "mm/min", 2, 120),
        ("m/min", "mm/min", 1.5, 1500),
        ("INCH", "mm", 2, 50.8),
        ("psi", "bar", 145.0377377, 10),
        ("°F", "°C", 212, 100),
        ("CELSIUS", "°F", 100, 212),
        ("WATT", "kW", 1500, 1.5),
        ("1/min", "rev/s", 120, 2),
        ("", "mm", 3, 3),
        ("mm", "", 3, 3),
        ("strokes", "strokes", 3, 3),
        ("strokes", "bar", 3, 3),  # it is not known, so nobody can say that it is wrong
    ],
)
def test_what_a_control_states_becomes_the_unit_that_a_configuration_wants(
    native: str, wanted: str, value: float, expected: float
) -> None:
    assert between(native, wanted).apply(value) == pytest.approx(expected)


def test_a_unit_of_another_quantity_is_refused_with_both() -> None:
    with pytest.raises(ConfigError, match="MILLIMETER is a length and bar a pressure"):
        between("MILLIMETER", "bar")


@given(st.sampled_from(sorted(SIGNALS)), st.text(max_size=40) | st.floats().map(repr))
def test_any_text_gives_a_value_of_the_right_type_or_a_null_with_a_reason(name: str, text: str) -> None:
    known = signal(name)
    value, quality, reason = read(Target("x", name, 60.0, low=known.low, high=known.high), text)
    if value is None:
        assert reason
    else:
        assert quality is GOOD
        assert not isinstance(value, float) or math.isfinite(value)


@given(st.sampled_from(sorted(SIGNALS)), st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20))
def test_any_typed_value_gives_a_value_of_the_right_type_or_a_null_with_a_reason(name: str, native: Value) -> None:
    known = signal(name)
    value, quality, reason = read_value(Target("x", name, 60.0, low=known.low, high=known.high), native)
    if value is None:
        assert reason
    else:
        assert quality is GOOD
        assert not isinstance(value, float) or math.isfinite(value)


def test_a_name_that_is_not_canonical_is_refused() -> None:
    with pytest.raises(ConfigError, match="'spindle_speed' is no canonical name"):
        signal("spindle_speed")


@pytest.mark.parametrize(
    ("native", "factor", "told"), [(3.0, 0.1, 0.3), (1.06215333333333, 60.0, 63.7292), (0.1 + 0.2, 1.0, 0.1 + 0.2)]
)
def test_what_a_conversion_adds_of_binary_noise_is_not_published(native: float, factor: float, told: float) -> None:
    assert read_value(Target("x", "plc_pressure", factor), native)[0] == told


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_value_of_32_bits_becomes_a_short_decimal_that_is_still_the_same_value(native: float) -> None:
    short = shortest_of_float32(native)
    assert struct.pack("<f", short) == struct.pack("<f", native)
    assert len(repr(short).replace("-", "").partition("e")[0].replace(".", "").strip("0")) <= 9
