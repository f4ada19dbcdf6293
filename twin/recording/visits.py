"""The lines of a program in the order in which they are executed: a subprogram that is called twice is visited twice.

Where lines only ascend, a line tells how far a run has come. Where a subprogram stands after M30, or a loop goes back, it does
not: then each visit gets a number of its own, in the path and in the recording, and those ascend again. A recorded line is the
next visit of it; one without a move (a comment) stays where the run is, and one beyond every line of the program comes after the
last visit.
"""

from collections import defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.motion.path import Path

Ints = NDArray[np.int64]


def visits(path: Path) -> Ints:
    """Return the line of each visit (n,), in order.

    >>> from twin.programs import interpret
    >>> from twin.motion.path import path_from_moves
    >>> twice = "G1 F100 X1\\nM98 P7\\nX3\\nM98 P7\\nM30\\nO7\\nG91 X1\\nG90\\nM99\\n"
    >>> visits(path_from_moves(interpret(twice))).tolist()
    [0, 6, 2, 6, 4]
    """
    lines = np.array([line for line, _ in _steps(path)], dtype=np.int64)
    return lines[np.concatenate([[True], lines[1:] != lines[:-1]])] if len(lines) else lines


def by_visit(path: Path, told: Ints, lines: int) -> tuple[Path, Ints, Ints]:
    """Return path and recorded lines (rows,) with visits in place of lines, and the line of each visit. lines: of the program

    Nothing changes where lines only ascend: then a line is its own visit.
    """
    source = visits(path)
    if not np.any(np.diff(source) < 0):
        highest = max(int(source.max(initial=-1)), int(told.max(initial=-1)))
        return path, told, np.arange(highest + 1)
    segments, events = path.line.copy(), list(path.events)
    visit, before = -1, -1
    for line, (is_event, at) in _steps(path):
        visit, before = visit + (line != before), line
        if is_event:
            events[at] = replace(events[at], line=visit)
        else:
            segments[at] = visit
    return replace(path, line=segments, events=tuple(events)), _told(source, told, lines), source


def _steps(path: Path) -> list[tuple[int, tuple[bool, int]]]:
    """Return line, and event or segment with its number, in the order of execution."""
    ordered = [((event.segment, 0, n), event.line, (True, n)) for n, event in enumerate(path.events)]
    ordered += [((n, 1, 0), line, (False, n)) for n, line in enumerate(path.line.tolist())]
    return [(line, what) for _, line, what in sorted(ordered)]


def _told(source: Ints, told: Ints, lines: int) -> Ints:
    """Return the visit of each recorded line."""
    places: dict[int, list[int]] = defaultdict(list)
    for visit, line in enumerate(source.tolist()):
        places[line].append(visit)
    found, now = [], -1
    for line in told.tolist():
        if line >= lines:
            now = len(source) + line - lines
        elif not 0 <= now < len(source) or source[now] != line:
            now = next((visit for visit in places[line] if visit > now), now)
        found.append(now)
    return np.array(found, dtype=np.int64)
