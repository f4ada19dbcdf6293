"""LinuxCNC's own interpreter, run as a program of its own, as an oracle of the moves that both dialects have.

It is looked for on PATH, or where CNCTWIN_RS274 says: the executable, or the folder into which the Debian package
`linuxcnc-uspace` (with `libboost-python` and `libtirpc3`) was unpacked. It is never imported, linked or copied.
"""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from twin.programs import Arc, DwellUnit, LeadIn, Linear, Move, OffsetLookup, OutsideCorner, Rapid, Settings, ToolOffset

AXES = 6
SECONDS_MAX = 20.0
CALL = re.compile(r"^\s*\d+ N\S+\s+([A-Z0-9_]+)\(([^)]*)\)", re.M)
TOOLS = dict.fromkeys(range(3, 100), ToolOffset()) | {
    1: ToolOffset(length_mm=12.7, radius_mm=3.0),
    2: ToolOffset(length_mm=25.4, radius_mm=5.0),
}
LIKE_LINUXCNC = Settings(
    axes=("x", "y", "z", "a", "b", "c"),
    dwell_unit=DwellUnit.SECONDS,
    offset_lookup=OffsetLookup.TOOL,
    outside_corner=OutsideCorner.ARC,
    lead_in=LeadIn.OWN,
    tool_offsets=TOOLS,
    peck_retract_mm=0.254,
    peck_clearance_mm=0.254,
    arc_radius_error_mm_max=0.3,
    jumps_max=5000,
    blocks_max=200_000,
)
"""The settings under which our dialect means what LinuxCNC's does. Its pecks leave 0.010 inch."""


class Flat(NamedTuple):
    """A move in the form in which both can be compared: machine coordinates, mm."""

    kind: str
    end: tuple[float, ...]
    centre: tuple[float, ...] = ()
    turns: int = 0


class Program(NamedTuple):
    """The interpreter and the environment that it needs."""

    path: Path
    environment: dict[str, str]


def find() -> Program | None:
    """Return where rs274 is on this machine."""
    named = os.environ.get("CNCTWIN_RS274") or shutil.which("rs274")
    if not named:
        return None
    path = Path(named)
    root = path if path.is_dir() else path.resolve().parent.parent.parent
    program = path / "usr" / "bin" / "rs274" if path.is_dir() else path
    if not program.is_file():
        return None
    libraries = [str(folder) for folder in (root / "usr/lib", root / "usr/lib/x86_64-linux-gnu") if folder.is_dir()]
    known = os.environ.get("LD_LIBRARY_PATH")
    environment = {**os.environ, "LD_LIBRARY_PATH": ":".join([*libraries, known] if known else libraries)}
    return Program(program, environment)


def required() -> Program:
    """rs274, or the reason to skip."""
    found = find()
    if found is None:
        pytest.skip("no rs274 on this machine: unpack linuxcnc-uspace and set CNCTWIN_RS274 to that folder")
    return found


def run(program: Program, text: str) -> str | None:
    """Return what it prints for a part program; None where it does not reach the end of it."""
    with tempfile.TemporaryDirectory() as folder:
        source, tools = Path(folder) / "program.ngc", Path(folder) / "tool.tbl"
        source.write_text(text)
        # The table is in inches unless an ini says otherwise; D is a diameter.
        rows = (f"T{n} P{n} D{tool.radius_mm * 2 / 25.4:.12f} Z{tool.length_mm / 25.4:.12f}" for n, tool in TOOLS.items())
        tools.write_text("\n".join(rows) + "\n")
        command = [str(program.path), "-g", "-t", str(tools), "-v", str(Path(folder) / "rs274.var"), str(source)]
        try:
            done = subprocess.run(
                command, capture_output=True, env=program.environment, timeout=SECONDS_MAX, check=False, cwd=folder
            )
        except subprocess.TimeoutExpired:
            return None
    printed = done.stdout.decode(errors="replace")
    return printed if "PROGRAM_END" in printed else None


class Reader:
    """Turns canonical calls into machine coordinates: rotation about the origin, offsets, tool length, units."""

    def __init__(self) -> None:
        self.unit = 1.0
        self.offsets = dict.fromkeys(("SET_G5X_OFFSET", "SET_G92_OFFSET", "USE_TOOL_LENGTH_OFFSET"), (0.0,) * AXES)
        self.plane = "XY"
        self.moves: list[Flat] = []

    def lengths(self, figures: Sequence[float]) -> tuple[float, ...]:
        return tuple(value * (self.unit if axis < 3 else 1.0) for axis, value in enumerate(figures))

    def machine(self, figures: Sequence[float]) -> tuple[float, ...]:
        return tuple(map(sum, zip(self.lengths(figures), *self.offsets.values(), strict=True)))

    def call(self, name: str, words: str) -> None:
        if name == "USE_LENGTH_UNITS":
            self.unit = {"CANON_UNITS_MM": 1.0, "CANON_UNITS_INCHES": 25.4, "CANON_UNITS_CM": 10.0}[words]
            return
        if name == "SELECT_PLANE":
            self.plane = words.removeprefix("CANON_PLANE_")
            return
        if name not in {*self.offsets, "STRAIGHT_FEED", "STRAIGHT_TRAVERSE", "ARC_FEED", "DWELL", "SET_XY_ROTATION"}:
            return
        figures = [float(word) for word in words.replace(",", " ").split()]
        if name in self.offsets:
            begin = 1 if name == "SET_G5X_OFFSET" else 0
            self.offsets[name] = self.lengths(figures[begin : begin + AXES])
        elif name == "SET_XY_ROTATION":
            assert figures == [0.0], "this comparison knows no rotation"
        elif name == "DWELL":
            self.moves.append(Flat("Dwell", (figures[0],)))
        elif name == "ARC_FEED":
            self.arc(figures)
        else:
            kind = "Rapid" if name == "STRAIGHT_TRAVERSE" else "Linear"
            self.moves.append(Flat(kind, self.machine(figures)))

    def arc(self, figures: list[float]) -> None:
        first, second, normal = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}[self.plane]
        end = [0.0] * 3
        end[first], end[second], end[normal] = figures[0], figures[1], figures[5]
        centre = [0.0] * 3
        centre[first], centre[second] = figures[2], figures[3]
        whole = self.machine([*centre, 0.0, 0.0, 0.0])
        middle = (whole[first], whole[second])
        self.moves.append(Flat("Arc", self.machine([*end, *figures[6:9]]), middle, int(figures[4])))


def read(printed: str) -> list[Flat]:
    """The moves that rs274 printed."""
    reader = Reader()
    for match in CALL.finditer(printed):
        reader.call(*match.groups())
    return moving(reader.moves)


def ours(moves: Sequence[Move]) -> list[Flat]:
    """Our own moves in the same form."""
    flat: list[Flat] = []
    for move in moves:
        if isinstance(move, Arc):
            first, second, _ = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[move.plane]
            centre = (move.centre_mm[first], move.centre_mm[second])
            flat.append(Flat("Arc", move.end_mm, centre, 1 if move.sweep_rad > 0 else -1))
        elif isinstance(move, Rapid | Linear):
            flat.append(Flat(type(move).__name__, move.end_mm))
        elif type(move).__name__ == "Dwell":
            flat.append(Flat("Dwell", (move.seconds,)))
    return moving(flat)


def moving(moves: Sequence[Flat]) -> list[Flat]:
    """Without straight moves that lead nowhere: where the two put those says nothing about the path."""
    kept: list[Flat] = []
    here: tuple[float, ...] = (0.0,) * AXES
    for move in moves:
        if move.kind == "Dwell":
            kept += [move] if move.end[0] > 0.0 else []
            continue
        if move.kind == "Arc" or max(abs(a - b) for a, b in zip(move.end, here, strict=True)) > 1e-3:
            kept.append(move)
            here = move.end
    return kept


def difference(theirs: Sequence[Flat], own: Sequence[Flat], tolerance_mm: float) -> str | None:
    """The first move that differs, in words; None where there is none."""
    for at, (one, other) in enumerate(zip(theirs, own, strict=False)):
        far = max(
            (abs(a - b) for a, b in zip(one.end + one.centre, other.end + other.centre, strict=False)),
            default=0.0,
        )
        if one.kind != other.kind or one.turns != other.turns or far > tolerance_mm:
            return f"move {at}: rs274 {one}, ours {other}"
    if len(theirs) != len(own):
        return f"rs274 makes {len(theirs)} moves, ours {len(own)}"
    return None
