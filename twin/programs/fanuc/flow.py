"""The order of blocks: jumps, loops, calls and returns (GOTO, WHILE, M98, M99, G65, G66, G67)."""

from dataclasses import dataclass, field
from typing import Final

from twin.programs.fanuc.block import LENGTH_LETTERS, Block, Kind, Words
from twin.programs.fanuc.text import Section, Text
from twin.programs.fanuc.variables import Variables
from twin.programs.jumps import JumpCount
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

PROGRAM_NUMBER_MAX: Final = 99_999_999
ONE_LETTER: Final = {
    **{"A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "D": 7, "E": 8, "F": 9, "H": 11, "M": 13, "Q": 17, "R": 18, "S": 19},
    **{"T": 20, "U": 21, "V": 22, "W": 23, "X": 24, "Y": 25, "Z": 26},
}
"""Argument list I: the variable that a letter of G65 sets."""
TRIPLE: Final = "IJK"
"""Argument list II: the n-th I, J, K set #(4 + 3 (n − 1)) and on."""
TRIPLES_MAX: Final = 10
NOT_ARGUMENTS: Final = frozenset("GLNOP:")


@dataclass(slots=True)
class ModalCall:
    """G66: the program to call after each block that moves."""

    number: int
    repeats: int
    arguments: dict[int, float]


@dataclass(slots=True)
class Level:
    """A running program: where it is, where to go on, and what to restore. `macro`: it has variables of its own."""

    text: Text
    section: Section
    at: int
    repeats_left: int = 0
    macro: bool = False
    arguments: dict[int, float] = field(default_factory=dict)
    caller_local: dict[int, float] = field(default_factory=dict)
    modal_call: bool = False


class Flow(JumpCount):
    """The stack of running programs, the innermost last, and the counts that bound them."""

    __slots__ = ("levels", "modal_calls", "texts", "variables")

    def __init__(self, text: Text, settings: Settings, variables: Variables) -> None:
        super().__init__(settings)
        self.variables = variables
        self.texts: dict[int, Text] = {}
        main = text.sections[0]
        self.levels = [Level(text, main, main.start)]
        self.modal_calls: list[ModalCall] = []

    @property
    def level(self) -> Level:
        return self.levels[-1]

    def statement(self, block: Block) -> None:
        """Run a block that is no list of words; `at` of the level is the block's own line."""
        level, variables = self.level, self.variables
        if block.kind in (Kind.ASSIGN, Kind.IF_THEN):
            assert block.target is not None and block.value is not None
            if block.condition is None or block.condition(variables):
                variables.write(block.target(variables), block.value(variables))
            level.at += 1
        elif block.kind in (Kind.GOTO, Kind.IF_GOTO):
            assert block.value is not None
            if block.condition is None or block.condition(variables):
                self.jump(block.value(variables))
            else:
                level.at += 1
        elif block.kind is Kind.END:
            self.count()
            level.at = level.text.loop_at(level.at, level.section).begin
        else:
            loop = level.text.loop_at(level.at, level.section)
            enters = block.condition is None or block.condition(variables)
            level.at = level.at + 1 if enters else loop.end + 1

    def jump(self, sequence: float | None) -> None:
        """Go on at a sequence number of the running program."""
        level = self.level
        if sequence is None or not sequence.is_integer() or not 1 <= sequence <= PROGRAM_NUMBER_MAX:
            raise RefusedError("GOTO", f"needs a sequence number, not {'null' if sequence is None else f'{sequence:g}'}")
        found = level.text.line_of(int(sequence), level.section, level.at)
        if found is None:
            raise RefusedError(f"N{int(sequence)}", "there is no such sequence number in this program")
        self.count()
        level.at = found

    def find(self, number: int, word: str) -> tuple[Text, Section]:
        """The program of an O number: in the running text, in the main text, or in a text of its own."""
        for text in (self.level.text, self.levels[0].text):
            section = text.section(number)
            if section is not None:
                return text, section
        if number not in self.settings.subprograms:
            raise RefusedError(word, f"there is no program O{number:04}, neither in this text nor with it")
        if number not in self.texts:
            self.texts[number] = Text(self.settings.subprograms[number], f"O{number:04}")
        text = self.texts[number]
        return text, text.section(number) or text.sections[0]

    def call(self, number: int, repeats: int, word: str, arguments: dict[int, float] | None, modal: bool = False) -> None:
        """Begin a program; with arguments it gets variables of its own. The caller goes on behind its block."""
        self.check_depth(len(self.levels), word)
        text, section = self.find(number, word)
        self.count()
        if repeats < 1:
            return
        level = Level(text, section, section.start, repeats - 1, modal_call=modal)
        if arguments is not None:
            level.macro, level.arguments, level.caller_local = True, arguments, self.variables.local
            self.variables.local = dict(arguments)
        self.levels.append(level)

    def m98(self, words: Words) -> None:
        """`M98 P1234 L5`, or `M98 P51234`: up to four digits behind three of the repeats."""
        if "P" not in words.values:
            raise RefusedError("M98", "needs the program; write P")
        number, repeats = words.integer("P", 1, PROGRAM_NUMBER_MAX), 1
        if "L" in words.values:
            repeats = words.integer("L", 0, self.settings.repeats_max)
        elif number > 9999 and number not in self.settings.subprograms and self.level.text.section(number) is None:
            number, repeats = number % 10_000, number // 10_000
        self.call(number, repeats, words.texts["P"], None)

    def macro_words(self, words: Words, code: str, increment: float) -> ModalCall:
        """Program, repeats and arguments of G65 and G66.

        increment: what a length without a point counts, in programmed units
        """
        if "P" not in words.values:
            raise RefusedError(code, "needs the program; write P")
        repeats = words.integer("L", 0, self.settings.repeats_max) if "L" in words.values else 1
        found: dict[int, float] = {ONE_LETTER["M"]: float(words.m[0])} if words.m else {}
        row, last = 0, -1
        for letter, given, integer in words.arguments:
            if letter in NOT_ARGUMENTS:
                continue
            value = given * increment if integer and letter in LENGTH_LETTERS else given
            if letter in TRIPLE:
                # A letter that does not come after the one before begins the next triple.
                place = TRIPLE.index(letter)
                row += place <= last
                last = place
                if row >= TRIPLES_MAX:
                    raise RefusedError(letter, f"more than {TRIPLES_MAX} triples of I, J, K")
                found[ONE_LETTER[letter] + 3 * row] = value
            elif letter in ONE_LETTER:
                found[ONE_LETTER[letter]] = value
            else:
                raise RefusedError(letter, "cannot be an argument of a macro")
        return ModalCall(words.integer("P", 1, PROGRAM_NUMBER_MAX), repeats, found)

    def m99(self, words: Words) -> None:
        """Back to the caller, or its next repeat; `M99 P100` to N100 of the caller. In the main program: from the top."""
        level = self.level
        sequence = words.values.get("P")
        if len(self.levels) == 1:
            if sequence is not None:
                self.jump(sequence)
            else:
                self.count()
                level.at = level.section.start
            return
        if level.repeats_left > 0:
            self.count()
            level.repeats_left -= 1
            level.at = level.section.start
            if level.macro:
                self.variables.local = dict(level.arguments)
            return
        self.levels.pop()
        if level.macro:
            self.variables.local = level.caller_local
        if sequence is not None:
            self.jump(sequence)

    def after_motion(self) -> None:
        """G66: a block has moved; call its program, unless that is what is running."""
        if self.modal_calls and not any(level.modal_call for level in self.levels):
            modal = self.modal_calls[-1]
            self.call(modal.number, modal.repeats, "G66", dict(modal.arguments), modal=True)
