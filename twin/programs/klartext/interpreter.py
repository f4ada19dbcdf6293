"""The interpreter: a Klartext program in, canonical moves out.

Plain straight moves take the short way of `plain`; every other block is compiled once to what it does (`heads.compiled`) and
kept, so that loops cost no more than they should.
"""

from twin.errors import PartProgramError
from twin.programs.canonical import Move
from twin.programs.klartext import m_functions, plain
from twin.programs.klartext.heads import Command, compiled
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings


class Interpreter:
    """One run of one program."""

    __slots__ = ("blocks_run", "commands", "flow", "settings", "state")

    def __init__(self, text: str, settings: Settings) -> None:
        self.settings = settings
        self.state = State(text, settings)
        self.flow = self.state.flow
        self.commands: dict[str | None, dict[int, Command]] = {}
        self.blocks_run = 0

    def run(self) -> list[Move]:
        """All moves of the program; PartProgramError at the first block that cannot be run."""
        try:
            while not self.flow.ended:
                if plain.is_plain(self.state):
                    left = self.settings.blocks_max - self.blocks_run
                    self.blocks_run += plain.run(self.state, self.flow.level, left)
                self.block()
        except RefusedError as refused:
            line, program = refused.place or (self.state.line, self.state.program)
            block = self.flow.text_of(program).number_at(line)
            raise PartProgramError(line + 1, refused.word, refused.reason, program, block) from None
        return self.state.moves

    def block(self) -> None:
        """Run the next block."""
        level, state = self.flow.level, self.state
        at, text = level.at, level.text
        if at >= len(text.sources):
            self.ran_out()
            return
        source = text.sources[at]
        state.line, state.program = source.line, text.name
        level.at = at + 1
        self.blocks_run += 1
        if self.blocks_run > self.settings.blocks_max:
            raise RefusedError("", f"more than {self.settings.blocks_max} blocks were run; Settings.blocks_max")
        if source.skip and 1 in self.settings.block_skip:
            return
        known = self.commands.setdefault(text.name, {})
        command = known.get(at)
        if command is None:
            try:
                command = known[at] = compiled(source, self.settings.bracket_depth_max)
            except RefusedError as refused:
                line = source.line if refused.place is None else refused.place[0]
                raise RefusedError(refused.word, refused.reason, (line, text.name)) from None
        command(state)

    def ran_out(self) -> None:
        """The last block is passed: END PGM is missing, which `remarks` says of the main program."""
        if not self.flow.level.program:
            raise RefusedError("", "the subprogram ends without LBL 0")
        if not self.state.leave_program():
            m_functions.close(self.state)


def interpret(text: str, settings: Settings | None = None) -> list[Move]:
    """Run a part program and return its canonical moves, in order.

    text: Klartext of HEIDENHAIN; lines may end in any way
    settings: what is not in the text; None = `Settings()`

    Raises PartProgramError (line, word, reason) where the control would refuse a block, or it is not read.

    >>> for move in interpret("0 BEGIN PGM A MM\\n1 L X+10 F600\\n2 END PGM A MM"):
    ...     print(move)
    Linear(line=1, end_mm=(10.0, 0.0, 0.0), feed_mm_min=600.0, feed_per_rev_mm=None, program=None)
    ProgramEnd(line=2, program=None)
    """
    return Interpreter(text, settings or Settings()).run()
