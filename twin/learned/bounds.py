"""The greatest that a learned term can be where what it depends on is not known: by its knots, between which it is linear."""

from collections.abc import Collection

import numpy as np

from twin.learned.knots import Knots
from twin.learned.term import Term


def greatest(term: Term, known: Collection[str]) -> Term:
    """Return the term over its known arguments, the greatest over all others; over the time since the start where none is known.

    >>> from twin.learned.words import LearnedSite
    >>> knots = Knots({"chip_mm": np.array([0.0, 0.1]), "coolant_on": np.array([0.0, 1.0])})
    >>> value = np.array([1.0, 5.0, 2.0, -3.0])
    >>> greatest(Term(LearnedSite.CUT_FORCE, "", knots, value, value, value), ["chip_mm"]).value.tolist()
    [5.0, 2.0]
    """
    columns = term.knots.columns
    others = tuple(axis for axis, column in enumerate(columns) if column not in known)
    value = np.max(term.value.reshape(term.knots.shape), axis=others).ravel()
    kept = {column: term.knots.by_column[column] for column in columns if column in known}
    knots = Knots(kept or {"time_since_start_s": np.zeros(1)})
    return Term(term.site, term.on, knots, value, value, value)


def largest(term: Term) -> float:
    """Return the largest magnitude that it can have."""
    return float(np.abs(term.value).max())
