"""The executions of part programs in a machine's history, and which of them repeat each other.

An execution begins where the control becomes ACTIVE after its end or its rest, and ends with PROGRAM_COMPLETED. A control that
never says that has ended a program where it is READY again.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from cnctwin.composing.history import OVERRIDES, PROGRAM, STATE, Between, History, Span

COMPLETED, READY, ACTIVE = "PROGRAM_COMPLETED", "READY", "ACTIVE"
OVER = frozenset({COMPLETED, READY, "STOPPED", None})
"""States in which no program is under way. STOPPED also is one in the middle, where ACTIVE comes after it without a new start."""
PAUSED = frozenset({"FEED_HOLD", "INTERRUPTED", "OPTIONAL_STOP", "PROGRAM_STOPPED", "STOPPED"})
SAME_LENGTH = 0.03
"""Part of its length by which an execution that repeats another may be longer."""
ALONE_S_MIN = 5.0


@dataclass(frozen=True, slots=True)
class Execution(Between):
    """A program that was run.

    program: its name, "" where the control did not say; completed: it came to its end; paused: somebody or something held it
    overridden: an override was moved while it ran
    """

    program: str
    completed: bool
    paused: bool
    overridden: bool

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
