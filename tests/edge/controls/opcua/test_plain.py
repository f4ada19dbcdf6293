"""One DataValue, one fact."""

import math
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("asyncua")

from asyncua import ua

from edge.controls.opcua import plain
from edge.sweep import Fact, Sweep

AT: Any = datetime.fromisoformat("2026-11-21T12:00:00.250")
AT_MS = 1_795_262_400_250


@pytest.mark.parametrize(
    ("value", "element", "expected"),
    [
        (7, None, (7, "")),
        (True, None, (True, "")),
        (2.5, None, (2.5, "")),
        ("G1 X5", None, ("G1 X5", "")),
        (ua.LocalizedText("stop"), None, ("stop", "")),
        (ua.ServerState.Running, None, (0, "")),
        ([3], None, (3, "")),
        (["a", "b", "c"], 1, ("b", "")),
        (["a"], 1, (None, "an array of 1 values has no element 1")),
        ([1, 2], None, (None, "an array of 2 values, of which none is named")),
        ([], None, (None, "an array of 0 values, of which none is named")),
        (None, None, (None, "no value")),
        (math.nan, None, (None, "not a finite number: nan")),
        (b"\x00", None, (None, "bytes is no plain value")),
        (ua.EUInformation(), None, (None, "EUInformation is no plain value")),
        ("x" * 9000, None, (None, "text of 9000 characters")),
    ],
)
def test_a_value_is_plain_or_a_fault_says_what_it_is(value: object, element: int | None, expected: tuple[object, str]) -> None:
    kind: Any = ua.VariantType.Int64 if value == [] else None
    fact = plain.as_fact("k", ua.DataValue(ua.Variant(value, kind), SourceTimestamp=AT), element=element)
    assert (fact.value, fact.fault, fact.t_ms) == (*expected, AT_MS)


@pytest.mark.parametrize(("kind", "told"), [("Float", 12.3), ("Double", 12.300000190734863)])
def test_a_value_of_32_bits_is_told_as_the_control_shows_it(kind: str, told: float) -> None:
    value = ua.Variant(12.300000190734863, ua.VariantType[kind])
    assert plain.as_fact("k", ua.DataValue(value, SourceTimestamp=AT)).value == told


@pytest.mark.parametrize(
    ("code", "fault", "ran_over"),
    [
        (0, "", False),
        (0x0480, "", True),
        (0x0400, "", False),
        (0x0080, "", False),  # the bit counts only where the info type says that it is of a value
        (0x808C0000, "BadSensorFailure", False),
        (0x808C0480, "BadSensorFailure", True),
        (0x40900000, "UncertainLastUsableValue", False),
        (0x8FFF0000, "Bad 0x8FFF0000", False),
        (0xC0000000, "Bad 0xC0000000", False),
    ],
)
def test_a_status_that_is_not_good_is_a_fault_and_the_overflow_bit_is_seen_in_any(code: int, fault: str, ran_over: bool) -> None:
    value = ua.DataValue(ua.Variant(5), ua.StatusCode(ua.UInt32(code)))
    fact = plain.as_fact("k", value)
    assert (fact.value, fact.fault) == ((None, fault) if fault else (5, ""))
    assert plain.overflowed(value) is ran_over


def test_the_sources_stamp_counts_the_servers_where_there_is_none_or_where_it_is_wanted() -> None:
    later: Any = AT + timedelta(seconds=1)
    both = ua.DataValue(ua.Variant(1), SourceTimestamp=AT, ServerTimestamp=later)
    assert plain.as_fact("k", both).t_ms == AT_MS
    assert plain.as_fact("k", both, stamps="server").t_ms == AT_MS + 1000
    assert plain.as_fact("k", ua.DataValue(ua.Variant(1), ServerTimestamp=later)).t_ms == AT_MS + 1000
    never: Any = datetime.fromisoformat("1601-01-01")
    assert plain.as_fact("k", ua.DataValue(ua.Variant(1), SourceTimestamp=never)).t_ms is None
    assert plain.stamps_apart_ms(both) == 1000
    assert plain.stamp_ms(AT.replace(tzinfo=timezone(timedelta(hours=1)))) == AT_MS - 3_600_000
    assert plain.stamp_ms(AT.replace(tzinfo=UTC)) == AT_MS


@settings(max_examples=40)
@given(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats()
    | st.text()
    | st.binary()
    | st.lists(st.integers(0, 9), max_size=3),
    st.integers(0, 2**32 - 1),
    st.none() | st.datetimes(datetime.fromisoformat("1601-01-01"), datetime.fromisoformat("9999-01-01")),
)
def test_whatever_a_server_sends_fits_into_a_frame(value: object, code: int, stamp: Any) -> None:
    fact = plain.as_fact("k", ua.DataValue(ua.Variant(value) if value != [] else None, ua.StatusCode(ua.UInt32(code)), stamp))
    assert Sweep.decode(Sweep("a", 0, 1, (fact,)).encode()).facts == (Fact(*fact),)
