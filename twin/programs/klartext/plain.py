"""The short way for the blocks that long programs are made of: `L X+10.5 Y-3 Z+0.1 R0 F500`, in plain modes.

One pattern takes such a block apart and its move is put out at once; everything else takes the long way, with the same result.
"""

import re
from typing import Final

from twin.programs.canonical import Linear, Motion, Rapid
from twin.programs.klartext.flow import Level
from twin.programs.klartext.state import FEED_MAX, State

LENGTH: Final = r"[-+]?+(?:[0-9]{1,9}+(?:[.,][0-9]{0,15}+)?+|[.,][0-9]{1,15}+)"
BLOCK: Final = re.compile(
    rf"L[ \t]++(?:X({LENGTH})[ \t]*+)?+(?:Y({LENGTH})[ \t]*+)?+(?:Z({LENGTH})[ \t]*+)?+(?:R0(?![0-9.,])[ \t]*+)?+"
    r"(?:F(MAX|[0-9]{1,8}+(?:\.[0-9]{0,6}+)?+))?+"
)


def is_plain(state: State) -> bool:
    """Return True where the modes allow the short way."""
    return (
        state.frame.plain
        and state.compensation is None
        and state.corner is None
        and not state.calls_cycle
        and not state.length_is_due
        and not state.per_revolution
        and state.plunge_factor is None
        and state.plane == 17
    )


def run(state: State, level: Level, blocks_left: int) -> int:
    """Run plain blocks up to the first one that is none; returns how many. Leaves that one in `level.at`."""
    sources, match, put = level.text.sources, BLOCK.fullmatch, state.moves.append
    stop, program, unit = min(len(sources), level.at + blocks_left), level.text.name, state.unit_mm
    offset, feed_unit, feed = state.frame.offset, state.feed_unit, state.feed_mm_min
    position, last = state.position, state.last
    begin = at = level.at
    moves_left = state.settings.moves_max - len(state.moves)
    while at < stop and at - begin < moves_left:
        source = sources[at]
        found = None if source.skip else match(source.body)
        if found is None:
            break
        x, y, z, f = found.groups()
        rapid = f == "MAX"
        new_feed = feed if f is None or rapid else float(f) * feed_unit
        if (x is None and y is None and z is None) or not (rapid or 0.0 < new_feed <= FEED_MAX):
            break
        end = (
            position[0] if x is None else float(x.replace(",", ".")) * unit + offset[0],
            position[1] if y is None else float(y.replace(",", ".")) * unit + offset[1],
            position[2] if z is None else float(z.replace(",", ".")) * unit + offset[2],
            *position[3:],
        )
        move: Motion = Rapid(source.line, end, program) if rapid else Linear(source.line, end, new_feed, None, program)
        put(move)
        last, position, feed = (position, move), end, new_feed
        at += 1
    if at > begin and last is not None:
        state.position, state.feed_mm_min, state.last = position, feed, last
        state.last_rapid, level.at = isinstance(last[1], Rapid), at
        state.line, state.program = last[1].line, program
    return at - begin
