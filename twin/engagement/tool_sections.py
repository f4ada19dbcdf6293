"""The tools of a program along its path: which one is in the spindle on each segment, and what is not known of it.

A tool N is [tools.N]; else the one [tool], where the machine describes no tools by number.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.engagement.along_path import PathRows, Section
from twin.machine import MachineFile, Tool
from twin.motion.path import EventKind, Kind, Path

Ints = NDArray[np.int64]


def tool_numbers(path: Path) -> Ints:
    """The number of the tool in the spindle on each segment (n,); 0 before the first change."""
    number = np.zeros(len(path), dtype=np.int64)
    for event in path.events:
        if event.kind == EventKind.TOOL_CHANGE:
            number[event.segment :] = int(event.value)
    return number


def tools_used(machine: MachineFile, path: Path) -> tuple[Ints, list[tuple[int, Tool]]]:
    """Index of the tool of each segment, −1 where it is not described, and the tools."""
    number = tool_numbers(path)
    tools: list[tuple[int, Tool]] = []
    index = np.full(len(path), -1, dtype=np.int64)
    for one in dict.fromkeys(number.tolist()):
        tool = machine.tools.get(str(one), None if machine.tools and one else machine.tool)
        if tool is not None:
            index[number == one] = len(tools)
            tools.append((one, tool))
    return index, tools


def tool_notes(machine: MachineFile, path: Path) -> list[str]:
    """Says it where several tools of the program are taken to be one."""
    numbers = {int(event.value) for event in path.events if event.kind == EventKind.TOOL_CHANGE and event.value}
    if len(numbers) < 2 or machine.tools or machine.tool is None:
        return []
    taken = f"all are taken to be the {machine.tool.diameter_mm:g} mm one of [tool]"
    return [f"the program has {len(numbers)} tools; {taken}: write [tools.N]"]


def collision_notes(path: Path, rows: PathRows) -> list[str]:
    """Return notes on rapids that go into material, the first three."""
    said = []
    for hit in rows.collisions[:3]:
        place = ", ".join(f"{v:.1f}" for v in hit.position_mm)
        said.append(f"line {int(path.line[hit.segment]) + 1}: rapid into material at {place} mm")
    return said


def unknown_start(path: Path) -> int:
    """Return the number of rapids before the first motion of Z: where they go from is not known, so they meet nothing."""
    level = (path.kind == Kind.RAPID) & (path.start_mm[:, 2] == path.end_mm[:, 2])
    count = int(np.argmin(level)) if not level.all() else len(path)
    leaves_z = count < len(path) and path.kind[count] == Kind.RAPID
    return count + int(leaves_z)


def tool_sections(index: Ints, tools: Sequence[tuple[int, Tool]], unknown: int) -> list[Section]:
    """Return the parts of a path that one tool travels, from a start of which `unknown` segments meet nothing."""
    if not len(index):
        return []
    edges = np.unique(np.concatenate([[0, unknown], np.flatnonzero(np.diff(index)) + 1, [len(index)]]))
    return [
        Section(int(a), int(b), tools[int(index[a])][1].diameter_mm if index[a] >= 0 and a >= unknown else 0.0)
        for a, b in pairwise(edges)
    ]
