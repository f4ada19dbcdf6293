"""The executions of part programs in a machine's history, and which of them repeat each other.

An execution begins where the control becomes ACTIVE after its end or its rest, and ends with PROGRAM_COMPLETED. A control that
never says that has ended a program where it is READY again.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cnctwin.composing.history import OVERRIDES, PROGRAM, STATE, History, Span
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_text

COMPLETED, READY, ACTIVE = "PROGRAM_COMPLETED", "READY", "ACTIVE"
OVER = frozenset({COMPLETED, READY, "STOPPED", None})
"""States in which no program is under way. STOPPED also is one in the middle, where ACTIVE comes after it without a new start."""
PAUSED = frozenset({"FEED_HOLD", "INTERRUPTED", "OPTIONAL_STOP", "PROGRAM_STOPPED", "STOPPED"})
SAME_LENGTH = 0.03
"""Part of its length by which an execution that repeats another may be longer."""
ALONE_S_MIN = 5.0
SUFFIXES = ("", ".nc", ".mpf", ".h", ".eia", ".min", ".tap", ".txt")
_WORD = re.compile(r"^[%\s]*([O:]\s*0*\d+|BEGIN PGM \S+)", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Execution:
    """A program that was run.

    program: its name, "" where the control did not say; completed: it came to its end; paused: somebody or something held it
    overridden: an override was moved while it ran
    """

    from_ms: int
    to_ms: int
    program: str
    completed: bool
    paused: bool
    overridden: bool

    @property
    def span_ms(self) -> Span:
        """Its beginning and its end."""
        return self.from_ms, self.to_ms

    @property
    def seconds(self) -> float:
        """Its length."""
        return (self.to_ms - self.from_ms) / 1000.0

    def repeats(self, other: "Execution") -> bool:
        """Return True where it is the same program, run to its end as the other was, untouched."""
        if not self.program or self.program != other.program or abs(self.seconds - other.seconds) > SAME_LENGTH * other.seconds:
            return False
        return all(e.completed and not e.paused and not e.overridden for e in (self, other))


def executions_of(history: History) -> list[Execution]:
    """Return the executions in a history, in order; what had begun before it is not one."""
    states = list(history.course(STATE).pieces((history.from_ms, history.to_ms)))
    says_completed = any(state == COMPLETED for _, _, state in states)
    found: list[Execution] = []
    begun: int | None = None
    before: object = "none yet"
    for a, b, state in states:
        if state == ACTIVE and begun is None and before in OVER and a > history.from_ms:
            begun = a
        ends = state in (COMPLETED, READY, None)
        if begun is not None and (ends or b == history.to_ms):
            # the moment at which its end was told belongs to it
            end = min(a + 1, history.to_ms) if ends else b
            if end - begun >= 1000 * ALONE_S_MIN:
                found.append(_execution(history, (begun, end), state == COMPLETED or (state == READY and not says_completed)))
            begun = None
        before = state
    return found


def _execution(history: History, span_ms: Span, completed: bool) -> Execution:
    names = [v for v in history.course(PROGRAM).within(span_ms) if isinstance(v, str) and v]
    paused = any(state in PAUSED for state in history.course(STATE).within(span_ms))
    moved = any(len(set(history.course(name).within(span_ms))) > 1 for name in OVERRIDES)
    return Execution(*span_ms, str(names[-1]) if names else "", completed, paused, moved)


def pairs(executions: Iterable[Execution]) -> dict[Execution, Execution]:
    """Return of each execution that repeats an earlier one the latest that it repeats."""
    found: dict[Execution, Execution] = {}
    seen: list[Execution] = []
    for one in executions:
        earlier = next((e for e in reversed(seen) if one.repeats(e)), None)
        if earlier is not None:
            found[one] = earlier
        seen.append(one)
    return found


class ProgramFolder:
    """The NC files of a plant, found by the name that the control gives a program."""

    def __init__(self, folder: Path | None) -> None:
        """Raises UsageError where it is no folder."""
        if folder is not None and not folder.is_dir():
            raise UsageError(f"{folder}: is no folder; give the one with the NC files of the programs")
        self._folder = folder

    @cached_property
    def _files(self) -> dict[str, Path]:
        files = {} if self._folder is None else {p.name.casefold(): p for p in sorted(self._folder.iterdir()) if p.is_file()}
        by_word: dict[str, Path] = {}
        for path in files.values():
            if path.suffix.casefold() in SUFFIXES:
                by_word |= dict.fromkeys(_words(read_text(path)[:2000]), path)
        return by_word | files

    def text_of(self, program: str) -> str | None:
        """Return the text of a program; None where the folder has none of that name."""
        path = next((self._files[name] for name in _names(program) if name in self._files), None)
        return None if path is None else read_text(path)


def _names(program: str) -> Iterator[str]:
    """Yield the file names, in small letters, under which a program may be kept."""
    name = re.split(r"[/\\]", program.strip())[-1].casefold()
    stem = name.rpartition(".")[0] or name
    for one in dict.fromkeys((name, stem)):
        yield from (f"{one}{suffix}" for suffix in SUFFIXES)
        if match := re.fullmatch(r"[o:]?0*(\d+)", one):
            yield from (f"o{match[1]}{suffix}" for suffix in SUFFIXES)


def _words(text: str) -> Iterator[str]:
    """Yield the name that a program gives itself: `o1701` of O1701, as `_names` writes it."""
    if match := _WORD.search(text):
        digits = re.sub(r"\D", "", match[1]).lstrip("0") if not match[1].upper().startswith("BEGIN") else ""
        yield f"o{digits}" if digits else match[1].split()[-1].casefold()
