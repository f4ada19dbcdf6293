"""Cut records: what is read of them, and what is said of those that can't be."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.wear.cut import RECORD_MAX, Cut, cut_of

RECORD = {
    "version": 1, "program": "O1", "tool": 3, "operation": "O1|T3|1", "part": 7, "ended_s": 9.0, "duration_s": 31.0,
    "duration_ratio": 1.0, "load_ratio": 1.1, "load_ratio_sd": 0.02, "vibration_ratio": None, "feed_ratio": 1.0,
    "parts_known": 12, "reference": "twin", "is_alarmed": True,
}  # fmt: skip


def with_(**changes: Any) -> str:
    return json.dumps({**RECORD, **changes})


def test_a_record_is_read() -> None:
    assert cut_of(with_()) == Cut("O1", 3, "O1|T3|1", 7, 9.0, 1.1, 0.02, None, "twin", True)


@pytest.mark.parametrize("ratio", [None, 0.0, 1000.0, "1.1", True, -1.0])
def test_a_ratio_that_can_be_no_wear_is_not_known(ratio: Any) -> None:
    cut = cut_of(with_(load_ratio=ratio))
    assert isinstance(cut, Cut)
    assert cut.load_ratio is None


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "not JSON"),
        ("[1]", "not a JSON object"),
        (with_(version=2), "version 2"),
        (with_(tool=None), "lacks its tool"),
        (with_(part=1.5), "lacks its tool, part or end"),
        (with_(ended_s=1e300), "lacks its tool, part or end"),
        (with_(program="O" * RECORD_MAX), "characters"),
        ("[" * 3000, "not JSON"),
    ],
)
def test_what_is_no_record_is_said(text: str, reason: str) -> None:
    assert reason in str(cut_of(text))


@given(st.dictionaries(st.sampled_from(sorted(RECORD)), st.none() | st.booleans() | st.floats() | st.integers() | st.text()))
def test_no_record_crashes_it(changes: dict[str, Any]) -> None:
    assert isinstance(cut_of(with_(**changes)), Cut | str)
