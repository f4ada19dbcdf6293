"""The interpreter: a part program in, canonical moves out.

Most blocks of a long program are plain motions in plain modes. For those one pattern takes the block apart and the move is put
out at once; everything else is compiled to a `Block` once and run by `modes.execute`.
"""

from twin.errors import PartProgramError
from twin.programs.canonical import Move, ProgramEnd
from twin.programs.fanuc import compensation, flow, modes
from twin.programs.fanuc.block import Kind, Words, parse
from twin.programs.fanuc.lathe import refuse_lathe
from twin.programs.fanuc.state import State
from twin.programs.fanuc.system_variables import SystemVariables
from twin.programs.fanuc.text import Text
from twin.programs.fanuc.variables import Variables
from twin.programs.plain import PLAIN, PLAIN_WITH_POINTS, PlainModes, plain_blocks
from twin.programs.refusal import RefusedError
from twin.programs.settings import IntegerWords, Settings


class Interpreter:
    """One run of one program."""

    __slots__ = ("blocks_run", "flow", "pattern", "settings", "state", "variables")

    def __init__(self, text: str, settings: Settings) -> None:
        self.settings = settings
        self.state = State(settings)
        system = SystemVariables(self.state, settings.variables)
        self.variables = Variables(settings.variables, system.read, system.write)
        self.flow = flow.Flow(Text(text, None), settings, self.variables)
        system.flow = self.flow
        self.pattern = PLAIN if settings.integer_words is IntegerWords.UNITS else PLAIN_WITH_POINTS
        self.blocks_run = 0

    def run(self) -> list[Move]:
        """All moves of the program; PartProgramError at the first block that cannot be run."""
        try:
            running = True
            while running:
                if self.is_plain():
                    self.plain_blocks()
                level = self.flow.level
                running = self.block() if level.at < level.section.stop else self.ran_out()
            compensation.finish(self.state)
            self.no_open_corner()
        except RefusedError as refused:
            line, program = refused.place or (self.state.line, self.state.program)
            raise PartProgramError(line + 1, refused.word, refused.reason, program) from None
        return self.state.moves

    def no_open_corner(self) -> None:
        pending = self.state.corner
        if pending is not None:
            raise RefusedError(pending.text, "the program ends; a corner needs a cut after it")

    def ran_out(self) -> bool:
        """The last line is passed: fine for a main program, not for a subprogram."""
        if len(self.flow.levels) > 1:
            self.state.line = max(self.flow.level.section.stop - 1, 0)
            self.state.program = self.flow.level.text.name
            raise RefusedError("", "the subprogram ends without M99")
        level = self.flow.level
        if level.section.stop != level.text.sections[-1].stop:
            self.state.line = level.section.stop
            raise RefusedError("", "the program runs into the next O number; it has to end with M2, M30 or M99")
        return False

    def is_plain(self) -> bool:
        """Return True where the modes allow the short way."""
        state = self.state
        modal = state.modal
        return (
            state.coordinates.plain
            and modal.cycle == 800
            and modal.feed == 940
            and modal.polar == 150
            and modal.motion != 330
            and modal.speed == 970
            and modal.plane == 170
            and state.compensation is None
            and state.corner is None
            and not state.length_is_due
            and not self.flow.modal_calls
            and len(state.axes) == 3
        )

    def plain_blocks(self) -> None:
        """Run plain motions up to the first block that is none. Leaves its line in `level.at`."""
        level, state, modal = self.flow.level, self.state, self.state.modal
        x, y, z = state.position
        now = PlainModes(
            modal.motion // 10,
            modal.distance == 900,
            (x, y, z),
            state.coordinates.offset,
            state.feed_word,
            state.unit_mm,
            state.unit_mm,
            self.settings.arc_radius_error_mm_max,
        )
        text, start = level.text, level.at
        at = plain_blocks(text.lines, start, level.section.stop, text.name, self.pattern.fullmatch, now, state.moves.append)
        if at > start:
            level.at, modal.motion = at, now.motion * 10
            state.feed_word, state.position = now.feed_mm_min, now.position
            self.count(at - start)

    @property
    def increment(self) -> float:
        """Return what a length without a point counts, in programmed units."""
        return self.state.increment if self.settings.integer_words is IntegerWords.INCREMENTS else 1.0

    def count(self, blocks: int) -> None:
        self.blocks_run += blocks
        if self.blocks_run > self.settings.blocks_max:
            raise RefusedError("", f"more than {self.settings.blocks_max} blocks were run; Settings.blocks_max")
        if len(self.state.moves) > self.settings.moves_max:
            raise RefusedError("", f"the program makes more than {self.settings.moves_max} moves; Settings.moves_max")

    def block(self) -> bool:
        """Run the block at `level.at`; False at the end of the program."""
        level, state = self.flow.level, self.state
        at, text = level.at, level.text
        state.line, state.program = at, text.name
        self.count(1)
        if at in text.blocks:
            block = text.blocks[at]
        else:
            block = text.blocks[at] = parse(text.lines[at], text.written[at], self.settings)
        if block is None:
            level.at = at + 1
            return True
        if block.kind is not Kind.WORDS:
            self.flow.statement(block)
            return True
        words = block.evaluated(self.variables, state.increment)
        level.at = at + 1
        return self.words(words)

    def words(self, words: Words) -> bool:
        """Run a list of words with the calls and ends in it; False at the end of the program."""
        state, current, codes = self.state, self.flow, words.codes
        if codes.get("once") == 650 or codes.get("macro") == 660:
            macro_call(current, words, self.increment)
            return True
        if codes.get("macro") == 670 and current.modal_calls:
            current.modal_calls.pop()
            state.modal.macro = 660 if current.modal_calls else 670
        before = state.position
        modes.execute(state, words)
        if state.position is not before:
            current.after_motion()
        for code in words.m:
            if code in (2, 30):
                compensation.finish(state)
                self.no_open_corner()
                state.emit(ProgramEnd(state.line, state.program))
                return False
            if code == 98:
                current.m98(words)
            elif code == 99:
                current.m99(words)
        return True


def macro_call(current: flow.Flow, words: Words, increment: float) -> None:
    """G65: at once. G66: after each block that moves, until G67."""
    group = "once" if "once" in words.codes else "macro"
    if len(words.codes) > 1:
        raise RefusedError(words.written[group], "stands in a block without other G codes; they would read its arguments")
    call = current.macro_words(words, words.written[group], increment)
    if group == "once":
        current.call(call.number, call.repeats, words.texts["P"], call.arguments)
    else:
        current.find(call.number, words.texts["P"])
        current.modal_calls.append(call)
        if len(current.modal_calls) > current.settings.call_depth_max:
            raise RefusedError(words.written[group], "too many modal calls one in another; cancel with G67")


def interpret(text: str, settings: Settings | None = None) -> list[Move]:
    """Run a part program and return its canonical moves, in order.

    text: FANUC-type mill dialect; lines may end in any way
    settings: what is not in the text; None = `Settings()`

    Raises PartProgramError (line, word, reason) where the control would refuse a block.

    >>> for move in interpret("G21 G90\\nG1 X10. F600\\nM30"):
    ...     print(move)
    Linear(line=1, end_mm=(10.0, 0.0, 0.0), feed_mm_min=600.0, feed_per_rev_mm=None, program=None)
    ProgramEnd(line=2, program=None)
    """
    refuse_lathe(text)
    return Interpreter(text, settings or Settings()).run()
