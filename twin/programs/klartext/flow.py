"""The order of blocks: labels, subprograms, repeats, other programs.

`CALL LBL 1` runs to the next LBL 0 and comes back; `CALL LBL 1 REP 3` goes back to LBL 1 three times, so that the section runs
four times; `CALL PGM` runs another text to its END PGM.
"""

from dataclasses import dataclass, field
from pathlib import PureWindowsPath

from twin.programs.called import NOT_AT_HAND
from twin.programs.jumps import JumpCount
from twin.programs.klartext.source import Text
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings


@dataclass(slots=True)
class Level:
    """A running text or subprogram: where it is, its repeats by the block that counts them, and what to restore behind it."""

    text: Text
    at: int
    program: bool
    repeats: dict[int, int] = field(default_factory=dict)
    caller_local: dict[int, float] = field(default_factory=dict)
    caller_unit_mm: float = 1.0


class Flow(JumpCount):
    """The stack of running levels, the innermost last, and the counts that bound them."""

    __slots__ = ("ended", "levels", "texts")

    def __init__(self, text: Text, settings: Settings) -> None:
        super().__init__(settings)
        self.levels = [Level(text, 0, program=True)]
        self.texts: dict[str, Text] = {}
        self.ended = False

    @property
    def level(self) -> Level:
        return self.levels[-1]

    @property
    def in_called_program(self) -> bool:
        """Return True inside a program that another one called."""
        return sum(level.program for level in self.levels) > 1

    def deeper(self, word: str) -> None:
        self.count()
        self.check_depth(len(self.levels), word)

    def jump(self, label: str, word: str) -> None:
        """Go on at a label of the running program."""
        at = self.level.text.find(label, word)
        self.count()
        self.level.at = at

    def call(self, label: str, word: str) -> None:
        """CALL LBL: a subprogram, up to LBL 0."""
        at = self.level.text.find(label, word)
        self.deeper(word)
        self.levels.append(Level(self.level.text, at, program=False))

    def repeat(self, label: str, times: int, word: str) -> None:
        """CALL LBL REP: back to the label, that many times; then on. The call's own block keeps the count."""
        level = self.level
        own = level.at - 1
        left = level.repeats.get(own, times)
        if not 0 <= times <= self.settings.repeats_max:
            raise RefusedError(word, f"repeats are from 0 to {self.settings.repeats_max}; Settings.repeats_max")
        if left <= 0:
            level.repeats.pop(own, None)
            return
        level.repeats[own] = left - 1
        self.jump(label, word)

    def label_zero(self) -> None:
        """LBL 0: back from a subprogram; without one it means nothing."""
        if not self.level.program:
            self.levels.pop()

    def enter(self, name: str, word: str, local: dict[int, float], unit_mm: float) -> None:
        """CALL PGM: the text of that name; its caller gets back its local parameters and its unit."""
        text = self.find_program(name, word)
        self.deeper(word)
        self.levels.append(Level(text, 0, program=True, caller_local=local, caller_unit_mm=unit_mm))

    def find_program(self, name: str, word: str) -> Text:
        """The text of a program, by its name without folder and suffix. RefusedError where it is not at hand."""
        bare = PureWindowsPath(name.strip().strip('"').replace("/", "\\")).name
        stem = bare[:-2] if bare.upper().endswith(".H") else bare
        if stem not in self.texts:
            text = self.settings.called_text(bare)
            if text is None:
                raise RefusedError(word, f"there is no program {stem} here; {NOT_AT_HAND}")
            self.texts[stem] = Text(text, stem)
        return self.texts[stem]

    def text_of(self, program: str | None) -> Text:
        """Return the text of that name; None = the main program."""
        return self.levels[0].text if program is None else self.texts[program]

    def leave(self) -> Level | None:
        """END PGM or the end of a text: back to the caller; returns what was left, None in the main program."""
        while not self.level.program:
            self.levels.pop()
        return self.levels.pop() if len(self.levels) > 1 else None
