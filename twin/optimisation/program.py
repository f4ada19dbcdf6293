"""The program as the optimiser sees it: its source lines that feed, what each cuts, and which of them it may change.

A line is a source line; all its executions share one feed and one speed. What is left alone, and why, stands in `left_alone`:

* its feed does not come from an F word in mm/min: tied to the spindle (G95, tapping), part of a cycle, or an expression
* its feed at the tool's centre is not the F word: an arc beside which the control keeps F at the contour (CFC, M109)
* it goes down into material: the cutting formula has no end face
* its tool is not described
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from twin.engagement.along_path import PathRows, engaged_along
from twin.engagement.tool_sections import collision_notes, tool_notes, tool_sections, tools_used, unknown_start
from twin.errors import MachineError, OptimisationError
from twin.machine import MachineFile, Tool
from twin.motion.path import Kind, Path, path_from_moves
from twin.optimisation.spring_passes import touching
from twin.programs import Arc, Linear, Move
from twin.programs.dialect import Dialect, SourceWords
from twin.programs.discovery import dialect_of
from twin.programs.remarks import remarks
from twin.programs.source import source_lines

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
PlannedCuts = Mapping[int, Sequence[Sequence[float]]]
"""Line → [depth mm, entry rad, exit rad] of each of its cuts."""
END_FACE_MM2 = 1e-3
"""An end face that cuts less than this is the rounding of a level move."""
CLEARANCE_MM = 1.0
SHALLOW = 0.02
"""Down to this slope, 1.1°, a ramp is taken for a level cut: its end face takes a fiftieth of the feed."""
DIGITS, HEADING_STEPS = 6, 24
SAME_RATIO = 1e-9
NEAR = "it feeds close to the work, or down beside it, without cutting: an approach"
AT_CONTOUR = "its feed at the tool's centre is not the F word: the control keeps F at the contour"
SPRING = "it runs along the work and cuts nothing by its plan: a spring pass"


@dataclass(frozen=True, slots=True, eq=False)
class FeedLine:
    """A source line that feeds. line: 0-based; executions: (first segment, stop) of each; tool: index into `Programmed.tools`, −1

    feed_mm_min, rpm: as programmed at its first execution; length_mm, cut_mm: of all executions together
    cuts: rows of `Cuts` that belong to it; left_alone: why nothing of it may be changed, empty = both feed and speed are free
    needs_speed: it is left alone, and needs the speed that it was written for
    plunges: its end face cuts
    inch: its F word counts inch/min; plain_feed: its feed is a length a minute, so that an F word of its own says the same
    feed_ratio: its feed over its F word, at its first motion
    """

    line: int
    executions: tuple[tuple[int, int], ...]
    tool: int
    feed_mm_min: float
    rpm: float
    length_mm: float
    cut_mm: float
    cuts: tuple[int, int]
    left_alone: str = ""
    needs_speed: bool = False
    plunges: bool = False
    inch: bool = False
    plain_feed: bool = True
    feed_ratio: float = 1.0

    @property
    def word_mm_min(self) -> float:
        """The F word that gives its feed."""
        return self.feed_mm_min / self.feed_ratio

    @property
    def cutting(self) -> bool:
        """Return True where it meets material."""
        return self.cuts[1] > self.cuts[0]


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """The different cuts of all lines, each (cuts,): rows of engagement that are alike are one. mm and rad.

    line: index of the feed line; heading_rad: of the feed, in steps of 15°, for chatter; 0 where no tool has modes
    """

    line: Ints
    axial_depth_mm: Floats
    entry_angle_rad: Floats
    exit_angle_rad: Floats
    heading_rad: Floats

    def __len__(self) -> int:
        return len(self.line)


NO_CUTS = Cuts(np.empty(0, dtype=np.int64), *(np.empty(0) for _ in range(4)))


@dataclass(frozen=True, slots=True, eq=False)
class Programmed:
    """A program on a machine. tools: those that it uses, with their numbers (0 = [tool])

    dialect: its language
    notes: sentences on what the machine description does not say; collisions: lines (from 1) with a rapid into material
    """

    machine: MachineFile
    text: str
    dialect: Dialect
    path: Path
    lines: tuple[FeedLine, ...]
    cuts: Cuts
    tools: tuple[tuple[int, Tool], ...]
    notes: tuple[str, ...]
    collisions: tuple[int, ...] = ()

    @property
    def words(self) -> SourceWords:
        """Return how its language writes feeds and speeds."""
        return self.dialect.words


def programmed(
    machine: MachineFile,
    text: str,
    *,
    engagement: PlannedCuts | None = None,
    left_alone: Mapping[int, str] = MappingProxyType({}),
) -> Programmed:
    """Reads a program for a machine.

    engagement: what each line (from 0) cuts, taken in place of [stock]: `twin.optimisation.planned`
    left_alone: lines that may not be changed, and why, beyond those that are found out here

    Raises PartProgramError where a control would refuse it, MachineError where nothing is known of what it cuts.
    """
    dialect = dialect_of(text, machine.settings)
    moves, words = dialect.interpret(text, machine.settings), dialect.words
    path = path_from_moves(moves, machine.settings.start_mm or None)
    if engagement is None and machine.stock is None:
        raise MachineError("no [stock]: what a line cuts is not known; give --stock, or a run log with --engagement")
    numbers, tools = tools_used(machine, path)
    sections = tool_sections(numbers, tools, unknown_start(path))
    rows = None if engagement is not None or machine.stock is None else engaged_along(path, machine.stock, sections)
    met = rows.lines_met(path) if rows is not None else frozenset(engagement or ())
    notes = (*remarks(dialect, text, moves, met), *tool_notes(machine, path), *(collision_notes(path, rows) if rows else ()))
    collisions = () if rows is None else tuple(sorted({int(path.line[hit.segment]) + 1 for hit in rows.collisions}))
    speeds = path.commanded_rpm()
    tied = {move.line for move in moves if isinstance(move, Linear | Arc) and move.feed_per_rev_mm is not None}
    ratios = _feed_ratios(moves)
    source = source_lines(text)
    _check_branches(source, words, {move.line for move in moves})
    inch = words.inch_lines(source, machine.settings.inch)
    headed = any(tool.modes for _, tool in tools)
    lines: list[FeedLine] = []
    groups: list[Floats] = []
    near: dict[int, Ints] = {}
    for line, executions in _executions(path).items():
        segments = np.concatenate([np.arange(*span) for span in executions])
        segments = segments[path.kind[segments] != Kind.RAPID]
        if rows is not None:
            found = _cuts_of_segments(path, rows, segments, headed)
        else:
            found = _cuts_planned((engagement or {}).get(line, ()), path, segments, headed)
        one = FeedLine(
            line, executions, int(numbers[segments[0]]), float(path.feed_mm_min[segments[0]]), float(speeds[segments[0]]),
            float(path.length_mm[segments].sum()), found.cut_mm, (0, 0), feed_ratio=ratios[line][0],
        )  # fmt: skip
        why = left_alone.get(line) or _why_not(one, path, tied, numbers[segments], found, speeds[segments])
        why = why or _at_contour(ratios[line]) or _by_its_words(source[line], words, speeds[segments], len(found.rows) > 0)
        if not len(found.rows) and not _is_clear(machine, path, segments, tools, int(numbers[segments[0]])):
            why = why or NEAR
            near[len(lines)] = segments
        in_air = not len(found.rows) and not found.plunges and not path_is_cycle(path, executions) and line not in tied
        lines.append(
            replace(
                one,
                left_alone=why,
                needs_speed=bool(why) and not in_air,
                inch=inch[line],
                plain_feed=_is_plain_feed(source[line], words, one.word_mm_min, inch[line], line in tied),
            )
        )
        groups.append(found.rows)
    if rows is not None and machine.stock is not None:
        lines = _with_spring_passes(lines, near, touching(path, machine.stock, sections, list(near.values())))
    return _numbered(Programmed(machine, text, dialect, path, tuple(lines), NO_CUTS, tuple(tools), notes, collisions), groups)


def _feed_ratios(moves: Sequence[Move]) -> dict[int, list[float]]:
    """Each source line that feeds → its motions' feeds over the F word."""
    ratios: dict[int, list[float]] = {}
    for move in moves:
        if isinstance(move, Linear | Arc):
            ratios.setdefault(move.line, []).append(move.feed_ratio if isinstance(move, Arc) else 1.0)
    return ratios


def _at_contour(ratios: Sequence[float]) -> str:
    """Why a line is left alone whose feed is not its F word; empty = it is."""
    return AT_CONTOUR if any(abs(ratio - 1.0) > SAME_RATIO for ratio in ratios) else ""


def _with_spring_passes(lines: list[FeedLine], near: Mapping[int, Ints], touches: Sequence[bool]) -> list[FeedLine]:
    """The lines; of those near the work, the ones that touch it need the speed that they were written for."""
    made = list(lines)
    for k in (k for k, one in zip(near, touches, strict=True) if one):
        why = SPRING if made[k].left_alone == NEAR else made[k].left_alone
        made[k] = replace(made[k], needs_speed=True, left_alone=why)
    return made


@dataclass(frozen=True, slots=True, eq=False)
class _LineCuts:
    """The cuts of a line. rows: (cuts, 4) depth, entry, exit, heading; cut_mm: way in material; plunges: the end face cuts"""

    rows: Floats
    cut_mm: float
    plunges: bool


def _executions(path: Path) -> dict[int, tuple[tuple[int, int], ...]]:
    """Each source line with a feed move → the runs of segments that it makes, one an execution."""
    stops = {event.segment for event in path.events}
    edges = [0, *(k for k in range(1, len(path)) if path.line[k] != path.line[k - 1] or k in stops), len(path)]
    found: dict[int, list[tuple[int, int]]] = {}
    for a, b in pairwise(edges):
        if b > a and (path.kind[a:b] != Kind.RAPID).any():
            found.setdefault(int(path.line[a]), []).append((a, b))
    return {line: tuple(spans) for line, spans in found.items()}


def _cuts_of_segments(path: Path, rows: PathRows, segments: Ints, headed: bool) -> _LineCuts:
    """headed: whether the heading of the feed matters: to chatter only."""
    every = np.concatenate([np.arange(rows.first[s], rows.first[s + 1]) for s in segments.tolist()])
    segment, mine = rows.segment[every], every[rows.axial_depth_mm[every] > 0.0]
    start, end = path.tip_ends_mm(segment)
    steep = np.maximum(start[:, 2] - end[:, 2], 0.0) > SHALLOW * path.length_mm[segment]
    plunges = bool((steep & (rows.end_face_mm2[every] > END_FACE_MM2)).any())
    heading = np.zeros(len(mine))
    if headed:
        own = rows.segment[mine]
        heading = _headings(path, own, (mine - rows.first[own] + 0.5) / (rows.first[own + 1] - rows.first[own]))
    columns = np.column_stack([rows.axial_depth_mm[mine], rows.entry_angle_rad[mine], rows.exit_angle_rad[mine], heading])
    return _LineCuts(_different(columns), float(rows.length_mm[mine].sum()), plunges)


def _cuts_planned(planned: Sequence[Sequence[float]], path: Path, segments: Ints, headed: bool) -> _LineCuts:
    rows = np.array(planned, dtype=np.float64).reshape(-1, 3)
    heading = _headings_of(path, segments) if headed else np.zeros(1)
    start, end = path.tip_ends_mm(segments)
    steep = np.maximum(start[:, 2] - end[:, 2], 0.0) > SHALLOW * path.length_mm[segments]
    each = np.hstack([np.repeat(rows, len(heading), axis=0), np.tile(heading, len(rows))[:, None]])
    return _LineCuts(each, float(path.length_mm[segments].sum()) if len(rows) else 0.0, len(rows) > 0 and bool(steep.any()))


def _headings_of(path: Path, segments: Ints) -> Floats:
    """All directions of the feed on these segments, in steps of 15°: of an arc those that it sweeps over."""
    count = 1 + 2 * np.ceil(np.abs(path.sweep_rad[segments]) * HEADING_STEPS / (2.0 * np.pi)).astype(np.int64)
    part = (np.concatenate([np.arange(n) for n in count.tolist()]) + 0.5) / np.repeat(count, count)
    return np.unique(_headings(path, np.repeat(segments, count), part))


def _headings(path: Path, segments: Ints, part: Floats) -> Floats:
    """Direction of the feed at a part (0 … 1) of each segment, in steps of 15°."""
    tangent = path.tangents(segments, part * path.length_mm[segments])
    step = 2.0 * np.pi / HEADING_STEPS
    return np.asarray(np.round(np.arctan2(tangent[:, 1], tangent[:, 0]) / step) % HEADING_STEPS * step)


def _different(rows: Floats) -> Floats:
    if len(rows) <= 1:
        return rows
    return np.asarray(rows[np.unique(np.round(rows, DIGITS), axis=0, return_index=True)[1]])


def _why_not(line: FeedLine, path: Path, tied: set[int], tools: Ints, found: _LineCuts, rpm: Floats) -> str:
    """Why a line is left alone; empty = it is not."""
    if line.line in tied:
        return "its feed is tied to the spindle"
    if path_is_cycle(path, line.executions):
        return "its feed is part of a cycle"
    if (tools < 0).any() or len(set(tools.tolist())) > 1:
        return "its tool is not described; write [tools.N]" if (tools < 0).any() else "several tools run it"
    if found.plunges:
        return "it goes down into material, and the cutting formula has no end face"
    if len(found.rows) and (rpm <= 0.0).any():
        return "it cuts with the spindle at rest or backwards"
    return ""


def path_is_cycle(path: Path, executions: Sequence[tuple[int, int]]) -> bool:
    """Return True where one block makes rapids and feeds: only a cycle does."""
    return any((path.kind[a:b] == Kind.RAPID).any() for a, b in executions)


def _by_its_words(text: str, words: SourceWords, rpm: Floats, cuts: bool) -> str:
    """Why a line is left alone for what it says: an expression, probing, or a feed that is no cut (a bar puller, a touch-off)."""
    for place, name in ((words.feed_place(text), "feed"), (words.speed_place(text), "speed")):
        if place is not None and not place.plain:
            return f"its {name} is an expression"
    if words.probes(text):
        return "it is a probing move"
    return "it feeds with the spindle at rest" if not cuts and (rpm == 0.0).any() else ""


def _is_plain_feed(text: str, words: SourceWords, feed_mm_min: float, inch: bool, tied: bool) -> bool:
    """Return True where the feed is what an F word says, in mm or inch a minute: not so in G93 and G95, nor by an expression."""
    place = words.feed_place(text)
    if tied or (place is not None and not place.plain):
        return False
    if place is None:
        return True
    said = words.figure_mm_min(text[place.figure : place.end].replace(" ", ""), inch)
    return abs(said - feed_mm_min) <= 1e-6 * feed_mm_min


def _check_branches(source: list[str], words: SourceWords, run: set[int]) -> None:
    """Raises OptimisationError where a line that was not run would take the feed of a line that is to be changed."""
    if not any(words.branches(source)):
        return
    for number, line in enumerate(source):
        if number not in run and words.takes_feed(line) and words.feed_place(line) is None:
            why = "was not run (a branch, a block skip or a loop), and has no F of its own"
            raise OptimisationError(
                f"line {number + 1} {why}: it would take a feed that is changed before it; write its F, and again"
            )


def _is_clear(machine: MachineFile, path: Path, segments: Ints, tools: Sequence[tuple[int, Tool]], tool: int) -> bool:
    """Return True where a feed in air stays clear of the stock as it was: above it, or beside it by more than tool and clearance.

    Beside it a feed that goes down is not clear: clamps and vice are not described. What is left of the stock would be more
    exact, and a spring pass along a finished wall is air to it.
    """
    stock = machine.stock
    if stock is None or tool < 0:
        return False
    start, end = path.tip_ends_mm(segments)
    ends = np.stack((start, end))
    bulge = np.where(
        path.sweep_rad[segments] != 0.0, path.length_mm[segments], 0.0
    )  # an arc stays within its own length of its ends
    low, high = ends.min(axis=0), ends.max(axis=0)
    reach = tools[tool][1].diameter_mm / 2.0 + CLEARANCE_MM + bulge
    if (low[:, 2] >= stock.max_mm[2] + CLEARANCE_MM).all():
        return True
    if (start[:, 2] - end[:, 2] > SHALLOW * path.length_mm[segments]).any():
        return False
    beside = [(low[:, k] - reach >= stock.max_mm[k]) | (high[:, k] + reach <= stock.min_mm[k]) for k in (0, 1)]
    return bool((beside[0] | beside[1]).all())


def _numbered(made: Programmed, groups: Sequence[Floats]) -> Programmed:
    """With the cuts of all lines one after the other."""
    ends = np.cumsum([0, *(len(rows) for rows in groups)])
    lines = tuple(replace(line, cuts=(int(ends[k]), int(ends[k + 1]))) for k, line in enumerate(made.lines))
    table = np.concatenate([np.empty((0, 4)), *groups])
    owner = np.repeat(np.arange(len(groups)), np.diff(ends))
    return replace(made, lines=lines, cuts=Cuts(owner, *(np.ascontiguousarray(column) for column in table.T)))
