"""A learned term: a table over what it depends on, put on top of a quantity at its site.

It describes what the recordings show; it names no cause.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import EffectError
from twin.learned.knots import Knots
from twin.learned.table import VALUES, Columns, grid_of
from twin.learned.words import LearnedSite, word_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """A learned term.

    on: axis letter or signal, or empty; value: at the knots, (count,), in the unit of the site, with its 90 % band low … high
    """

    site: LearnedSite
    on: str
    knots: Knots
    value: Floats
    low: Floats
    high: Floats

    @property
    def depends_on(self) -> tuple[str, ...]:
        """The words of what it depends on."""
        return tuple(dict.fromkeys(word_of(column) for column in self.knots.columns))

    def at(self, arguments: Mapping[str, Floats]) -> Floats:
        """Return its series at the arguments, column → arrays of one shape; of that shape.

        Raises EffectError where an argument is not known.
        """
        for column in self.knots.columns:
            if column not in arguments:
                on = f" on {self.on}" if self.on else ""
                raise EffectError(f"the learned term at {self.site.value}{on} needs {column}, which this run does not have there")
        shape = np.shape(arguments[self.knots.columns[0]])
        flat = {column: np.ravel(arguments[column]) for column in self.knots.columns}
        return np.asarray(self.knots.interpolated(self.value[None, :], flat)[0].reshape(shape))

    def table(self) -> dict[str, tuple[float, ...]]:
        """Return it as columns of one length, a knot a row: the arguments, then value, low, high.

        >>> both = np.array([1.0, 2.0])
        >>> Term(LearnedSite.AXIS_FORCE, "x", Knots({"position_mm": np.array([0.0, 5.0])}), both, both, both).table()["value"]
        (1.0, 2.0)
        """
        grid = np.meshgrid(*self.knots.by_column.values(), indexing="ij")
        table = {column: _plain(values.ravel()) for column, values in zip(self.knots.columns, grid, strict=True)}
        return table | {"value": _plain(self.value), "low": _plain(self.low), "high": _plain(self.high)}


def term_of(site: LearnedSite, on: str, table: Columns) -> Term:
    """Return the term of a table that is a law of the machine. A band that is not there is as wide as nothing.

    Raises EffectError where a table is none, or two arguments are not combined with each other.

    >>> term = term_of(LearnedSite.AXIS_FORCE, "x", {"position_mm": (5.0, 0.0), "value": (3.0, 1.0)})
    >>> term.value.tolist(), term.low.tolist()
    ([1.0, 3.0], [1.0, 3.0])
    """
    knots, order = grid_of(table)
    columns = (np.asarray(table.get(name, table["value"]), dtype=np.float64)[list(order)] for name in VALUES)
    value, low, high = columns
    return Term(site, on, Knots({column: np.array(at) for column, at in knots.items()}), value, low, high)


def _plain(values: Floats) -> tuple[float, ...]:
    return tuple(float(f"{v:.6g}") for v in values)
