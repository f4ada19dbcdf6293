"""The tool that can be in the spindle when a block of a program runs: reaching definitions over its labels, calls and jumps.

A `TOOL CALL` defines the tool. What reaches a block is the set of definitions that some way through the program brings there:

* a call (`CALL LBL 3`) brings what the body of the label makes of the tool, and nothing if the body has no tool call;
* a body is reached from each of its calls, so under five calls with five tools each block of it has five;
* a repeat (`CALL LBL 1 REP 4`) and a jump (`FN 9 … GOTO LBL 1`) go both ways; M2, M30 and END PGM end the way;
* a block that may be skipped (`/`) is both done and not done.

Where all ways bring the same tool, it is known. Else the caller knows more (which tool it saw last) or it is not known. Words
that are no tool number stand for themselves: a tool called by its name or by a Q parameter, a called program that may change
the tool (`PROGRAM_CALLED`), and what was in the spindle when the program began (`BEFORE`).

The speed that `TOOL CALL … S` commands is followed in the same way.
"""

import re
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from edge.controls.heidenhain.klartext import Kind, Program, Step, read_program

BEFORE = "no TOOL CALL before this block"
PROGRAM_CALLED = "a called program may have changed it"
_IN = "\x00"  # in the body of a label: whatever its caller brings
VISITS_MAX = 100_000
Token = int | float | str
Tokens = frozenset[Token]
Definition = Callable[[Step], Token | None]
NOTHING: Tokens = frozenset()


@dataclass(frozen=True, slots=True)
class Flow:
    """The tools that reach the blocks: before and after each step, in the order of their numbers."""

    numbers: tuple[int, ...] = ()
    before: tuple[Tokens, ...] = ()
    after: tuple[Tokens, ...] = ()
    fault: str = ""

    def at(self, number: int) -> Tokens:
        """Return what reaches this block, before it is done."""
        if self.fault:
            return frozenset({self.fault})
        index = bisect_left(self.numbers, number)
        if index < len(self.numbers) and self.numbers[index] == number:
            return self.before[index]
        return self.after[index - 1] if index else frozenset({BEFORE})


def tool_of(step: Step) -> Token | None:
    """The tool that a block calls: its number, or a word where it is none; None where it calls none."""
    if step.kind is Kind.PROGRAM:
        return PROGRAM_CALLED
    if step.kind is not Kind.TOOL_CALL or not step.word:
        return None
    if found := re.fullmatch(r"(\d{1,5})(?:\.\d+)?", step.word):
        return int(found[1])
    if step.word.startswith('"'):
        return f"tool {step.word}, which is called by its name"
    return f"the tool of {step.word}, which block {step.number} calls"


def speed_of(step: Step) -> Token | None:
    """The spindle speed that a tool call commands."""
    if step.kind is Kind.PROGRAM:
        return PROGRAM_CALLED
    if step.kind is not Kind.TOOL_CALL or not step.speed:
        return None
    if re.fullmatch(r"[+-]?\d+\.?\d*", step.speed):
        return float(step.speed)
    return f"the speed of {step.speed}, which block {step.number} commands"


@lru_cache(maxsize=16)
def flow_of(text: str, definition: Definition) -> Flow:
    """Return what reaches the blocks of this program.

    >>> flow = flow_of("0 BEGIN PGM P MM\\n1 TOOL CALL 5 Z S100\\n2 L X+1\\n3 END PGM P MM\\n", tool_of)
    >>> set(flow.at(1)), set(flow.at(2))
    ({'no TOOL CALL before this block'}, {5})
    """
    program = read_program(text)
    if program.fault:
        return Flow(fault=program.fault)
    return _Analysis(program, definition).flow()


class _Analysis:
    """One run. A context is the program itself ("") or the body of a label as its callers see it."""

    def __init__(self, program: Program, definition: Definition) -> None:
        self._steps = program.steps
        self._made = tuple(definition(step) for step in program.steps)
        self._labels: dict[str, int] = {}
        for index, step in enumerate(program.steps):
            if step.kind is Kind.LABEL and step.word != "0":
                self._labels.setdefault(step.word, index)
        self._before: dict[tuple[str, int], Tokens] = {}
        self._fall: dict[tuple[str, int], Tokens] = {}
        self._bodies: dict[str, Tokens] = {}
        self._callers: dict[str, set[tuple[str, int]]] = {}
        self._due: list[tuple[str, int]] = []

    def flow(self) -> Flow:
        """Follow the program to the fixed point; a fault where that is out of bounds."""
        unknown = next(
            (s for s in self._steps if s.kind in (Kind.CALL, Kind.REPEAT, Kind.JUMP) and s.word not in self._labels), None
        )
        if unknown is not None:
            return Flow(fault=f"block {unknown.number} goes to label {unknown.word}, which cannot be found")
        self._bring("", 0, frozenset({BEFORE}))
        visits = 0
        while self._due:
            visits += 1
            if visits > VISITS_MAX:
                return Flow(fault="the program has too many ways to be followed")
            self._visit(*self._due.pop())
        entries = self._entries()
        contexts = ["", *self._callers]
        before = [NOTHING] * len(self._steps)
        after = [NOTHING] * len(self._steps)
        for context in contexts:
            brought = entries.get(context, NOTHING)
            for index in range(len(self._steps)):
                before[index] |= _put(self._before.get((context, index), NOTHING), brought)
                after[index] |= _put(self._fall.get((context, index), NOTHING), brought)
        return Flow(tuple(step.number for step in self._steps), tuple(before), tuple(after))

    def _bring(self, context: str, index: int, tokens: Tokens) -> None:
        """These definitions reach this step."""
        key = context, index
        if index < len(self._steps) and (key not in self._before or not tokens <= self._before[key]):
            self._before[key] = self._before.get(key, NOTHING) | tokens
            self._due.append(key)

    def _visit(self, context: str, index: int) -> None:
        step, made, tokens = self._steps[index], self._made[index], self._before[context, index]
        falls = tokens if made is None else frozenset({made}) | (tokens if step.may_skip or made == PROGRAM_CALLED else NOTHING)
        if step.kind is Kind.CALL:
            self._enter(step.word, (context, index))
            falls = _put(self._bodies.get(step.word, NOTHING), tokens) | (tokens if step.may_skip else NOTHING)
        elif step.kind in (Kind.REPEAT, Kind.JUMP):
            self._bring(context, self._labels[step.word], tokens)
        elif step.kind is Kind.END and not step.may_skip:
            falls = NOTHING
        elif step.kind is Kind.LABEL and step.word == "0" and context:
            self._returned(context, tokens)
            falls = NOTHING
        self._fall[context, index] = falls
        if falls:
            self._bring(context, index + 1, falls)

    def _enter(self, label: str, caller: tuple[str, int]) -> None:
        callers = self._callers.setdefault(label, set())
        if not callers:
            self._bring(label, self._labels[label], frozenset({_IN}))
        callers.add(caller)

    def _returned(self, label: str, tokens: Tokens) -> None:
        if not tokens <= self._bodies.get(label, NOTHING):
            self._bodies[label] = self._bodies.get(label, NOTHING) | tokens
            self._due.extend(self._callers[label])

    def _entries(self) -> dict[str, Tokens]:
        """Return what the callers of each label bring, through callers of callers."""
        entries = dict.fromkeys(self._callers, NOTHING)
        changed = True
        while changed:
            changed = False
            for label, callers in self._callers.items():
                for context, index in callers:
                    brought = _put(self._before[context, index], entries.get(context, NOTHING))
                    if not brought <= entries[label]:
                        entries[label] |= brought
                        changed = True
        return entries


def _put(tokens: Tokens, brought: Tokens) -> Tokens:
    """Put what the caller brings in place of the word that stands for it."""
    return tokens if _IN not in tokens else (tokens - {_IN}) | brought
