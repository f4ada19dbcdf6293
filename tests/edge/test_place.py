"""An edge that was killed goes on where it was; what the agent has no more is a hole that is counted."""

from pathlib import Path

import pytest

from edge.controls.mtconnect.cursor import next_request, place, resume, start
from edge.controls.mtconnect.state import Phase
from edge.place import EDGE_RESTARTED, Place, PlaceFile
from edge.sample import Drop
from tests.edge.controls.mtconnect.agent_documents import CONFIG, fed, probe, streams, value, values

WAS_AT = Place("1", 10)
SHOWN = [value("rpm", 3, "100"), value("tool", 14, "8")]  # what /current shows: the tool has changed since


def test_there_is_no_place_before_the_first_baseline() -> None:
    cursor = start(CONFIG)
    assert place(cursor) is None
    cursor, _ = fed(probe(), cursor=cursor)
    assert place(cursor) is None
    cursor, _ = fed(streams(10, [value("rpm", 3, "100")]), cursor=cursor)
    assert place(cursor) == WAS_AT


def test_a_restarted_edge_learns_the_values_and_goes_on_where_it_was() -> None:
    cursor, frame = fed(probe(), streams(15, SHOWN), cursor=resume(CONFIG, WAS_AT))
    assert values(frame) == [("spindle_rpm", 100.0)]
    assert all(sample.is_baseline for sample in frame.samples)
    assert (frame.gaps, frame.dropped, frame.accounted()) == ((), {Drop.DUPLICATE: 1}, True)
    assert dict(next_request(CONFIG, cursor).parameters)["from"] == 10
    _, frame = fed(streams(15, [value("tool", 11), value("tool", 14, "8")]), cursor=cursor)
    assert values(frame) == [("tool_number", None), ("tool_number", 8)], "nothing of what came in between is missing"


def test_what_the_agent_dropped_while_the_edge_was_away_is_a_hole() -> None:
    cursor, frame = fed(probe(), streams(50, SHOWN, first=12), cursor=resume(CONFIG, WAS_AT))
    assert values(frame) == [("spindle_rpm", 100.0), ("tool_number", 8)]
    assert [(gap.reason, gap.first_sequence, gap.last_sequence, gap.lost) for gap in frame.gaps] == [(EDGE_RESTARTED, 10, 49, 39)]
    assert (cursor.phase, cursor.next_sequence, frame.accounted()) == (Phase.SAMPLE, 50, True)


def test_an_agent_that_was_restarted_meanwhile_is_a_hole_too() -> None:
    cursor, frame = fed(probe(instance=2), streams(15, SHOWN, instance=2), cursor=resume(CONFIG, WAS_AT))
    assert values(frame) == [("spindle_rpm", 100.0), ("tool_number", 8)]
    assert [gap.reason for gap in frame.gaps] == ["agent restarted: instance 1 ended somewhere after sequence 9"]
    assert cursor.next_sequence == 15


def test_a_place_comes_back_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "new" / "edge.place"
    assert PlaceFile(file).read() is None
    PlaceFile(file).keep(WAS_AT)
    assert PlaceFile(file).read() == WAS_AT
    PlaceFile(None).keep(WAS_AT)
    assert PlaceFile(None).read() is None


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"instance": 1, "next_sequence": 2}', '{"instance": "1", "next_sequence": null}']
)
def test_a_file_that_says_nothing_is_no_place(text: str, tmp_path: Path) -> None:
    file = tmp_path / "edge.place"
    file.write_text(text)
    assert PlaceFile(file).read() is None


def test_a_disk_that_takes_nothing_is_told_once_and_ends_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("")
    places = PlaceFile(tmp_path / "file" / "edge.place")
    places.keep(WAS_AT)
    places.keep(Place("1", 11))
    assert len(caplog.records) == 1
