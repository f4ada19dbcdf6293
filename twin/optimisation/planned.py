"""The cuts of each line from a run log of the program, for use where the stock is not known.

A run log counts lines by index from 0, or by N words (formats, section 3), and does not say which. It is read both ways: where it
cuts, there has to be a feed line of the program, and where it is at all, a line that does something.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.programs import Arc, Linear, Settings
from twin.programs.discovery import dialect_of
from twin.programs.source import source_lines
from twin.runlog import RunLog

DIGITS = 6
FITS = 0.98


class Reading(NamedTuple):
    """One way to take the figures of a run log: line as told → index of the text; how much of the log is explained by it."""

    lines: Mapping[int, int]
    cutting: float
    doing: float


def planned_cuts(run: RunLog, text: str, settings: Settings) -> dict[int, list[list[float]]]:
    """Line (from 0) → its different [depth mm, entry rad, exit rad]; empty where nothing cuts.

    Raises RunLogError where the run log has no engagement, is one of another program, or can be read both ways.
    """
    rows = np.column_stack([np.nan_to_num(run["axial_depth_mm"]), run["entry_angle_rad"], run["exit_angle_rad"]])
    told = run["line"]
    known = np.isfinite(told)
    rows, line = rows[known], told[known].astype(np.int64)
    cuts = rows[:, 0] > 0.0
    if not cuts.any():
        return {}
    reading = _reading(line, cuts, text, settings, run.source)
    found = {}
    for one in np.unique(line[cuts]).tolist():
        if one in reading.lines:
            own = rows[cuts & (line == one)]
            different = own[np.unique(np.round(own, DIGITS), axis=0, return_index=True)[1]]
            found[reading.lines[one]] = different.tolist()
    return found


def _reading(line: NDArray[np.int64], cuts: NDArray[np.bool_], text: str, settings: Settings, name: str) -> Reading:
    """The way that explains the run log."""
    source = source_lines(text)
    dialect = dialect_of(text, settings)
    moves = [move for move in dialect.interpret(text, settings) if move.program is None]
    feeding = {move.line for move in moves if isinstance(move, Linear | Arc)}
    done = {move.line for move in moves}
    numbers = [dialect.words.block_number(one) for one in source]
    by_word = {number: k for k, number in enumerate(numbers) if number is not None}
    readings = []
    for index in ({k: k for k in range(len(source))}, by_word):
        at = np.array([index.get(one, -1) for one in line.tolist()])
        cutting = float(np.isin(at[cuts], list(feeding)).mean())
        readings.append(Reading(index, cutting, float(np.isin(at, list(done)).mean())))
    fits = [one for one in readings if one.cutting >= FITS]
    if not fits:
        where = next(one for one in line[cuts].tolist() if one not in feeding)
        raise RunLogError(
            f"{name}: line {where} cuts, and the program has no such feed line, neither by N words nor counted from 0; is it "
            "a run of another program?"
        )
    if len(fits) > 1 and any(by_word.get(one, one) != one for one in np.unique(line[cuts]).tolist()):
        fits.sort(key=lambda one: (one.cutting, one.doing), reverse=True)
        if fits[0][1:] == fits[1][1:]:
            raise RunLogError(
                f"{name}: its lines can be N words of the program or line numbers from 0, and the cuts fit either; write line "
                "numbers from 0, and take the N words out of the program"
            )
    return fits[0]
