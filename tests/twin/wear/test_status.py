"""The standing of a tool says what it knows, and why it does not know the rest."""

import json

from tests.twin.wear.made_parts import Made, judged
from twin.wear.machine import Wear
from twin.wear.status import status_of
from twin.wear.terms import Terms


def status(wear: Wear, name: str, terms: Terms | None = None):  # type: ignore[no-untyped-def]
    return status_of(name, wear.tools[name], wear, terms or Terms())


def test_before_a_replacement_was_seen_there_is_no_level() -> None:
    found = status(judged(Made(20)), "3")
    assert (found.level_pct, found.left, found.is_fast) == (None, None, None)
    assert "no replacement of tool 3" in found.why_no_level
    assert "no replacement of tool 3" in found.why_not_left


def test_in_the_first_whole_life_parts_left_take_a_configured_limit() -> None:
    assert "no wear_limit_pct" in status(judged(Made(80)), "1").why_not_left
    found = status(judged(Made(80), Terms(wear_limit=0.3)), "1", Terms(wear_limit=0.3))
    assert found.left is not None
    assert "configured" in found.basis


def test_a_tool_with_lives_says_all_and_goes_to_json() -> None:
    found = status(judged(Made(420)), "1")
    row = json.loads(json.dumps(found.document()))
    assert row["parts_left_band"][0] <= row["parts_left"] <= row["parts_left_band"][1]
    assert row["wear_band_pct"][0] <= row["wear_pct"] <= row["wear_band_pct"][1]
    assert "inferred: its load fell" in found.basis
    assert "learned from" in found.basis
    assert found.vibration_pct is not None
