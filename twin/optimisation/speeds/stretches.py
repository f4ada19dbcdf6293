"""Stretches of a program in which one speed is to be kept: those that the tool spends in the material, or those of one tool.

A stretch in the material goes from one clear place to the next. A place is clear where the tool is a millimetre above the stock
as it was, or beside it by its radius and a millimetre; a change of tool is one too. So a rapid or a feed in air ends a stretch
where it leads out of the material, and not where it goes back through a slot. Without [stock] no place is known, and every
rapid is taken to lead out.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.engagement.tool_sections import tool_numbers
from twin.motion.path import EventKind, Kind, Path
from twin.optimisation.answer import SpeedChanges
from twin.optimisation.program import CLEARANCE_MM, Programmed

Flags = NDArray[np.bool_]
HAIR_MM = 1e-6


class Execution(NamedTuple):
    """One run of a feed line (`line` in `Programmed.lines`): segments from `begin` to before `stop`."""

    begin: int
    stop: int
    line: int


class Stretch(NamedTuple):
    """executions: in their order; parts: (begin, left) of each part of the program that it is: the tool is out of it at `left`"""

    executions: tuple[Execution, ...]
    parts: tuple[tuple[int, int], ...]


def executions(program: Programmed) -> list[Execution]:
    """Return the executions of all feed lines, in their order."""
    return sorted(Execution(a, b, k) for k, line in enumerate(program.lines) for a, b in line.executions)


def stretches(program: Programmed, changes: SpeedChanges) -> tuple[Stretch, ...]:
    """Those in which the speed may not change; where it may change anywhere, each execution is one."""
    how: dict[SpeedChanges, Callable[[Programmed], tuple[Stretch, ...]]] = {
        SpeedChanges.ANYWHERE: _alone,
        SpeedChanges.IN_AIR: in_material,
        SpeedChanges.PER_TOOL: _of_tools,
    }
    return how[changes](program)


def in_material(program: Programmed) -> tuple[Stretch, ...]:
    """From one clear place to the next."""
    clear = np.append(_clear(program), [False, True])
    met = np.cumsum(clear)
    found: list[list[Execution]] = []
    for one in executions(program):
        if found and met[one.begin] == met[found[-1][-1].stop] and not clear[found[-1][-1].stop]:
            found[-1].append(one)
        else:
            found.append([one])
    left = [one[-1].stop + int(np.argmax(clear[one[-1].stop :])) for one in found]
    return tuple(Stretch(tuple(one), ((one[0].begin, out),)) for one, out in zip(found, left, strict=True))


def changes_in_material(program: Programmed, path: Path) -> tuple[int, ...]:
    """Lines (in `Programmed.lines`) before which the speed changes in the material, once for each time.

    path: of the program as it was, or rewritten: it goes the same way. Counted are changes between the first cut of a stretch and
    its last one, also those that the next word takes back.
    """
    changed = []
    spindle = [event for event in path.events if event.kind == EventKind.SPINDLE and event.value]
    at = np.array([event.segment for event in spindle], dtype=np.int64)
    for stretch in in_material(program):
        cuts = [one for one in stretch.executions if program.lines[one.line].cutting or program.lines[one.line].plunges]
        if len(cuts) < 2:
            continue
        first, stop = np.searchsorted(at, [cuts[0].begin, cuts[-1].begin], side="right").tolist()
        now = spindle[first - 1].value if first else 0.0
        for event in spindle[first:stop]:
            if now not in (0.0, event.value):
                changed.append(next(one.line for one in cuts if one.begin >= event.segment))
            now = event.value
    return tuple(changed)


def _clear(program: Programmed) -> Flags:
    """Return True where the tool is clear of the material where a segment begins, (segments,)."""
    path, stock = program.path, program.machine.stock
    if stock is None:
        clear = np.append(False, path.kind[:-1] == Kind.RAPID)[: len(path)]
    else:
        at, tools = path.tip_ends_mm(np.arange(len(path)))[0], dict(program.tools)
        numbers = tool_numbers(path)
        radius = np.array([tools[n].diameter_mm / 2.0 if n in tools else np.inf for n in numbers.tolist()])
        reach = (radius + CLEARANCE_MM - HAIR_MM)[:, None]
        beside = (at[:, :2] - reach >= np.array(stock.max_mm[:2])) | (at[:, :2] + reach <= np.array(stock.min_mm[:2]))
        clear = beside.any(axis=1) | (at[:, 2] >= stock.max_mm[2] + CLEARANCE_MM - HAIR_MM)
    for event in path.events:
        if event.kind == EventKind.TOOL_CHANGE and event.segment < len(path):
            clear[event.segment] = True
    return np.asarray(clear, dtype=np.bool_)


def _alone(program: Programmed) -> tuple[Stretch, ...]:
    return tuple(Stretch((one,), ()) for one in executions(program))


def _of_tools(program: Programmed) -> tuple[Stretch, ...]:
    """Return, for each tool number, all of the program, however often it comes into the spindle."""
    numbers = tool_numbers(program.path)
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)] if len(numbers) else [0]
    every = executions(program)
    found = []
    for number in dict.fromkeys(numbers.tolist()):
        mine = tuple(one for one in every if numbers[one.begin] == number)
        parts = tuple((a, b) for a, b in pairwise(edges) if numbers[a] == number)
        found.append(Stretch(mine, parts))
    return tuple(found)
