"""A run of kind `program` beside the program it is said to have run: what can be compared, and what cannot and why.

A run log knows no counter of its running time, so pauses are read off the run itself: what the control calls no execution
(FEED_HOLD, STOPPED, …), and axes that stand for longer than a tool change, a spindle or a dwell of the program makes them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.errors import PartProgramError, TwinError
from twin.motion.limits import stops
from twin.motion.path import EventKind, Kind, Path, path_from_moves
from twin.programs import Settings, interpret
from twin.programs.dialect import Dialect
from twin.programs.discovery import dialect_of
from twin.recording.program_run import OVERRIDES, Ending, Pause, ProgramRun
from twin.recording.recorded_program import NOMINAL, RecordedProgram
from twin.recording.visits import by_visit
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
RUNNING = frozenset({"ACTIVE", "READY", "PROGRAM_COMPLETED", ""})
"""States in which no one has stopped the program; READY is that before its start."""
STANDS_TIMES = 1.5
STANDS_MORE_S = 3.0
"""Axes that stand for a tool change, a spindle or a stop have been paused where they do so for 1.5 times as usual, and 3 s."""
PAUSE_LEAST_S = 1.0
WRONG_TOOLS = 2
WAITED_LINES = 5
"""Axes wait for a spindle in one of the lines that follow."""
STEADY_S = 0.5
LEVEL = 0.005
"""A straight block of at least this duration shows its feed, where two rows in it tell the same."""
FEED_OFF = 0.1
"""Feeds of sections that are off by factors further apart than this belong to another program."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A run that can be compared with its program.

    recorded: path (its reference position the nominal one) and run, without pauses; text: of the program
    resolution_s: between two rows of the log; overrides_told: whether the log has overrides; references: it goes to a reference
    remarks: what is to be said of the run
    """

    recorded: RecordedProgram
    text: str
    fitted: bool
    resolution_s: float
    overrides_told: bool
    references: bool
    remarks: tuple[str, ...]

    @property
    def name(self) -> str:
        """That of the run."""
        return self.recorded.name

    def told_s(self, begin: Floats) -> Floats:
        """When what a recorder told at the times `begin` happened: half the time between two rows earlier; the start is known."""
        return np.where(begin > 0.0, begin - 0.5 * self.resolution_s, 0.0)

    @property
    def sections(self) -> tuple[tuple[int, str], ...]:
        """First line and name of each section: from one tool change to the next, else a tenth of the lines each."""
        changes = self.recorded.tool_changes
        if len(changes) > 1:
            return tuple((0 if n == 0 else line, f"section T{tool}") for n, (line, tool) in enumerate(changes))
        last = int(self.recorded.path.line.max(initial=0)) + 1
        edges = np.unique(np.linspace(0, last, 11).astype(int)[:-1])
        return tuple((int(edge), f"lines from {int(edge) + 1}") for edge in edges)


@dataclass(frozen=True, slots=True)
class Refused:
    """A run that cannot be compared, and why: the rest of a sentence that begins with its name."""

    name: str
    why: str


@dataclass(frozen=True, slots=True)
class _Shown:
    """The text of a program as lines, and the line of each visit of them, by which places are named."""

    lines: tuple[str, ...]
    source: Ints

    def line(self, visit: int) -> int:
        """Return the line of a visit; one that is beyond all of them is as far beyond the last line."""
        beyond = visit - len(self.source) + 1
        return int(self.source[visit]) if 0 <= visit < len(self.source) else int(self.source.max()) + beyond if beyond > 0 else -1

    def words(self, visit: int) -> str:
        """Return line and text of a visit, in words."""
        line = self.line(visit)
        return f"line {line + 1} ({self.lines[line].strip()[:24]})" if 0 <= line < len(self.lines) else "no line of the program"


def trial_of(run: Run, settings: Settings) -> Trial | Refused:
    """The run beside its program as the control reads it, or why there is nothing to compare."""
    if run.entry.program is None:
        return Refused(run.name, "the case names no program for it; `program` of [[runs]] is the NC file that it ran")
    try:
        text = (run.folder / run.entry.program).read_text(encoding="utf-8")
        log = run.log
        return _compared(run.name, log, text, run.entry.role == "fit", settings)
    except PartProgramError as error:
        return Refused(run.name, f"cannot be compared: the program given is refused, {error}")
    except (TwinError, OSError, UnicodeDecodeError) as error:
        return Refused(run.name, str(error))


def _compared(name: str, log: RunLog, text: str, fitted: bool, settings: Settings) -> Trial | Refused:
    if not log.has("line"):
        return Refused(name, "has no column line, so that nothing says what was executed when")
    if len(log) < 2:
        return Refused(name, "has a single row")
    path, references = _path(text, settings)
    if not len(path):
        return Refused(name, "its program moves nothing")
    if not np.all(path.feed_mm_min > 0.0):
        return Refused(name, f"its program has no feed at line {int(path.line[path.feed_mm_min <= 0.0][0]) + 1}")
    lines = tuple(text.splitlines())
    indices = _line_indices(log["line"], text, dialect_of(text, settings), path)
    path, line, source = by_visit(path, indices, len(lines))
    shown = _Shown(lines, source)
    run = _run(log, line, path)
    recorded = RecordedProgram(name, path, run)
    last = int(np.asarray(run.columns["line"]).max())
    if run.ending is Ending.ABORTED:
        return Refused(name, _interrupted(run, last, shown))
    if why := recorded.refusal():
        return Refused(name, _other(recorded, last, why, shown))
    if why := _other_tools(recorded):
        return Refused(name, why)
    told = any(log.has(column) for column in OVERRIDES.values())
    if why := _other_feeds(recorded, told):
        return Refused(name, why)
    remarks = (_paused(run, shown),) if run.pauses else ()
    return Trial(recorded, text, fitted, float(np.median(np.diff(log.t_s))), told, references, remarks)


def _path(text: str, settings: Settings) -> tuple[Path, bool]:
    """The path, and whether it goes to a reference position that nobody has stated; then it starts there too."""
    settings = replace(settings, optional_stop=True)
    if not settings.references_mm:
        place = (0.0, 0.0, NOMINAL.reference_z)
        path = path_from_moves(interpret(text, replace(settings, start_mm=place, references_mm=(place,))), place)
        if bool(np.any(path.end_mm[:, 2] == NOMINAL.reference_z)):
            return path, True
    return path_from_moves(interpret(text, settings), settings.start_mm or None), False


def _run(log: RunLog, line: Ints, path: Path) -> ProgramRun:
    """The run log as a run of a program."""
    rows = len(log)
    t = log.t_s - log.t_s[0]
    state = np.array(["" if s is None else str(s) for s in log.text.get("exec_state", np.full(rows, ""))], dtype=np.str_)
    columns: dict[str, NDArray[np.generic]] = {"t_s": t, "line": line, "exec_state": state}
    for column in ("feed_mm_min", *OVERRIDES.values()):
        columns[column] = log.columns.get(column, np.full(rows, np.nan))
    tool = log.columns.get("tool_number", np.full(rows, np.nan))
    columns["tool_number"] = np.where(np.isfinite(tool), tool, -1.0).astype(np.int64)
    last = max((event.line for event in path.events), default=int(path.line.max()))
    told = "exec_state" in log.text
    ended = "PROGRAM_COMPLETED" in state if told else int(line.max()) >= last
    run = ProgramRun(None, 0.0, float(t[-1]), Ending.COMPLETED if ended else Ending.ABORTED, (), columns)
    return replace(run, pauses=_pauses(columns, path))


def _line_indices(recorded: Floats, text: str, dialect: Dialect, path: Path) -> Ints:
    """Lines as indices of the text; N words where the figures go beyond its end and are N words.

    Where a control numbers every block, its numbers are taken if more rows are then in lines that do something.
    """
    line = np.where(np.isfinite(recorded), recorded, -1.0).astype(np.int64)
    lines = text.splitlines()
    words = {
        number: index for index, text_line in enumerate(lines) if (number := dialect.words.block_number(text_line)) is not None
    }
    if line.max() >= len(lines) and all(n in words for n in np.unique(line[line >= 0]).tolist()):
        return np.array([words.get(n, -1) for n in line.tolist()], dtype=np.int64)
    if dialect.blocks_are_numbered:
        doing = [*path.line.tolist(), *(event.line for event in path.events)]
        by_number = np.array([words.get(n, -1) for n in line.tolist()], dtype=np.int64)
        if np.isin(by_number, doing).mean() > np.isin(line, doing).mean():
            return by_number
    return line


def _pauses(columns: Mapping[str, NDArray[np.generic]], path: Path) -> tuple[Pause, ...]:
    """Return where the program did not advance, though it could have."""
    t, line = np.asarray(columns["t_s"], dtype=np.float64), np.asarray(columns["line"], dtype=np.int64)
    held = ~np.isin(np.asarray(columns["exec_state"]), list(RUNNING))
    feed = np.asarray(columns["feed_mm_min"], dtype=np.float64)
    still = held | (feed == 0.0)
    stand = [(a, b) for a, b in _stretches(still) if t[b] > t[a]]
    waits = np.array(
        sorted({event.line + n for event in path.events if stops(event) for n in range(WAITED_LINES)}), dtype=np.int64
    )
    dwell = {event.line: event.value for event in path.events if event.kind == EventKind.DWELL}
    at_event = [bool(np.any((waits >= line[a:b].min()) & (waits <= line[b]))) for a, b in stand]
    usual = [t[b] - t[a] for (a, b), event in zip(stand, at_event, strict=True) if event and not held[a:b].any()]
    typical = float(np.median(usual)) if usual else 0.0
    found = []
    for (a, b), event in zip(stand, at_event, strict=True):
        expected = (typical if event else 0.0) + sum(s for at, s in dwell.items() if line[a] <= at <= line[b])
        lasted = float(t[b] - t[a])
        if held[a:b].any() or lasted > STANDS_TIMES * expected + STANDS_MORE_S:
            lost = lasted - min(expected, lasted)
            if lost > PAUSE_LEAST_S:
                start = _longest_row(t, a, b, lost)
                found.append(Pause(start, start + lost, _reason(np.asarray(columns["exec_state"])[a:b], held[a:b])))
    return tuple(found)


def _stretches(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row of each stretch of `flags`, and the row after its last (the last row where it goes to the end)."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), min(int(b), len(flags) - 1)) for a, b in edge.reshape(-1, 2)]


def _longest_row(t: Floats, a: int, b: int, lost: float) -> float:
    """Return where a pause of `lost` seconds in the rows a to b begins: in the row that lasts longest, as far as it fits."""
    longest = a + int(np.argmax(np.diff(t[a : b + 1])))
    return float(max(t[a], min(t[longest], t[b] - lost)))


def _reason(state: NDArray[np.generic], held: NDArray[np.bool_]) -> str:
    return str(state[held][0]) if held.any() else "axes at rest"


def _paused(run: ProgramRun, shown: _Shown) -> str:
    """In words: how often, how long, and where the longest was."""
    longest = max(run.pauses, key=lambda pause: pause.duration_s)
    row = int(np.searchsorted(run.t_s, longest.start_s + 0.5 * longest.duration_s)) - 1
    line = int(np.asarray(run.columns["line"])[max(row, 0)])
    total = sum(pause.duration_s for pause in run.pauses)
    many = f"{len(run.pauses)} times, {total:.0f} s in all; longest" if len(run.pauses) > 1 else "once,"
    return f"was interrupted {many} {longest.duration_s:.0f} s ({longest.reason}) at {shown.words(line)}; taken out"


def _interrupted(run: ProgramRun, last: int, shown: _Shown) -> str:
    """A run that never came to its end."""
    state = [str(s) for s in np.asarray(run.columns["exec_state"]) if s not in RUNNING]
    why = f", {state[-1]} in the end" if state else ""
    return f"was interrupted and not finished: it came to {shown.words(last)} in {run.duration_s:.0f} s{why}; left out"


def _other(recorded: RecordedProgram, last: int, why: str, shown: _Shown) -> str:
    """A run whose lines or tools are not those of the program."""
    end = max((event.line for event in recorded.path.events), default=0)
    if not why.startswith("ran to"):
        return f"ran another program than the one given: {why.removesuffix(': another program ran')}; left out"
    ran = f"it ended at line {shown.line(last) + 1}, the program given ends at {shown.words(end)}"
    return f"ran another program than the one given: {ran}; left out"


def _other_tools(recorded: RecordedProgram) -> str:
    """A run that spent most of two sections with other tools than theirs: an operator may rename one, not two."""
    run, changes = recorded.run, recorded.tool_changes
    line, tool = np.asarray(run.columns["line"]), np.asarray(run.columns["tool_number"])
    lasts = np.diff(run.t_s, append=run.t_s[-1]) * (np.asarray(run.columns["feed_mm_min"], dtype=np.float64) > 0.0)
    wrong = []
    for (first, number), (following, _) in zip(changes, [*changes[1:], (int(line.max()) + 1, 0)], strict=True):
        here = (line >= first) & (line < following) & (tool > 0)
        if 2.0 * float(lasts[here & (tool == number)].sum()) < float(lasts[here].sum()):
            wrong.append(number)
    if len(wrong) < WRONG_TOOLS:
        return ""
    shown = " and ".join(f"T{number}" for number in wrong[:3])
    return f"ran another program than the one given: where that works with {shown}, other tools were in the spindle; left out"


def _other_feeds(recorded: RecordedProgram, told: bool) -> str:
    """A run whose feeds are off by another factor in one section than in the next: no knob does that by itself."""
    ratios = section_feed_ratios(recorded)
    if len(ratios) < 2 or max(ratios.values()) < (1.0 + FEED_OFF) * min(ratios.values()):
        return ""
    told_words = "with its overrides taken into account" if told else "and no override was recorded"
    shown = ", ".join(f"T{tool} {100.0 * ratio:.0f} %" for tool, ratio in ratios.items())
    return f"ran another program than the one given: its feeds are {shown} of the programmed ones, {told_words}; left out"


def section_feed_ratios(recorded: RecordedProgram) -> dict[int, float]:
    """Recorded feed over programmed feed times recorded override by tool, where blocks last long enough to show it."""
    path, run = recorded.path, recorded.run
    line, feed = np.asarray(run.columns["line"]), np.asarray(run.columns["feed_mm_min"], dtype=np.float64)
    override, _ = recorded.overrides()
    long = (path.kind == Kind.LINE) & (path.length_mm > STEADY_S / 60.0 * path.feed_mm_min)
    changes: Sequence[tuple[int, int]] = recorded.tool_changes or ((0, 0),)
    starts = np.array([at for at, _ in changes])
    seen: dict[int, list[float]] = {}
    for k in np.flatnonzero(long):
        here = feed[(line == path.line[k]) & (feed > 0.0)]
        level = here[1:][np.abs(np.diff(here)) < LEVEL * here[1:]]
        if len(level) and np.sum(path.line == path.line[k]) == 1:
            tool = changes[max(int(np.searchsorted(starts, path.line[k], side="right")) - 1, 0)][1]
            seen.setdefault(tool, []).append(float(level.max() / (path.feed_mm_min[k] * override[k])))
    return {tool: float(np.median(ratios)) for tool, ratios in seen.items() if len(ratios) >= 3}
