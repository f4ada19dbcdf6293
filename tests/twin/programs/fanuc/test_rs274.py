"""Our moves and those of LinuxCNC's interpreter are the same, where both know the dialect."""

import random
import re
from itertools import pairwise
from pathlib import Path

import pytest

from tests.recordings import recordings_folder
from tests.twin.programs.fanuc import rs274
from tests.twin.programs.fanuc.contours import contour
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Rapid
from twin.programs.fanuc.interpreter import interpret
from twin.programs.pieces import piece
from twin.programs.planar import turn_between

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.ngc"))
TOLERANCE_MM = 0.0002
RS274_SMOOTH_RAD = 0.06
"""Below 0.05 rad rs274 takes a corner as smooth and cuts it off; we do below 0.001."""
TOLERANCE_INCH_MM = 0.003  # rs274 prints four decimals of an inch.


def compared(text: str) -> tuple[int, str | None] | None:
    """Return how many moves, and the first difference; None where one of the two refuses the program."""
    printed = rs274.run(rs274.required(), text)
    if printed is None:
        return None
    try:
        moves = interpret(text, rs274.LIKE_LINUXCNC)
    except PartProgramError:
        return None
    theirs, own = rs274.read(printed), rs274.ours(moves)
    tolerance = TOLERANCE_INCH_MM if "INCHES" in printed else TOLERANCE_MM
    return len(theirs), rs274.difference(theirs, own, tolerance)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_our_programs_make_the_same_moves_in_both(path: Path) -> None:
    found = compared(path.read_text())
    assert found is not None, "one of the two refuses it"
    count, difference = found
    assert count >= 5
    assert difference is None


def test_linuxcnc_samples_that_both_accept_make_the_same_moves() -> None:
    root = rs274.required().path.parent.parent.parent
    samples = sorted({path.resolve() for path in (root / "usr" / "share").rglob("*.ngc")})
    if not samples:
        pytest.skip(f"no sample programs of LinuxCNC below {root}/usr/share")
    found = {}
    for path in samples:
        text = path.read_text(errors="replace")
        # Named O words and named variables are LinuxCNC's own; asking it about them takes long and tells nothing.
        if not re.search(r"[Oo#]\s*<", text) and (pair := compared(text)) is not None:
            found[path.name] = pair
    assert {name: difference for name, (_, difference) in found.items() if difference is not None} == {}
    assert sum(count for count, _ in found.values()) > 8000


def test_a_shop_program_makes_the_same_moves_in_both() -> None:
    path = recordings_folder() / "nist" / "nc" / "NIST_MTC_CRADA_PLATE-1.NC"
    if not path.exists():
        pytest.skip(f"no recording {path}")
    assert compared(path.read_text()) == (4134, None)


def smoothest_corner_rad(text: str) -> float:
    """The smallest change of direction along the contour without its compensation."""
    moves = [move for move in interpret(text.replace("G41", "").replace("G42", "")) if isinstance(move, Linear | Arc | Rapid)]
    sides = [piece(before.end_mm, move, 17) for before, move in pairwise(moves)]
    return min(abs(turn_between(one, other)) for one, other in pairwise(sides))


def test_random_compensated_contours_are_the_same_in_both() -> None:
    agreed = 0
    for seed in range(120):
        text = contour(random.Random(seed))
        if smoothest_corner_rad(text) < RS274_SMOOTH_RAD:
            continue
        found = compared(text)
        if found is not None:
            assert found[1] is None, text
            agreed += 1
    assert agreed >= 60
