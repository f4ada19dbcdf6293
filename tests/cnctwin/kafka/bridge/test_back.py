"""The twin devices that a bridge gives birth to when it begins, by the states of their units."""

import json

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.bridge.back import _declared
from processors.discovery import discover
from processors.partition.seat import Seat
from tests.processors.streams import birth, data

THERMAL = discover()["thermal"]
GARBAGE = (
    b"",
    b"\xff garbage",
    b"7\n8",
    b"{}\n{}",
    b"[" * 100_000,
    b'{"machines":{}}\n{"live":{"machines":{"okuma":{"latest":{}}}}}',
)


def test_states_that_cannot_be_read_keep_no_other_from_being_told(caplog: pytest.LogCaptureFixture) -> None:
    seat = Seat(THERMAL, THERMAL.configured({}), lambda _: True)
    for event in (birth(0.0, spindle_rpm=0.0, ambient_temp_c=21.0), data(1.0, spindle_rpm=100.0)):
        seat.event(event, 0.0)
    state = seat.state_of("okuma")
    kept = {f"thermal/{number}": payload for number, payload in enumerate(GARBAGE)}
    assert json.loads(state.partition(b"\n")[2])["unit"] == "okuma"
    found = list(_declared(kept | {"hello": b"world", "thermal/okuma": state, "~marker/x": b"garbage"}))
    assert [(machine, name, declared.machine) for machine, name, declared in found] == [("okuma", "thermal", "okuma")]
    assert len(caplog.messages) == len(GARBAGE) + 1 and all("cannot read its state" in line for line in caplog.messages)
