"""The clock of an MTConnect agent: in the header of each document, which comes one way."""

import pytest

from edge.clock import offset as clock
from edge.sample import ClockReading
from tests.edge.controls.mtconnect.agent_documents import error, fed, probe, streams, value

NEW_YEAR_MS = 1_767_225_600_000


@pytest.mark.parametrize(
    ("text", "control_ms", "resolution_ms"),
    [
        ("2026-01-01T00:00:07Z", NEW_YEAR_MS + 7000, 1000),
        ("2026-01-01T00:00:07.25Z", NEW_YEAR_MS + 7250, 10),
        ("2026-01-01T00:00:07.1234567Z", NEW_YEAR_MS + 7123, 1),
        ("2026-01-01T00:00:07.000Z", NEW_YEAR_MS + 7000, 1000),
        ("2026-01-01T09:00:07+09:00", NEW_YEAR_MS + 7000, 1000),
    ],
)
def test_each_document_tells_the_agents_clock_as_fine_as_it_is_written(text: str, control_ms: int, resolution_ms: int) -> None:
    document = streams(10, [value("rpm", 3, "100")]).replace(b"2026-01-01T00:00:00Z", text.encode())
    _, frame = fed(probe(), document)
    assert frame.clock == ClockReading(control_ms, 0, 500, resolution_ms, stamps_samples=True)


@pytest.mark.parametrize("document", [streams(10).replace(b"2026-01-01T00:00:00Z", b"noon"), error("OUT_OF_RANGE"), b"<html/>"])
def test_a_document_without_a_readable_time_says_nothing_of_the_clock(document: bytes) -> None:
    assert fed(probe(), document)[1].clock is None


@pytest.mark.parametrize("offset_s", [0, 90, -3600])
def test_heartbeats_alone_give_the_offset_within_its_spread(offset_s: int) -> None:
    """Documents without news, every 1.9 s, made in whole seconds and 30 ms old on arrival."""
    cursor, _ = fed(probe(), streams(10))
    state = clock.State()
    for number in range(60):
        made_ms = NEW_YEAR_MS + 1900 * number
        second = (made_ms // 1000 + offset_s) % 60
        minute = (made_ms // 1000 + offset_s) // 60
        text = f"{_day(minute)}T{minute // 60 % 24:02d}:{minute % 60:02d}:{second:02d}Z"
        cursor, frame = fed(streams(10).replace(b"2026-01-01T00:00:00Z", text.encode()), cursor=cursor)
        state = clock.step(state, clock.heard(frame, 5.0 + 1.9 * number, made_ms + 30.0)).state
    assert state.published is not None
    assert state.published.bound is not None
    assert abs(state.published.bound.offset_s - offset_s) <= state.published.bound.spread_s < 0.6
    assert state.published.method == "times of documents"


def _day(minute: int) -> str:
    return "2026-01-01" if minute >= NEW_YEAR_MS // 60_000 else "2025-12-31"
