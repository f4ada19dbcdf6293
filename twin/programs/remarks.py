"""Remarks on a program that can be read, and that nobody meant so: it is cut off, or it cuts with the spindle at rest."""

from collections.abc import Collection, Iterator, Sequence
from typing import Final

from twin.programs.canonical import Arc, Linear, Move, ProgramEnd, Spindle
from twin.programs.dialect import Dialect
from twin.programs.source import source_lines

SHOWN_MAX: Final = 40


def remarks(dialect: Dialect, text: str, moves: Sequence[Move], met: Collection[int] | None = None) -> tuple[str, ...]:
    """Return what a person should know of a program before trusting its figures.

    moves: of this text, with what it calls
    met: the lines from 0 that feed into the stock, those of called programs as a line beyond the text; None = not known
    """
    lines = source_lines(text)
    return (*_cut_off(dialect, lines, moves), *_spindle_at_rest(dialect, lines, moves, met))


def _cut_off(dialect: Dialect, lines: list[str], moves: Sequence[Move]) -> Iterator[str]:
    """Yield a sentence where the text ends before the program does. A text between two `%` is whole, as LinuxCNC reads it."""
    filled = [at for at, line in enumerate(lines) if line.strip()]
    if not filled or any(isinstance(move, ProgramEnd) and move.program is None for move in moves):
        return
    first, last = lines[filled[0]].strip(), lines[filled[-1]].strip()
    if first == last == "%":
        return
    yield (
        f"{_place(dialect, lines, filled[-1])} is the last, {_shown(last)}, and no {dialect.end} follows: "
        "the program may have been cut off in a copy, and a control would not run it to an end"
    )


def _spindle_at_rest(dialect: Dialect, lines: list[str], moves: Sequence[Move], met: Collection[int] | None) -> Iterator[str]:
    """Yield a sentence where a program cuts, and the spindle turns nowhere in it. One that only probes needs no spindle."""
    starts = [move for move in moves if isinstance(move, Spindle) and move.direction != 0]
    if any(move.rpm > 0.0 for move in starts):
        return
    called_met = met is not None and any(not 0 <= line < len(lines) for line in met)

    def may_cut(move: Linear | Arc) -> bool:
        if move.program is not None:
            return met is None or called_met
        return not dialect.words.probes(lines[move.line]) and (met is None or move.line in met)

    first = next((move for move in moves if isinstance(move, Linear | Arc) and may_cut(move)), None)
    if first is None:
        return
    where = first.program if first.program is not None else _place(dialect, lines, first.line)
    what = "the feed moves" if met is None else "the cuts"
    if starts:
        begun = starts[0].program if starts[0].program is not None else _place(dialect, lines, starts[0].line)
        yield f"{begun} starts the spindle without a speed, and none follows: {what} from {where} on have a spindle at rest"
    else:
        yield f"nothing starts the spindle: {what} from {where} on have a spindle at rest; write {dialect.start} before"


def _place(dialect: Dialect, lines: list[str], at: int) -> str:
    """Return a line with the number by which the control shows it: its N word, or that of the block that it is in."""
    number_of = dialect.words.block_number
    if not dialect.blocks_are_numbered:
        number = number_of(lines[at])
        return f"line {at + 1}" if number is None else f"line {at + 1} (N{number})"
    number = next((one for line in reversed(lines[: at + 1]) if (one := number_of(line)) is not None), None)
    return f"line {at + 1}" if number is None else f"block {number} (line {at + 1})"


def _shown(line: str) -> str:
    return repr(line if len(line) <= SHOWN_MAX else line[:SHOWN_MAX] + "…")
