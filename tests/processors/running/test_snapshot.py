"""Snapshots: floats come back to the last bit, and what is not ours is refused in one clear line."""

import json
import math
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.errors import SnapshotError
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from processors.thermal import PROCESSOR
from tests.processors.streams import birth, data, engine_of, fed


@dataclass(frozen=True, slots=True)
class Everything:
    """Every kind of field that a state may have."""

    number: float
    maybe: float | None
    numbers: tuple[float, ...]
    counts: dict[str, int]
    flag: bool
    text: str


def there_and_back(state: Everything) -> Everything:
    adapter: TypeAdapter[Any] = TypeAdapter(Everything)
    back: Everything = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, state))))
    return back


@given(st.builds(Everything))
def test_a_state_comes_back_to_the_last_bit(state: Everything) -> None:
    assert repr(there_and_back(state)) == repr(state)


def test_nan_infinity_and_minus_zero_come_back() -> None:
    back = there_and_back(Everything(math.nan, math.inf, (-math.inf, -0.0, 5e-324, 0.1), {"x": 2**70}, True, "ä"))
    assert math.isnan(back.number)
    assert back.maybe == math.inf
    assert math.copysign(1.0, back.numbers[1]) == -1.0
    assert back.numbers[2:] == (5e-324, 0.1)


def _running() -> Engine:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    fed(engine, birth(0.0, spindle_rpm=5000.0, spindle_load_pct=30.0), data(33.3, spindle_rpm=5001.0))
    return engine


def _broken(**changes: Any) -> bytes:
    return json.dumps(json.loads(_running().snapshot("okuma")) | changes).encode()


def _broken_state(state: Any) -> bytes:
    document = json.loads(_running().snapshot("okuma"))
    document["live"]["state"] = state
    return json.dumps(document).encode()


def _broken_lane(**changes: Any) -> bytes:
    document = json.loads(_running().snapshot("okuma"))
    document["live"]["machines"]["okuma"] |= changes
    return json.dumps(document).encode()


@pytest.mark.parametrize(
    ("payload", "culprit"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b"[]", "no JSON object with a unit"),
        (_running().snapshot("okuma")[:-20], "not JSON"),
        (_broken(version=99), "format, processor, version are"),
        (_broken(format=99), "format, processor, version are"),
        (_broken(processor="mirror"), "format, processor, version are"),
        (_broken(live=None), "TypeError"),
        (_broken_state({}), "another form"),
        (_broken_state({"at_s": "noon"}), "state: at_s"),
        (_broken_lane(clock_ms="noon"), "no whole number"),
        (_broken_lane(row={"spindle_rpm": [1.0]}), "ValueError"),
        (_broken_lane(row={"spindle_rpm": [1.0, 0, 77, None, None]}), "77 is not a valid Quality"),
    ],
)
def test_a_snapshot_that_is_not_ours_is_refused_and_counted(payload: bytes, culprit: str) -> None:
    engine = engine_of(PROCESSOR)
    with pytest.raises(SnapshotError, match=culprit) as caught:
        engine.restore(payload)
    assert "\n" not in str(caught.value)
    assert engine.counts.snapshots_rejected == 1
    assert engine.machines == ()
    fed(engine, birth(0.0, spindle_rpm=1.0, spindle_load_pct=1.0))  # and goes on with a fresh state
    assert engine.ledger.emitted == 1


@given(st.binary(max_size=40))
def test_no_payload_crashes_a_restore(payload: bytes) -> None:
    with pytest.raises(SnapshotError):
        engine_of(PROCESSOR).restore(payload)


def test_a_signal_that_is_not_offered_any_more_after_a_restart_is_withdrawn() -> None:
    """The snapshot says who owned it: else its last value would hold for good."""
    before, whole, after = engine_of(PROCESSOR), engine_of(PROCESSOR), engine_of(PROCESSOR)
    opening = birth(0.0, spindle_rpm=5000.0, spindle_load_pct=40.0, ambient_temp_c=20.0, spindle_temp_c=25.0)
    fed(before, opening)
    fed(whole, opening)
    after.restore(before.snapshot("okuma"))
    again = [birth(5.0, spindle_rpm=5000.0, spindle_load_pct=40.0, ambient_temp_c=20.0), data(7.5, spindle_rpm=5100.0)]
    for engine in (whole, after):
        fed(engine, *again)
        lane = engine.lane_of("okuma")
        assert lane is not None
        assert lane.row["spindle_temp_c"].reason == "not offered any more"
        assert lane.emission.latest["twin/spindle_temp_residual_k"].value is None
