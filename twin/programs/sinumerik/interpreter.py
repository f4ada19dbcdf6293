"""The interpreter: a SINUMERIK part program in, canonical moves out."""

from typing import Final

from twin.errors import PartProgramError
from twin.programs.canonical import Move, ProgramEnd
from twin.programs.plain import PLAIN, PlainModes, plain_blocks
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings
from twin.programs.sinumerik import calls, compensation, corners, modes, motion, smoothing
from twin.programs.sinumerik.cycles.catalogue import CYCLES, REFUSED_CYCLES, run_cycle
from twin.programs.sinumerik.flow import Flow
from twin.programs.sinumerik.frames import IDENTITY
from twin.programs.sinumerik.language.block import parse
from twin.programs.sinumerik.language.functions import as_text
from twin.programs.sinumerik.language.syntax import (
    Block,
    CallByName,
    Case,
    Definition,
    Invocation,
    Jumps,
    Name,
    Nothing,
    Procedure,
    Repeat,
    Return,
    Structure,
    Words,
)
from twin.programs.sinumerik.language.text import Text, program_name
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.structures import structure
from twin.programs.sinumerik.system_variables import SystemVariables
from twin.programs.sinumerik.variables import Variables
from twin.programs.sinumerik.words import evaluated

ENDS: Final = frozenset({2, 30})
PLAIN_MOTIONS: Final = ("G0", "G1", "G2", "G3")


class Interpreter:
    """One run of one program."""

    __slots__ = ("blocks_run", "flow", "settings", "state", "variables")

    def __init__(self, text: str, settings: Settings) -> None:
        self.settings = settings
        self.state = State(settings)
        self.variables = Variables(settings.parameters, SystemVariables(self.state))
        self.flow = Flow(Text(text, None), settings, self.variables)
        self.blocks_run = 0

    def run(self) -> list[Move]:
        """All moves of the program; PartProgramError at the first block that cannot be run."""
        try:
            running = True
            while running:
                running = self.step()
            self.finish()
        except RefusedError as refused:
            line, program = refused.place or (self.state.line, self.state.program)
            raise PartProgramError(line + 1, refused.word, refused.reason, program) from None
        return self.state.moves

    def step(self) -> bool:
        """Run plain blocks and one block behind them; False at the end of the program."""
        level = self.flow.level
        if self.flow.end_of_region():
            return True
        if self.is_plain():
            self.plain_blocks()
        return self.block() if level.at < level.section.stop else self.returns()

    def is_plain(self) -> bool:
        """Return True where the modes allow the short way."""
        state, flow = self.state, self.flow
        modal = state.modal
        return (
            flow.modal is None
            and not flow.level.regions
            and (flow.level.is_bound or not flow.level.given)
            and modal["motion"] in PLAIN_MOTIONS
            and modal["feed"] == "G94"
            and modal["plane"] == "G17"
            and state.compensation is None
            and state.corner is None
            and state.pending_angle is None
            and state.rounding_mm == 0.0
            and not (state.length_is_due or state.waits_for_tool)
            and len(state.axes) == 3
            and state.frames.program.matrix == IDENTITY
        )

    def plain_blocks(self) -> None:
        """Run plain motions up to the first block that is none. Leaves its line in `level.at`."""
        level, state, frames = self.flow.level, self.state, self.state.frames
        x, y, z = state.position
        now = PlainModes(
            PLAIN_MOTIONS.index(state.modal["motion"]),
            state.modal["distance"] == "G90",
            (x, y, z),
            frames.to_machine((0.0, 0.0, 0.0)),
            state.feed_word,
            state.unit_mm,
            state.feed_unit_mm,
            self.settings.arc_radius_error_mm_max,
        )
        text, start, put = level.text, level.at, len(state.moves)
        at = plain_blocks(text.lines, start, level.section.stop, text.name, PLAIN.fullmatch, now, state.moves.append)
        if at > start:
            level.at, state.modal["motion"] = at, PLAIN_MOTIONS[now.motion]
            state.feed_word, state.position = now.feed_mm_min, now.position
            motion.keep_tangents(state, (x, y, z), state.moves[put:])
            self.count(at - start)

    def count(self, blocks: int) -> None:
        self.blocks_run += blocks
        if self.blocks_run > self.settings.blocks_max:
            raise RefusedError("", f"more than {self.settings.blocks_max} blocks were run; Settings.blocks_max")
        if len(self.state.moves) > self.settings.moves_max:
            raise RefusedError("", f"the program makes more than {self.settings.moves_max} moves; Settings.moves_max")

    def finish(self) -> None:
        """Finish what is still open at the end of the program."""
        state = self.state
        if state.pending_angle is not None:
            raise RefusedError(state.pending_angle.text, "the program ends; a line by its angle needs a line behind it")
        if state.corner is not None:
            corners.abandoned(state)
        compensation.finish(state)

    def returns(self) -> bool:
        """The end of the running program; False where it is the main program."""
        level = self.flow.level
        if not calls.returns(self.flow):
            return False
        if level.saves and self.flow.level is not level and level.saved is not None:
            self.restore(level.saved)
        return True

    def restore(self, saved: object) -> None:
        """SAVE: the G codes and the frame of the caller."""
        assert isinstance(saved, tuple)
        self.state.modal, self.state.frames.program = dict(saved[0]), saved[1]
        self.state.frames.settable_name = self.state.modal["work"]

    def block(self) -> bool:
        """Run the block at `level.at`; False at the end of the program."""
        level, state = self.flow.level, self.state
        at, text = level.at, level.text
        state.line, state.program = at, text.name
        self.count(1)
        block = text.blocks.get(at)
        if block is None:
            block = text.blocks[at] = parse(text.lines[at], text.written[at], self.settings)
        if block.skip is not None and block.skip in self.settings.block_skip:
            level.at = at + 1
            return True
        return self.statement(block)

    def statement(self, block: Block) -> bool:
        """Run one statement; False at the end of the program."""
        flow, level, statement = self.flow, self.flow.level, block.statement
        if isinstance(statement, Procedure):
            calls.procedure(flow, statement)
            level.saved = (dict(self.state.modal), self.state.frames.program)
            level.at += 1
            return True
        if isinstance(statement, Nothing):
            level.at += 1
            return True
        calls.need_procedure(level)
        if isinstance(statement, Words):
            level.at += 1
            return self.words(statement)
        if isinstance(statement, Structure):
            structure(flow, statement)
        elif isinstance(statement, Jumps):
            flow.jumps_of(statement)
        elif isinstance(statement, Case):
            flow.case(statement)
        elif isinstance(statement, Repeat):
            flow.repeat(statement)
        elif isinstance(statement, Definition):
            flow.define(statement)
            level.at += 1
        elif isinstance(statement, CallByName):
            level.at += 1
            name = program_name(as_text(statement.name(self.variables)))
            calls.call(flow, name, statement.text, statement.arguments)
        elif isinstance(statement, Return):
            return self.ended() if len(flow.levels) == 1 else self.returns()
        return True

    def ended(self) -> bool:
        """M2, M30, and in the main program M17 and RET: False, for nothing runs any more."""
        self.finish()
        self.state.emit(ProgramEnd(self.state.line, self.state.program))
        return False

    def words(self, statement: Words) -> bool:
        """Run a list of words with the calls and ends in it; False at the end of the program."""
        flow, state = self.flow, self.state
        if statement.cancels_modal or statement.modal is not None:
            if statement.modal is not None:
                self.known(statement.modal)
            flow.modal = statement.modal
            return True
        words = evaluated(statement.parts, self.variables, flow.assign)
        others = [*words.written.values(), *(one.text for name, one in words.values.items() if name != "P")]
        beside = next(iter([*others, *(f"M{code}" for code in words.m)]), None)
        if words.calls and beside is not None:
            raise RefusedError(beside, f"stands beside the call of {words.calls[0].name}; a call has a block of its own")
        moved = modes.execute(state, words)
        if len(words.calls) > 1:
            raise RefusedError(words.calls[1].text, "a block calls one subprogram or cycle")
        if "P" in words.values and not words.calls:
            raise RefusedError(words.values["P"].text, "says how often a subprogram is called; there is none in this block")
        if words.calls:
            self.call(words.calls[0], words.values["P"].whole(0, self.settings.repeats_max) if "P" in words.values else 1)
        elif moved and flow.modal is not None and not any(level.is_modal for level in flow.levels):
            self.call(flow.modal, 1, is_modal=True)
        for code in words.m:
            if code in ENDS or (code == 17 and len(flow.levels) == 1):
                return self.ended()
            if code == 17:
                return self.returns()
        return True

    def known(self, called: Name | Invocation) -> None:
        """RefusedError where there is no such cycle or subprogram."""
        if called.name in REFUSED_CYCLES:
            raise RefusedError(called.text, REFUSED_CYCLES[called.name])
        if called.name not in CYCLES and calls.find(self.flow, called.name) is None:
            raise RefusedError(called.text, calls.UNKNOWN)

    def call(self, called: Name | Invocation, repeats: int, is_modal: bool = False) -> None:
        """Call a cycle, or a subprogram; a subprogram of a cycle's name goes first, as on the control."""
        arguments = called.arguments if isinstance(called, Invocation) else ()
        if calls.find(self.flow, called.name) is not None:
            calls.call(self.flow, called.name, called.text, arguments, repeats, is_modal)
            return
        self.known(called)
        given = [None if one is None else one(self.variables) for one in arguments]
        if called.name == "CYCLE832":
            smoothing.high_speed(self.state, given)
            return
        for _ in range(repeats):
            run_cycle(self.state, called, given, self.at_each_position)

    def at_each_position(self) -> None:
        """Run what MCALL has at the positions of a pattern; nothing where it has none."""
        modal = self.flow.modal
        if modal is None:
            return
        if modal.name in CYCLES and calls.find(self.flow, modal.name) is None:
            arguments = modal.arguments if isinstance(modal, Invocation) else ()
            run_cycle(self.state, modal, [None if one is None else one(self.variables) for one in arguments], None)
            return
        depth, line, program = len(self.flow.levels), self.state.line, self.state.program
        self.call(modal, 1, is_modal=True)
        while len(self.flow.levels) > depth:
            if not self.step():
                raise RefusedError(modal.text, "the subprogram at the positions of a pattern ends the program; write M17 there")
        self.state.line, self.state.program = line, program


def interpret(text: str, settings: Settings) -> list[Move]:
    """Run a part program and return its canonical moves, in order.

    Raises PartProgramError (line, word, reason) where the control would refuse a block, or it is not read.

    >>> for move in interpret("G17 G90\\nG1 X=2*5 F600\\nM30", Settings()):
    ...     print(move)
    Linear(line=1, end_mm=(10.0, 0.0, 0.0), feed_mm_min=600.0, feed_per_rev_mm=None, program=None)
    ProgramEnd(line=2, program=None)
    """
    return Interpreter(text, settings).run()
