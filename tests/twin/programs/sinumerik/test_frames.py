"""Offsets and frames: where a point of the program lies in the machine, by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.twin.programs.sinumerik.reading import ends, only_arc, run
from twin.errors import PartProgramError
from twin.programs import Arc, Settings, ToolOffset

OFFSETS = Settings(
    work_offsets_mm={"G54": (100.0, 200.0, 300.0), "G505": (10.0, 20.0, 30.0), "external": (1.0, 2.0, 3.0)},
    tool_offsets={1: ToolOffset(50.0, 5.0)},
)


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("G0 X1 Y2 Z3", (2.0, 4.0, 6.0)),
        ("G54 G0 X1 Y2 Z3", (102.0, 204.0, 306.0)),
        ("G505 G0 X1 Y2 Z3", (12.0, 24.0, 36.0)),
        ("G54\nG500 G0 X1 Y2 Z3", (2.0, 4.0, 6.0)),
        ("G54\nG53 G0 X1 Y2 Z3", (2.0, 4.0, 6.0)),
        ("G54\nG153 G0 X1 Y2 Z3", (1.0, 2.0, 3.0)),
        ("G54\nTRANS X500\nSUPA G0 X1 Y2 Z3", (1.0, 2.0, 3.0)),
        ("T1 M6\nSUPA G0 Z3", (0.0, 0.0, 53.0)),  # SUPA leaves the length of the tool in; D0 takes it out.
        ("T1 M6\nSUPA G0 Z3 D0", (0.0, 0.0, 3.0)),
        ("T1 M6\nG54 G0 X0 Y0 Z0", (101.0, 202.0, 353.0)),
        ("G54 TRANS X10 Y20\nG0 X1 Y2", (112.0, 224.0, 0.0)),
        ("$P_UIFR[2,Y,TR]=7\nG55 G0 X1 Y2", (2.0, 11.0, 0.0)),
        ("G74 X1=0 Y1=0", (0.0, 0.0, 0.0)),
    ],
)
def test_offsets_add_up(text: str, end: tuple[float, ...]) -> None:
    assert ends(run(text, OFFSETS))[-1] == end


@pytest.mark.parametrize(
    ("frames", "point", "end"),
    [
        ("TRANS X10 Y20", "X1 Y2", (11.0, 22.0, 0.0)),
        ("TRANS X10\nTRANS Y20", "X1 Y2", (1.0, 22.0, 0.0)),  # An absolute one deletes those before.
        ("TRANS X10\nATRANS Y20", "X1 Y2", (11.0, 22.0, 0.0)),
        ("TRANS X10\nTRANS", "X1 Y2", (1.0, 2.0, 0.0)),
        ("ROT RPL=90", "X10 Y0", (0.0, 10.0, 0.0)),
        ("ROT Z90", "X10 Y0", (0.0, 10.0, 0.0)),
        ("G18\nROT RPL=90", "Z10 X0", (10.0, 0.0, 0.0)),
        ("TRANS X10\nAROT RPL=90", "X5 Y0", (10.0, 5.0, 0.0)),
        ("ROT RPL=90\nATRANS X10", "X5 Y0", (0.0, 15.0, 0.0)),
        ("AROT RPL=45\nAROT RPL=45", "X10 Y0", (0.0, 10.0, 0.0)),
        ("SCALE X2 Y2", "X3 Y4", (6.0, 8.0, 0.0)),
        ("TRANS X10\nASCALE X2", "X3 Y4", (16.0, 4.0, 0.0)),
        ("MIRROR X0", "X3 Y4", (-3.0, 4.0, 0.0)),
        ("TRANS X10\nAMIRROR X0 Y0", "X3 Y4", (7.0, -4.0, 0.0)),
        ("ROT X90", "X1 Y2 Z3", (1.0, -3.0, 2.0)),
        ("ROT Y90", "X1 Y2 Z3", (3.0, 2.0, -1.0)),
        ("ROT Z90 X90", "X1 Y2 Z3", (3.0, 1.0, 2.0)),  # About z, then the new x: (1, -3, 2), turned by 90°.
    ],
)
def test_a_frame_places_a_point(frames: str, point: str, end: tuple[float, ...]) -> None:
    assert ends(run(f"{frames}\nG0 {point}"))[-1] == end


def test_a_mirror_turns_an_arc_and_a_rotation_does_not() -> None:
    plain, mirrored, turned = (
        only_arc(f"{frame}\nG1 X10 Y0 F100\nG3 X0 Y10 I-10 J0") for frame in ("TRANS", "MIRROR X0", "ROT RPL=30")
    )
    assert plain.sweep_rad == pytest.approx(math.pi / 2)
    assert mirrored.sweep_rad == pytest.approx(-math.pi / 2)
    assert turned.sweep_rad == pytest.approx(math.pi / 2)
    assert mirrored.end_mm == pytest.approx((0.0, 10.0, 0.0), abs=1e-9)


def test_a_scaled_arc_has_a_scaled_radius_and_an_ellipse_is_refused() -> None:
    found = only_arc("SCALE X2 Y2\nG1 X10 Y0 F100\nG3 X0 Y10 CR=10")
    assert math.dist(found.centre_mm, found.end_mm) == pytest.approx(20.0)
    with pytest.raises(PartProgramError, match="ellipse"):
        run("SCALE X2\nG1 X10 Y0 F100\nG3 X0 Y10 CR=10")


def test_lines_may_lie_in_a_tilted_frame_and_arcs_corners_and_cycles_may_not() -> None:
    assert ends(run("ROT X90\nG0 Y5")) == [(0.0, 0.0, 5.0)]
    for block in ("G2 X5 CR=5 F100", "G1 X5 RND=1 F100", "CYCLE81(10,0,1,-5)", "G41 G1 X5 F100"):
        with pytest.raises(PartProgramError, match="tilts"):
            run(f"ROT X90\n{block}")


@given(
    st.lists(
        st.sampled_from(["ATRANS X3 Y-4 Z1", "AROT RPL=33", "AROT X20", "AROT Y-71", "ASCALE X2 Y3 Z0.5", "AMIRROR Y0"]),
        max_size=6,
    ),
    st.tuples(*[st.floats(-100.0, 100.0, allow_subnormal=False)] * 3),
)
def test_a_point_comes_back_from_every_chain_of_frames(frames: list[str], point: tuple[float, float, float]) -> None:
    """The point that the frames place in the machine is read back from them as it was."""
    x, y, z = (round(figure, 3) for figure in point)
    text = "\n".join(["G54", *frames, f"G0 X{x:.3f} Y{y:.3f} Z{z:.3f}", "R1=$AA_IW[X] R2=$AA_IW[Y] R3=$AA_IW[Z]"])
    moves = run(f"{text}\nTRANS\nG500 G0 X=R1 Y=R2 Z=R3", Settings(work_offsets_mm={"G54": (5.0, 6.0, 7.0)}))
    assert ends(moves)[-1] == pytest.approx((x, y, z), abs=1e-5)


def test_the_sweep_of_a_turned_arc_is_the_same_wherever_the_frame_puts_it() -> None:
    for angle in (0, 37, 90, 215):
        moves = run(f"TRANS X5 Y6\nAROT RPL={angle}\nG1 X10 Y0 F100\nG2 X0 Y-10 I-10 J0 Z-3")
        found = next(move for move in moves if isinstance(move, Arc))
        assert found.sweep_rad == pytest.approx(-math.pi / 2)
        assert found.end_mm[2] == -3.0
