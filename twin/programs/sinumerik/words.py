"""The parts of a block with their values, sorted by what they are for."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.codes import GROUPS, PASSED_OVER, PASSED_OVER_CALLS
from twin.programs.sinumerik.language.functions import Value, as_number, as_whole
from twin.programs.sinumerik.language.syntax import Assignment, Invocation, Name, Part, Word
from twin.programs.sinumerik.variables import Variables

M_MAX: Final = 99_999_999
ONE_SPINDLE: Final = frozenset("MS")
BY_AXIS: Final = frozenset({"FL", "ACC", "VELOLIM", "FA", "SCC"})


@dataclass(frozen=True, slots=True)
class Given:
    """The value of a word: mode as AC or IC, "" without; the word as written."""

    value: Value
    mode: str
    text: str

    @property
    def number(self) -> float:
        return as_number(self.value, self.text)

    def whole(self, low: int, high: int) -> int:
        """The value, if it is a whole number from `low` to `high`."""
        found = self.number
        if not (found.is_integer() and low <= found <= high):
            raise RefusedError(self.text, f"has to be a whole number from {low} to {high}")
        return int(found)


@dataclass(slots=True)
class Words:
    """The words of a block. codes: the G code of each group; written: the same as written; calls: subprograms and cycles."""

    codes: dict[str, str] = field(default_factory=dict)
    written: dict[str, str] = field(default_factory=dict)
    values: dict[str, Given] = field(default_factory=dict)
    m: list[int] = field(default_factory=list)
    calls: list[Name | Invocation] = field(default_factory=list)

    def number(self, name: str) -> float:
        return self.values[name].number


def evaluated(parts: tuple[Part, ...], variables: Variables, assign: Callable[[Assignment], None]) -> Words:
    """The words of a block with their values now; its assignments are made in their order."""
    words = Words()
    for part in parts:
        if isinstance(part, Word):
            add_word(words, part, variables)
        elif isinstance(part, Assignment):
            assign(part)
        elif isinstance(part, Invocation):
            if part.name not in PASSED_OVER_CALLS:
                words.calls.append(part)
        elif part.name in GROUPS:
            group = GROUPS[part.name]
            if group in words.codes and words.codes[group] != part.name:
                raise RefusedError(part.text, f"cannot stand in one block with {words.written[group]}; write two blocks")
            words.codes[group], words.written[group] = part.name, part.text
        elif part.name not in PASSED_OVER and part.name not in PASSED_OVER_CALLS:
            words.calls.append(part)
    return words


def add_word(words: Words, part: Word, variables: Variables) -> None:
    """Take one more word; RefusedError where it cannot stand beside the others."""
    given = Given(part.value(variables), part.mode, part.text)
    if part.extension is not None and part.name not in BY_AXIS:
        extension = as_whole(part.extension(variables), part.text)
        if part.name in ONE_SPINDLE and extension not in (0, 1):
            raise RefusedError(part.text, "the twin has one spindle, number 1")
        if part.name == "D" or extension not in (0, 1):
            raise RefusedError(part.text, "this extension is not read")
    if part.name == "M":
        words.m.append(given.whole(0, M_MAX))
        return
    if part.name in words.values:
        raise RefusedError(part.text, f"{part.name} stands twice in this block; write it once")
    words.values[part.name] = given
