"""The order of blocks: jumps, structures, repetitions, calls and returns."""

from dataclasses import dataclass, field
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings
from twin.programs.sinumerik.expressions import Expression
from twin.programs.sinumerik.functions import Value, as_number, as_text, as_whole, is_true
from twin.programs.sinumerik.syntax import (
    Assignment,
    Case,
    Definition,
    Invocation,
    Jumps,
    Name,
    Procedure,
    Repeat,
    Structure,
    Target,
)
from twin.programs.sinumerik.text import Section, Text, program_name
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

    references: for each VAR parameter its name, and the caller's variable; saved: what SAVE restores
    """

    text: Text
    section: Section
    at: int
    local: dict[str, Cell] = field(default_factory=dict)
    repeats_left: int = 0
    given: tuple[Value | None, ...] | None = None
    references: list[tuple[str, str, tuple[Value, ...]]] = field(default_factory=list)
    regions: list[Region] = field(default_factory=list)
    is_modal: bool = False
    saves: bool = False
    saved: object = None


class Flow:
    """The stack of running programs, the innermost last, and the counts that bound them."""

    __slots__ = ("jumps", "levels", "modal", "settings", "texts", "variables")

    def __init__(self, text: Text, settings: Settings, variables: Variables) -> None:
        self.settings, self.variables, self.jumps = settings, variables, 0
        self.texts: dict[str, Text] = {}
        main = text.sections[0]
        self.levels = [Level(text, main, main.start, variables.local)]
        self.modal: Name | Invocation | None = None

    @property
    def level(self) -> Level:
        return self.levels[-1]

    def count(self) -> None:
        """One more jump, loop or call. RefusedError where there are too many: the program has no end."""
        self.jumps += 1
        if self.jumps > self.settings.jumps_max:
            raise RefusedError("", f"more than {self.settings.jumps_max} jumps: the program has no end; Settings.jumps_max")

    def jump(self, target: Target) -> None:
        """Go on at a label or a block number of the running program; GOTOC goes on behind its block where there is none."""
        level = self.level
        self.count()
        if target.direction == "GOTOS":
            level.at = level.section.start
            level.regions.clear()
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

    def structure(self, statement: Structure) -> None:
        """Run a line of IF, LOOP, FOR, WHILE or REPEAT."""
        level, word = self.level, statement.word
        span = level.text.span(level.section, level.at)
        holds = statement.condition is None or is_true(statement.condition(self.variables), word)
        if word in ("ENDLOOP", "ENDWHILE", "ENDFOR") or (word == "UNTIL" and not holds):
            self.count()
        if word == "IF":
            past = span.end if span.middle is None else span.middle
            level.at = level.at + 1 if holds else past + 1
        elif word == "ELSE":
            level.at = span.end + 1
        elif word == "FOR":
            self.counts(statement, is_first=True)
            level.at = level.at + 1 if self.counts_on(statement) else span.end + 1
        elif word == "ENDFOR":
            head = self.head_of(span.begin)
            self.counts(head, is_first=False)
            level.at = span.begin + 1 if self.counts_on(head) else span.end + 1
        elif word == "WHILE":
            level.at = level.at + 1 if holds else span.end + 1
        elif word in ("ENDLOOP", "ENDWHILE"):
            level.at = span.begin
        elif word == "UNTIL":
            level.at = level.at + 1 if holds else span.begin + 1
        else:
            level.at += 1

    def head_of(self, line: int) -> Structure:
        block = self.level.text.blocks.get(line)
        if block is None or not isinstance(block.statement, Structure):
            raise RefusedError("ENDFOR", "is reached without its FOR")
        return block.statement

    def counts(self, statement: Structure, is_first: bool) -> None:
        """Set the counter of FOR, or take it one on."""
        counter = statement.counter
        assert counter is not None and statement.first is not None
        at = counter.at(self.variables)
        if is_first:
            self.variables.write(counter.name, at, statement.first(self.variables), counter.text)
        else:
            now = as_number(self.variables.read(counter.name, at, counter.text), counter.text)
            self.variables.write(counter.name, at, now + 1.0, counter.text)

    def counts_on(self, statement: Structure) -> bool:
        assert statement.counter is not None and statement.last is not None
        last = as_number(statement.last(self.variables), "TO")
        return as_number(statement.counter(self.variables), statement.counter.text) <= last

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

    def find(self, name: str) -> tuple[Text, Section] | None:
        """The program of a name: in the running text, in the main text, or in a text of its own."""
        for text in (self.level.text, self.levels[0].text):
            if name in text.programs:
                return text, text.programs[name]
        if name not in self.texts:
            given = next((text for key, text in self.settings.programs.items() if program_name(key) == name), None)
            if given is None:
                return None
            self.texts[name] = Text(given, name)
        text = self.texts[name]
        return text, text.programs.get(name, text.sections[0])

    def call(
        self,
        name: str,
        word: str,
        arguments: tuple[Expression | None, ...] = (),
        repeats: int = 1,
        is_modal: bool = False,
    ) -> None:
        """Begin a subprogram; the caller goes on behind its block."""
        found = self.find(name)
        if found is None:
            raise RefusedError(word, "there is no such subprogram, cycle or G code here; programs are handed in with the text")
        if len(self.levels) > self.settings.call_depth_max:
            raise RefusedError(word, f"calls are nested deeper than {self.settings.call_depth_max}; Settings.call_depth_max")
        if not 0 <= repeats <= self.settings.repeats_max:
            raise RefusedError("P", f"repeats from 0 to {self.settings.repeats_max} times")
        self.count()
        given = tuple(None if one is None else one(self.variables) for one in arguments)
        text, section = found
        level = Level(text, section, section.start, {}, repeats - 1, given, is_modal=is_modal)
        for one in arguments:
            variable = getattr(one, "name", None)
            at = one.at(self.variables) if isinstance(variable, str) else ()  # type: ignore[union-attr]
            level.references.append(("", variable or "", at))
        if repeats > 0:
            self.levels.append(level)
            self.variables.local = level.local

    def procedure(self, statement: Procedure) -> None:
        """PROC: its parameters become variables with the values of the call."""
        level = self.level
        given = level.given or ()
        if len(given) > len(statement.parameters):
            raise RefusedError(statement.name, f"takes {len(statement.parameters)} arguments, and the call has {len(given)}")
        references = level.references
        level.references = []
        for place, one in enumerate(statement.parameters):
            sizes = tuple(size(self.variables) for size in one.sizes)
            self.variables.define(one.kind, one.name, sizes, one.text)
            value = given[place] if place < len(given) else None
            if value is not None:
                self.variables.write(one.name, (), value, one.text)
            elif one.first is not None:
                self.assign(one.first)
            if one.by_reference and place < len(references):
                if not references[place][1]:
                    raise RefusedError(one.text, "is VAR, and hands its value back: the call needs a variable there")
                level.references.append((one.name, references[place][1], references[place][2]))
        level.given = ()
        level.saves = statement.saves

    def returns(self) -> bool:
        """End the running program; False where it is the main program."""
        if len(self.levels) == 1:
            return False
        level = self.level
        if level.repeats_left > 0:
            self.count()
            level.repeats_left -= 1
            level.at = level.section.start
            level.local.clear()
            level.regions.clear()
            return True
        self.levels.pop()
        back = [(name, at, level.local[own].values[0]) for own, name, at in level.references if own in level.local]
        self.variables.local = self.level.local
        for name, at, value in back:
            self.variables.write(name, at, value, name)
        return True
