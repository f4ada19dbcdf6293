"""The same contour for a FANUC control and in Klartext makes the same moves: compensation, corners, turns and shifts."""

import math
from dataclasses import dataclass

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.programs.klartext.short import all_of, program
from twin.programs import Arc, Linear, Move, OutsideCorner, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret as fanuc
from twin.programs.klartext.interpreter import interpret as klartext

CONTROL = Settings(tool_offsets={1: ToolOffset(0.0, 3.0)}, outside_corner=OutsideCorner.ARC)


@dataclass(frozen=True)
class Contour:
    """A polygon about the origin, from its first corner round to it again; corners: none, a rounding or a chamfer."""

    radii: tuple[float, ...]
    corners: tuple[str, ...]
    left: bool
    turn_deg: int
    shift: tuple[int, int]

    def points(self) -> list[tuple[float, float]]:
        many = len(self.radii)
        angles = [math.tau * at / many for at in range(many)]
        return [(round(r * math.cos(a), 3), round(r * math.sin(a), 3)) for r, a in zip(self.radii, angles, strict=True)]


CONTOURS = st.integers(3, 6).flatmap(
    lambda many: st.builds(
        Contour,
        st.tuples(*[st.sampled_from([60.0, 66.0, 70.0])] * many),
        st.tuples(*[st.sampled_from(["", "R", "C"])] * many),
        st.booleans(),
        st.sampled_from([0, 30, 90]),
        st.tuples(st.integers(-20, 20), st.integers(-20, 20)),
    )
)


def in_fanuc(contour: Contour) -> str:
    first, *rest = contour.points()
    lines = ["G21 G90 G17 G94", "T1 M6", "S1000 M3", f"G52 X{contour.shift[0]}. Y{contour.shift[1]}."]
    lines += [
        f"G68 X0. Y0. R{contour.turn_deg}.",
        "G0 X120. Y-20.",
        f"{'G41' if contour.left else 'G42'} D1 G1 X{first[0]} Y{first[1]} F200.",
    ]
    for (x, y), corner in zip([*rest, first], contour.corners, strict=True):
        last = (x, y) == first
        lines.append(f"G1 X{x} Y{y}" + (f" ,{corner}5." if corner and not last else ""))
    return "\n".join([*lines, "G40 G1 X120. Y20.", "M30"])


def in_klartext(contour: Contour) -> str:
    first, *rest = contour.points()
    lines = ["TOOL CALL 1 Z S1000", "M3", f"CYCL DEF 7.1 X{contour.shift[0]:+} Y{contour.shift[1]:+}"]
    lines += [f"CYCL DEF 10.1 ROT{contour.turn_deg:+}", "L X+120 Y-20 R0 FMAX"]
    lines.append(f"L X{first[0]:+} Y{first[1]:+} {'RL' if contour.left else 'RR'} F200")
    for (x, y), corner in zip([*rest, first], contour.corners, strict=True):
        lines.append(f"L X{x:+} Y{y:+}")
        if corner and (x, y) != first:
            lines.append("RND R5" if corner == "R" else "CHF 5")
    return program(*lines, "L X+120 Y+20 R0", "M30")


def motions(moves: list[Move]) -> list[str]:
    return all_of([move for move in moves if isinstance(move, Rapid | Linear | Arc)])


@settings(max_examples=80, deadline=None)
@given(CONTOURS)
def test_a_contour_is_the_same_in_both(contour: Contour) -> None:
    made = motions(klartext(in_klartext(contour), CONTROL))
    assert made == motions(fanuc(in_fanuc(contour), CONTROL))
    assert len(made) >= len(contour.radii) + 3
