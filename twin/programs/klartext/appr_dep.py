"""APPR and DEP: on and off a contour. `approach.py` draws the ways; here their blocks are read."""

import math
from collections.abc import Callable
from typing import Final

from twin.programs.arcs import Point
from twin.programs.canonical import Linear, Motion, Position
from twin.programs.cutter_path import REACH_MM
from twin.programs.klartext import compensation, m_functions, motion
from twin.programs.klartext.approach import depart
from twin.programs.klartext.block import Block, parse
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import Approach, State
from twin.programs.pieces import in_plane, piece
from twin.programs.planar import extent, tangent
from twin.programs.refusal import RefusedError

SHAPES: Final = frozenset({"LEN", "CCA", "R"})
CCA_MAX: Final = 360.0


def compiled(source: Source, begin: int, head: str) -> Callable[[State], None]:
    """`APPR LT` … `DEP PLCT`, whose words begin at `begin`."""
    verb, kind = head.split()
    polar = kind.startswith("P")
    block = parse(source, begin, motion.CARTESIAN | motion.POLAR | SHAPES)
    shape = kind.removeprefix("P")
    if verb == "APPR":
        return lambda state: approach(state, block, shape, polar)
    return lambda state: departure(state, block, shape, polar)


def figures(state: State, block: Block, kind: str, verb: str) -> tuple[float, float]:
    """LEN or R in mm, and CCA in rad."""
    name = "LEN" if kind in ("LT", "LN") else "R"
    size = block.value(state.variables, name)
    if size is None or size == 0.0 or (kind in ("LT", "LN", "LCT") and size < 0.0):
        text = block.texts.get(name, verb)
        raise RefusedError(text, f"{verb} {kind} needs {name}, {'not 0' if kind == 'CT' else 'more than 0'}")
    angle = 0.0
    if kind == "CT":
        given = block.value(state.variables, "CCA")
        if given is None or not 0.0 < given <= CCA_MAX:
            raise RefusedError(block.texts.get("CCA", verb), f"{verb} CT needs CCA, more than 0 and up to {CCA_MAX:g} degrees")
        angle = math.radians(given)
    scale = abs(state.frame.arc_scale(state.plane))
    return size * state.unit_mm * scale, angle


def approach(state: State, block: Block, kind: str, polar: bool) -> None:
    """APPR: the section begins with the straight move to P_A, in whose place the way is drawn when the section is worked out."""
    compensation.refuse(state, "APPR")
    if state.corner is not None:
        raise RefusedError("APPR", "cannot stand behind RND or CHF")
    word = block.compensation or "R0"
    side = {"R0": 0, "RL": 1, "RR": -1}[word]
    if side == 0 and kind != "LT":
        raise RefusedError("R0", f"APPR {kind} needs the side of the tool; write RL or RR")
    m_functions.before(state, block.m)
    # P_H of LT, LN and CT is reached as the block before moved; LCT goes all the way with its own feed.
    start_rapid, start_feed = state.last_rapid, (0.0, None) if state.last_rapid or kind == "LCT" else state.feed()
    rapid = motion.take_feed(state, block)
    end = motion.polar_target(state, block)[0] if polar else motion.target(state, block)
    depth = changed_height(state, end)
    rest = motion.straight_move(state, end, rapid)
    first: Motion = rest
    if kind != "LCT":
        own = Linear(state.line, end, *start_feed, state.program)
        first = motion.straight_move(state, end, rapid=True) if start_rapid else own
    size, angle = figures(state, block, kind, "APPR")
    compensation.begin(state, side, word if side else "APPR")
    mirrored = -1 if state.frame.mirrors(state.plane) else 1
    state.approach = Approach(kind, side * mirrored, size, angle, depth, first, rest)
    motion.add(state, rest)
    m_functions.after(state, block.m)


def departure(state: State, block: Block, kind: str, polar: bool) -> None:
    """DEP: compensation ends, and the way off is drawn from where it left the tool."""
    if state.corner is not None:
        raise RefusedError("DEP", "cannot stand behind RND or CHF")
    if block.compensation in ("RL", "RR"):
        raise RefusedError(block.compensation, "DEP always ends with R0")
    m_functions.before(state, block.m)
    rapid = motion.take_feed(state, block)
    side = state.side * (-1 if state.frame.mirrors(state.plane) else 1)
    direction = left_contour(state)
    if side == 0 and kind != "LT":
        raise RefusedError("DEP", f"DEP {kind} needs the side of the tool, RL or RR, before")
    goal: Point | None = None
    target = motion.polar_target(state, block)[0] if polar else motion.target(state, block)
    if kind == "LCT":
        goal = in_plane(target, state.plane)
    depth = changed_height(state, target)
    size, angle = figures(state, block, kind, "DEP")
    rest = motion.straight_move(state, state.position, rapid)
    begin = len(state.moves)
    way = Approach(kind, side, size, angle, depth, rest, rest)
    start = state.position
    state.position = depart(state.moves, way, start, direction, goal, state.plane)
    if len(state.moves) > begin:
        state.last_rapid = rapid
        state.last = None
    m_functions.after(state, block.m)


def changed_height(state: State, end: Position) -> float | None:
    """The height of the tool's axis at the end of a block; None where it stays."""
    height = end[state.normal]
    return None if height == state.position[state.normal] else height


def left_contour(state: State) -> Point:
    """The direction in which the tool leaves the contour, which ends here."""
    found = compensation.finish(state)
    if found is not None:
        return found
    if state.last is not None:
        programmed = piece(state.last[0], state.last[1], state.plane)
        if extent(programmed) > REACH_MM:
            return tangent(programmed, programmed.end)
    raise RefusedError("DEP", "needs a contour in the working plane just before it")
