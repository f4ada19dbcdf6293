"""A term's table in the form of a file: columns of one length, a knot a row, in any order.

The arguments are the columns beside `value`, `low`, `high`; a table over `t_s` has a column `run` with the name of a run in each
row, and is a recording of an input and no law of the machine.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product

from twin.errors import EffectError
from twin.learned.words import PERIODS, TIME, word_of

VALUES = ("value", "low", "high")
RUN = "run"
ARGUMENTS_MAX = 2
ROWS_MAX = 100_000
Columns = Mapping[str, Sequence[float | str]]


def arguments_of(table: Columns) -> tuple[str, ...]:
    """Return the argument columns of a table, in its order.

    Raises EffectError where its columns are not those of a table, are of several lengths, or hold what is no finite number.
    """
    arguments = tuple(column for column in table if column not in (*VALUES, RUN))
    for column in arguments:
        word_of(column)
    if not 1 <= len(arguments) <= ARGUMENTS_MAX:
        raise EffectError(f"the table has {len(arguments)} argument columns; it has to have one or two beside value, low, high")
    if TIME in arguments and len(arguments) > 1:
        raise EffectError(f"the table is over {', '.join(arguments)}; one over {TIME}, the time of a run, is over nothing else")
    if "value" not in table:
        raise EffectError(f"the table has no column value, only {', '.join(table)}")
    if (RUN in table) and TIME not in table:
        raise EffectError(f"the table has a column run, which goes with {TIME} only")
    sizes = {column: len(values) for column, values in table.items()}
    if len(set(sizes.values())) > 1 or not 0 < sizes["value"] <= ROWS_MAX:
        said = ", ".join(f"{column} {size}" for column, size in sizes.items())
        raise EffectError(f"the columns of the table have {said} rows; all have to have the same, 1 to {ROWS_MAX}")
    for column, values in table.items():
        for row, value in enumerate(values):
            if isinstance(value, str) is not (column == RUN) or (not isinstance(value, str) and not math.isfinite(value)):
                right = "the name of a run" if column == RUN else "a finite number"
                raise EffectError(f"{column} of the table is {value!r} in row {row + 1}; it has to be {right}")
    return arguments


def is_recording(table: Columns) -> bool:
    """Return True where a table is over the time of single runs, and says nothing of others."""
    return TIME in table


def checked_rows(table: Columns) -> None:
    """Raises EffectError where a knot is there twice."""
    named = (*((RUN,) if RUN in table else ()), *arguments_of(table))
    seen: set[tuple[float | str, ...]] = set()
    for row in zip(*(table[column] for column in named), strict=True):
        if row in seen:
            raise EffectError(f"{_said(named, row)} is in the table twice; leave one of the rows out")
        seen.add(row)


def grid_of(table: Columns) -> tuple[dict[str, tuple[float, ...]], tuple[int, ...]]:
    """Return the knots of each argument, increasing, and the row of each knot, the last argument fastest.

    Raises EffectError where a table is none, or two arguments are not combined with each other.

    >>> grid_of({"position_mm": (5.0, 0.0), "value": (3.0, 1.0)})
    ({'position_mm': (0.0, 5.0)}, (1, 0))
    """
    arguments = arguments_of(table)
    checked_rows(table)
    knots = {column: tuple(sorted({float(v) for v in table[column]})) for column in arguments}
    for column, period in PERIODS.items():
        if column in knots and not (knots[column][0] >= 0.0 and knots[column][-1] < period):
            raise EffectError(
                f"{column} of the table goes from {knots[column][0]:g} to {knots[column][-1]:g}; it has to be in [0, 2π)"
            )
    by_knot = {at: row for row, at in enumerate(zip(*(table[column] for column in arguments), strict=True))}
    order = []
    for at in product(*knots.values()):
        if at not in by_knot:
            raise EffectError(f"the table has no row for {_said(arguments, at)}; each value of one goes with each of the other")
        order.append(by_knot[at])
    return knots, tuple(order)


def _said(columns: Sequence[str], row: Sequence[float | str]) -> str:
    return ", ".join(
        f"{column} {value:g}" if isinstance(value, float) else f"{column} {value}"
        for column, value in zip(columns, row, strict=True)
    )
