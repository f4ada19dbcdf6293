"""Notes on the changes of speed: how often in the material, what it would take without, which lines hold a speed.

All of it is counted on the rewritten program, read again.
"""

from dataclasses import replace

import numpy as np

from twin.engagement.tool_sections import tool_numbers
from twin.motion.path import Path
from twin.optimisation.answer import Objective, SpeedChanges
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question
from twin.optimisation.seeds import in_sequence
from twin.optimisation.speeds.groups import speed_groups
from twin.optimisation.speeds.stretches import changes_in_material, executions

SMALL = 5e-4
"""Part of time or cost below which a note is not worth making."""
TOOLS_MAX = 12


def speed_notes(made: Problem, question: Question, path: Path, value: float) -> tuple[str, ...]:
    """Sentences. path: of the rewritten program; value: what it takes of what was made small."""
    changed = changes_in_material(made.program, path)
    times = "once" if len(changed) == 1 else f"{len(changed)} times"
    changes = f"the spindle changes its speed {times} while the tool is in the material"
    if made.groups.changes is SpeedChanges.ANYWHERE:
        waits = (
            "the control is taken to wait there until the speed is reached; if yours does not, the chip is another one meanwhile"
        )
        return (f"{changes}: {waits}; {_way_out(made, question, value)}",) if changed else ()
    notes = [_shared(made, path)]
    if made.groups.changes is not question.speed_changes:
        notes.append(
            f"{made.program.dialect.title} has the speed in the block that calls the tool, so that no line has one of its own"
        )
    if changed:
        line = made.program.lines[changed[0]].line + 1
        notes.append(f"{changes}, first before line {line}, by words of the program that are not to be changed")
    if made.groups.changes is SpeedChanges.IN_AIR and made.program.machine.stock is None:
        notes.append("no [stock]: every rapid is taken to lead out of the material")
    held = [(kept, len(rows)) for kept, rows in zip(made.groups.kept, made.groups.rows, strict=True) if kept is not None]
    if held:
        (kept, count), more = held[0], len(held) - 1
        lines = "the line that shares" if count == 1 else f"the {count} lines that share"
        note = f"line {made.program.lines[kept.line].line + 1} is left alone at {kept.rpm:g} rev/min, and holds {lines} its speed"
        notes.append(note + (f"; {more} more of such groups" if more else ""))
    return tuple(notes)


def _shared(made: Problem, path: Path) -> str:
    """Return a note on what was kept, in figures."""
    if made.groups.changes is SpeedChanges.IN_AIR:
        lines, groups = len(made.cutting), len(made.groups)
        many = "one speed" if groups == 1 else f"{groups} groups of one speed each"
        return f"by --speed-changes in_air the {lines} lines whose speed may change are {many}"
    numbers, rpm = tool_numbers(path), np.abs(path.commanded_rpm())
    rows = set(made.allowed.index[made.cutting].tolist())
    found: dict[int, float] = {}
    for begin, _, k in executions(made.program):
        if k in rows:
            found.setdefault(int(numbers[begin]), float(rpm[begin]))
    said = [f"{f'T{number} ' if number else ''}{speed:g} rev/min" for number, speed in list(found.items())[:TOOLS_MAX]]
    if not found:
        return "one speed for each tool: there is no line whose speed may be changed"
    more = len(found) - TOOLS_MAX
    return f"one speed for each tool: {', '.join(said)}" + (f" and {more} more" if more > 0 else "")


def _way_out(made: Problem, question: Question, value: float) -> str:
    """The option that avoids it, and what the program would take: the best of closed form and sequence, on the same control."""
    option = "--speed-changes in_air"
    allowed, groups, why = speed_groups(made.program, made.allowed, SpeedChanges.IN_AIR)
    if why:
        return f"{option} would keep one speed there, and finds none: {why}"
    if question.objective is Objective.PARETO:
        return f"{option} keeps one speed there"
    other = replace(made, allowed=allowed, groups=groups)
    known = in_sequence(other, question.objective)
    seconds, cost = other.evaluate_words(np.array([one for one, _ in known]), np.array([one for _, one in known]))
    more = float((seconds if question.objective is Objective.TIME else cost).min()) - value
    if more <= SMALL * value:
        return f"{option} keeps one speed there, at about the same {question.objective}"
    unit = "s" if question.objective is Objective.TIME or made.economy is None else made.economy.currency
    return f"{option} keeps one speed there, for about {more:.2g} {unit} more ({100.0 * more / value:.2g} %)"
