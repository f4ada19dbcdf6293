"""The order of blocks: jumps, structures, repetitions, calls and returns."""

from dataclasses import dataclass, field
from typing import Final

from twin.programs.jumps import JumpCount
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings
from twin.programs.sinumerik.language.functions import Value, as_text, as_whole, is_true
from twin.programs.sinumerik.language.syntax import (
    Assignment,
    Case,
    Definition,
    Invocation,
    Jumps,
    Name,
    Repeat,
    Target,
)
from twin.programs.sinumerik.language.text import Section, Text
from twin.programs.sinumerik.variables import Cell, Variables

SKIPPED_NAME_MAX: Final = 40


@dataclass(slots=True)
class Region:
    """Blocks that are run again: from `start` up to before `stop`, then on at `back`."""

    start: int
    stop: int
    back: int
    left: int


@dataclass(slots=True)
class Level:
    """A running program: where it is, what it repeats, its variables, and what its end hands back.

    given, sources: values of the call, and the variables of the caller that they come from; handed_back: names of VAR parameters
    with their places; is_bound: PROC was read, or passed; saved: what SAVE restores
    """

    text: Text
    section: Section
    at: int
    local: dict[str, Cell] = field(default_factory=dict)
    repeats_left: int = 0
    given: tuple[Value | None, ...] = ()
    sources: tuple[tuple[str, tuple[Value, ...]] | None, ...] = ()
    handed_back: list[tuple[str, int]] = field(default_factory=list)
    is_bound: bool = False
    regions: list[Region] = field(default_factory=list)
    is_modal: bool = False
    saves: bool = False
    saved: object = None


class Flow(JumpCount):
    """The stack of running programs, the innermost last, and the counts that bound them."""

    __slots__ = ("levels", "modal", "texts", "variables")

    def __init__(self, text: Text, settings: Settings, variables: Variables) -> None:
        super().__init__(settings)
        self.variables = variables
        self.texts: dict[str, Text] = {}
        main = text.main
        self.levels = [Level(text, main, main.start, variables.local)]
        self.modal: Name | Invocation | None = None

    @property
    def level(self) -> Level:
        return self.levels[-1]

    def jump(self, target: Target) -> None:
        """Go on at a label or a block number of the running program; GOTOC goes on behind its block where there is none."""
        level = self.level
        self.count()
        if target.direction == "GOTOS":
            level.at = level.section.start
            level.regions.clear()
            level.local.clear()
            return
        label = f"N{target.number}" if target.number is not None else target.label
        if target.made is not None:
            label = as_text(target.made(self.variables)).upper()
        places = level.text.places(level.section, label)
        if not places and target.label in self.variables.local:
            label = as_text(self.variables.read(target.label, (), target.label)).upper()
            places = level.text.places(level.section, label)
        ahead = [place for place in places if place > level.at]
        behind = [place for place in places if place <= level.at]
        order = {"GOTOF": ahead[:1], "GOTOB": behind[-1:]}.get(target.direction, ahead[:1] or behind[-1:])
        if order:
            level.at = order[0]
            self.leave_regions()
        elif target.direction == "GOTOC":
            level.at += 1
        else:
            way = {"GOTOF": " from here to the end", "GOTOB": " from here to the beginning"}.get(target.direction, "")
            raise RefusedError(label[:SKIPPED_NAME_MAX], f"there is no such label in this program{way}")

    def leave_regions(self) -> None:
        """A jump out of a repetition ends it."""
        level = self.level
        while level.regions and not level.regions[-1].start <= level.at <= level.regions[-1].stop:
            level.regions.pop()

    def end_of_region(self) -> bool:
        """Return True where the running repetition is at its end, and go on with it or behind it."""
        level = self.level
        if not level.regions or level.at != level.regions[-1].stop:
            return False
        region = level.regions[-1]
        if region.left > 0:
            self.count()
            region.left -= 1
            level.at = region.start
        else:
            level.regions.pop()
            level.at = region.back
        return True

    def jumps_of(self, statement: Jumps) -> None:
        for condition, target in statement.choices:
            if condition is None or is_true(condition(self.variables), "IF"):
                self.jump(target)
                return
        self.level.at += 1

    def case(self, statement: Case) -> None:
        value = statement.value(self.variables)
        for choice, target in statement.choices:
            if choice(self.variables) == value:
                self.jump(target)
                return
        if statement.otherwise is None:
            self.level.at += 1
        else:
            self.jump(statement.otherwise)

    def repeat(self, statement: Repeat) -> None:
        """REPEAT, REPEATB: run blocks again, then go on behind this one."""
        level, times = self.level, 1
        if statement.times is not None:
            times = as_whole(statement.times(self.variables), "P")
        if not 0 <= times <= self.settings.repeats_max:
            raise RefusedError("P", f"repeats from 0 to {self.settings.repeats_max} times")
        start = self.label(statement.begin)
        if statement.word == "REPEATB":
            stop = start + 1
        elif statement.end:
            stop = self.label(statement.end) + 1
        else:
            closing = [place for place in level.text.places(level.section, "ENDLABEL") if place >= start]
            stop = closing[0] if closing else level.at
        if stop <= start:
            raise RefusedError(statement.begin, "the blocks to repeat end before they begin")
        if start <= level.at < stop:
            raise RefusedError(statement.word, "cannot repeat itself")
        if len(level.regions) >= self.settings.call_depth_max:
            raise RefusedError(statement.word, "too many repetitions one in another")
        if times == 0:
            level.at += 1
            return
        self.count()
        level.regions.append(Region(start, stop, level.at + 1, times - 1))
        level.at = start

    def label(self, name: str) -> int:
        """The line of a label: before this block the nearest, else behind it."""
        level = self.level
        places = level.text.places(level.section, name)
        if not places:
            raise RefusedError(name, "there is no such label in this program")
        before = [place for place in places if place < level.at]
        return before[-1] if before else places[0]

    def define(self, statement: Definition) -> None:
        for one in statement.declared:
            sizes = tuple(size(self.variables) for size in one.sizes)
            self.variables.define(one.kind, one.name, sizes, one.text)
            if one.first is not None:
                self.assign(one.first, everywhere=bool(sizes) and not one.first.is_set)

    def assign(self, statement: Assignment, everywhere: bool = False) -> None:
        """`R1=5`. everywhere: one value for the whole array, as DEF gives it."""
        target, variables = statement.target, self.variables
        values = [value(variables) for value in statement.values]
        at = target.at(variables)
        if statement.is_set or everywhere:
            variables.fill(target.name, at, values, statement.is_repeated or everywhere, target.text)
        else:
            variables.write(target.name, at, values[0], target.text)
