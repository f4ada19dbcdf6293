"""The program rewritten: F and S words line by line, nothing else; then read again, and compared with what was meant.

A line gets an F word where its feed is another than that of the feed line executed before it, and an S word where its speed
is: of a stretch that has one speed, its first line. A line that may be come to another way (block skip, jumps, loops, calls) has
both in any case, so that no other course of the program takes a feed with it; in a stretch of one speed that S word says again
what is in force. What the modes of the control make of the words is not guessed: the text is interpreted, and a line that does
not have what it should gets its words too. Lines for which even that does not help are to be left alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import PartProgramError
from twin.motion.path import EventKind, Kind, Path, path_from_moves
from twin.optimisation.answer import SpeedChanges
from twin.optimisation.problem import Problem
from twin.optimisation.speeds.stretches import changes_in_material
from twin.programs import interpret
from twin.programs.source import joined, source_lines

Floats = NDArray[np.float64]
ROUNDS_MAX = 4
SAME = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Rewritten:
    """text and its path; not_followed: lines (from 0), and why"""

    text: str
    path: Path
    not_followed: dict[int, str]


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The words wanted in a line: figures as text, None = as it is; feed in mm/min and speed to check by, None = as before"""

    feed: str | None
    feed_mm_min: float | None
    speed: str | None
    rpm: float | None


def rewritten(problem: Problem, feed_mm_min: Floats, rpm: Floats) -> Rewritten:
    """The program with these feed words and speeds, (lines,) of `Allowed`; feeds are rounded down, speeds have to be whole."""
    program = problem.program
    wanted = _wanted(problem, feed_mm_min, rpm)
    source = source_lines(program.text)
    forced_feed, forced_speed = _first_choice(problem, wanted, rpm, source)
    speed_lines = _speed_lines(problem, rpm, source)
    own_speed = _of_one_speed(problem)
    settings = program.machine.settings
    text, path, missed = program.text, program.path, {}
    for _ in range(ROUNDS_MAX):
        text = joined(program.text, _changed(source, wanted, forced_feed, forced_speed, speed_lines, problem))
        try:
            path = path_from_moves(interpret(text, settings), settings.start_mm or None)
        except PartProgramError as error:
            return Rewritten(text, program.path, {error.line - 1: f"a control would refuse it rewritten: {error.reason}"})
        missed = _missed(problem, path, wanted)
        more_feed = {line for line, what in missed.items() if what == "feed"} - forced_feed
        more_speed = {line for line, what in missed.items() if what == "speed" and line in own_speed} - forced_speed
        if not more_feed and not more_speed:
            break
        forced_feed |= more_feed
        forced_speed |= more_speed
    carriers = {program.lines[k].line for k in problem.groups.carriers}
    why = dict(_at_fault(problem, source, line, what) for line, what in missed.items() if line not in carriers)
    return Rewritten(text, path, why or _changed_between(problem, path))


def _at_fault(problem: Problem, source: list[str], number: int, what: str) -> tuple[int, str]:
    """Return the line to leave alone for one that was missed, and why: itself, or the line before a call that takes no word."""
    words, order = problem.program.words, lines_executed(problem)
    letter = "S" if what == "speed" else "F"
    if words.with_feed(source[number], "1") == source[number] and words.feed_place(source[number]) is None and number in order:
        free = {line.line for line in problem.program.lines if not line.left_alone}
        for before in reversed(order[: order.index(number)]):
            if before in free:
                after = f"line {number + 1} after it has to keep its {what} and can have no {letter} word of its own"
                return before, f"{after}: a new {letter} word here would change it"
    return number, f"a new {letter} word here would not set its {what}: the control would run it at another one"


def _changed_between(problem: Problem, path: Path) -> dict[int, str]:
    """Lines before which the speed changes in the material, and may not: left alone, they hold their group at their speed."""
    if problem.groups.changes is SpeedChanges.ANYWHERE:
        return {}
    lines = [problem.program.lines[k] for k in changes_in_material(problem.program, path)]
    return {line.line: "a word that cannot be changed sets the speed before it" for line in lines if not line.left_alone}


def _wanted(problem: Problem, feed: Floats, rpm: Floats) -> dict[int, _Wanted]:
    rows = {int(k): row for row, k in enumerate(problem.allowed.index)}
    wanted, words = {}, problem.program.words
    for k, line in enumerate(problem.program.lines):
        row = rows.get(k)
        if k in problem.groups.carriers:
            own = float(rpm[problem.groups.carriers[k]])
            wanted[line.line] = _Wanted(None, None, f"{own:.9g}", own)
        elif row is None:
            speed = f"{abs(line.rpm):.9g}" if line.needs_speed and line.rpm else None
            wanted[line.line] = _Wanted(None, None, speed, None)
        else:
            figure = words.feed_figure(float(feed[row]), line.inch)
            speed = f"{rpm[row]:.9g}" if problem.allowed.cutting[row] else None
            wanted[line.line] = _Wanted(figure, words.figure_mm_min(figure, line.inch), speed, float(rpm[row]))
    return wanted


def lines_executed(problem: Problem) -> list[int]:
    """Source lines of all executions of feed lines, in their order."""
    runs = sorted((a, line.line) for line in problem.program.lines for a, _ in line.executions)
    return [line for _, line in runs]


def _first_choice(problem: Problem, wanted: dict[int, _Wanted], rpm: Floats, source: list[str]) -> tuple[set[int], set[int]]:
    """Lines that get an F word, and an S word, by what is in force before them; those that may be come to otherwise get both."""
    feeds, speeds = set(), set()
    apart = _apart(problem, source)
    feeds |= {line.line for line in problem.program.lines if line.plain_feed and line.line in apart}
    speeds |= {number for number in apart & _of_one_speed(problem) if wanted[number].speed is not None}
    kept = {line.line: line.word_mm_min for line in problem.program.lines if line.plain_feed}
    feed: float | None = None
    for number in lines_executed(problem):
        one = wanted[number]
        if one.feed is not None and (one.feed_mm_min != feed or problem.program.words.feed_place(source[number]) is not None):
            feeds.add(number)
        feed = one.feed_mm_min if one.feed is not None else kept.get(number)
        if one.speed is not None and problem.program.words.speed_place(source[number]) is not None:
            speeds.add(number)
    now = 0.0
    made = problem.speeds
    for e, event in enumerate(made.candidates.events):
        if event.kind == EventKind.SPINDLE:
            value = float(rpm[made.owner[e]]) if made.owner[e] >= 0 else event.value
            if made.candidates.is_optional[e] and value != now:
                speeds.add(event.line)
            now = value
    return feeds, speeds


def _apart(problem: Problem, source: list[str]) -> set[int]:
    """Feed lines to which the control may come another way than from the feed line before them in the text."""
    marks, found, last = problem.program.words.branches(source), set(), -1
    for number in sorted(line.line for line in problem.program.lines):
        if any(marks[max(last, 0) : number + 1]):
            found.add(number)
        last = number
    return found


def _of_one_speed(problem: Problem) -> set[int]:
    """Lines that have the same speed, in either direction, whenever they are executed: an S word of theirs cannot be wrong."""
    rpm = problem.program.path.commanded_rpm()
    changed = {int(k) for k in problem.allowed.index[problem.allowed.cutting]} | problem.groups.carriers.keys()
    return {
        line.line
        for k, line in enumerate(problem.program.lines)
        if k in changed or len({abs(float(rpm[a])) for a, _ in line.executions}) == 1
    }


def _speed_lines(problem: Problem, rpm: Floats, source: list[str]) -> dict[int, str]:
    """Lines whose S word sets the speed of a later line: line → figure. Of two starts by one S word the second gets its own."""
    found: dict[int, str] = {}
    speeds, words = problem.speeds, problem.program.words
    for e, event in enumerate(speeds.candidates.events):
        if event.kind != EventKind.SPINDLE or speeds.candidates.is_optional[e] or speeds.owner[e] < 0:
            continue
        for number in range(event.line, -1, -1):
            place = words.speed_place(source[number])
            if place is not None:
                if place.plain and words.commands_speed(source[number]):
                    figure = f"{rpm[speeds.owner[e]]:.9g}"
                    is_taken = found.get(number, figure) != figure
                    found[event.line if is_taken and words.starts_spindle(source[event.line]) else number] = figure
                break
    return found


def _changed(
    source: list[str], wanted: dict[int, _Wanted], feeds: set[int], speeds: set[int], speed_lines: dict[int, str],
    problem: Problem,
) -> dict[int, str]:  # fmt: skip
    changed: dict[int, str] = {}
    words = problem.program.words
    for number, figure in speed_lines.items():
        changed[number] = words.with_speed(source[number], figure)
    programmed = {line.line: line for line in problem.program.lines}
    for number, one in wanted.items():
        if words.feed_place(source[number]) is None and words.with_feed(source[number], "1") == source[number]:
            _before_call(changed, source, number, one.speed if number in speeds else None, number in feeds, problem)
            continue
        text = changed.get(number, source[number])
        if number in feeds:
            # a line that is left alone gets the feed it was written for, which its modes would no longer give it
            line = programmed[number]
            text = words.with_feed(text, one.feed or words.exact_feed_figure(line.word_mm_min, line.inch))
        if number in speeds and one.speed is not None:
            text = words.with_speed(text, one.speed)
        if text != source[number]:
            changed[number] = text
    return changed


def _before_call(
    changed: dict[int, str], source: list[str], number: int, speed: str | None, with_feed: bool, problem: Problem
) -> None:
    """Write the words that a line needs and cannot have into a rapid between it and the feed line before it, if there is one."""
    words, by_line = problem.program.words, {line.line: line for line in problem.program.lines}
    rapids = {int(line) for line in problem.program.path.line} - by_line.keys()
    marks = words.branches(source)
    before = number - 1
    while before >= 0 and before not in by_line and before not in rapids and words.speed_place(source[before]) is None:
        before -= 1
    if before not in rapids or any(marks[before:number]) or words.with_speed(source[before], "1") == source[before]:
        return
    text = changed.get(before, source[before])
    line = by_line[number]
    if with_feed and line.plain_feed and words.feed_place(text) is None:
        text = words.with_feed(text, words.exact_feed_figure(line.word_mm_min, line.inch))
    if speed is not None and words.speed_place(text) is None:
        text = words.with_speed(text, speed)
    if text != source[before]:
        changed[before] = text


def _missed(problem: Problem, path: Path, wanted: dict[int, _Wanted]) -> dict[int, str]:
    """Lines that do not have what they should: line → feed, speed, or way."""
    before = problem.program.path
    if len(path) != len(before) or not _same_way(before, path):
        moved = _first_difference(before, path)
        return {moved: "way"}
    missed: dict[int, str] = {}
    speed, programmed = path.commanded_rpm(), before.commanded_rpm()
    for line in problem.program.lines:
        one = wanted[line.line]
        for a, b in line.executions:
            feeding = np.arange(a, b)[path.kind[a:b] != Kind.RAPID]
            feed = before.feed_mm_min[feeding] if one.feed_mm_min is None else one.feed_mm_min
            rpm = programmed[feeding] if one.rpm is None else one.rpm
            if np.any(np.abs(path.feed_mm_min[feeding] - feed) > SAME * feed):
                missed[line.line] = "feed"
            elif one.speed is not None and np.any(np.abs(speed[feeding] - rpm) > SAME * np.abs(rpm)):
                missed[line.line] = "speed"
    return missed


def _same_way(one: Path, other: Path) -> bool:
    fields = ("kind", "line", "start_mm", "end_mm", "centre_mm", "sweep_rad", "exact_stop")
    still = [[(e.segment, e.kind, e.value) for e in p.events if e.kind != EventKind.SPINDLE] for p in (one, other)]
    return still[0] == still[1] and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in fields)


def _first_difference(one: Path, other: Path) -> int:
    count = min(len(one), len(other))
    differs = np.flatnonzero(
        (one.line[:count] != other.line[:count]) | np.any(one.end_mm[:count] != other.end_mm[:count], axis=1)
    )
    return int(one.line[differs[0] if len(differs) else max(count - 1, 0)])
