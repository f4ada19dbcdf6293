"""A program as a CAM system's post processor writes it: retraction by SUPA, tolerance, arcs in two planes, modal cycles."""

from pathlib import Path

import pytest

from tests.twin.programs.sinumerik.reading import ends, run
from twin.programs import Arc, Linear, Settings, Spindle, Tolerance, ToolChange, ToolLength, ToolOffset

TEXT = (Path(__file__).parent / "cam.mpf").read_text(encoding="utf-8")
MACHINE = Settings(
    work_offsets_mm={"G54": (100.0, 100.0, -400.0)}, tool_offsets={1: ToolOffset(100.0, 6.0), 2: ToolOffset(120.0, 4.0)}
)


def test_it_is_run_from_end_to_end_with_both_tools_and_their_lengths() -> None:
    moves = run(TEXT, MACHINE)
    assert [move.tool for move in moves if isinstance(move, ToolChange)] == [1, 2]
    assert [move.length_mm for move in moves if isinstance(move, ToolLength)] == [100.0, 0.0, 120.0, 0.0]
    assert [move.contour_mm for move in moves if isinstance(move, Tolerance)] == [0.01]
    assert ends(moves)[-1] == (0.0, 0.0, 0.0)


def test_it_leads_in_on_an_arc_out_of_the_plane_and_goes_on_in_it() -> None:
    arcs = [move for move in run(TEXT, MACHINE) if isinstance(move, Arc)]
    assert [move.plane for move in arcs] == [19, 17, 17]
    assert arcs[0].end_mm == pytest.approx((87.8, 97.5, -310.0))
    assert arcs[0].centre_mm == pytest.approx((87.8, 97.5, -309.4))


def test_its_cycles_drill_and_tap_at_their_places_in_the_machine() -> None:
    moves = run(TEXT, MACHINE)
    drilled = [move.end_mm for move in moves if isinstance(move, Linear) and move.line in (35, 36)]
    assert [z for _, _, z in drilled] == [-280.0, -285.0, -290.0, -295.0] * 2
    assert {x for x, _, _ in drilled} == {110.0, 130.0}
    tapped = [move for move in moves if isinstance(move, Linear) and move.line == 39]
    assert [(move.end_mm[2], move.feed_per_rev_mm) for move in tapped] == [(-295.0, 1.25), (-270.0, 1.25)]
    assert [move.direction for move in moves if isinstance(move, Spindle) and move.line == 39] == [1, -1, 0, 1]
