"""Learned terms added up: a machine has one on each place over the same arguments, and a diagnosis may find more of it."""

from collections.abc import Sequence

import numpy as np

from twin.learned.knots import Knots
from twin.learned.placement import Place, place_of
from twin.learned.section import LearnedSection
from twin.learned.term import Term


def summed(sections: Sequence[LearnedSection]) -> tuple[LearnedSection, ...]:
    """Return the terms with those of one place added up, over the knots of all; terms over the time of recordings as they are.

    >>> from twin.learned.words import LearnedSite
    >>> tables = [{"position_mm": (0.0, at), "value": (0.0, 4.0)} for at in (10.0, 5.0)]
    >>> one, other = (LearnedSection(site=LearnedSite.FRICTION, on="x", table=table) for table in tables)
    >>> summed([one, other])[0].table["value"]
    (0.0, 6.0, 8.0)
    """
    groups: dict[Place, list[LearnedSection]] = {}
    for section in sections:
        if not section.is_recording:
            groups.setdefault(place_of(section), []).append(section)
    done: set[Place] = set()
    found = []
    for section in sections:
        place = place_of(section)
        if section.is_recording or len(groups[place]) == 1:
            found.append(section)
        elif place not in done:
            done.add(place)
            found.append(_sum(groups[place]))
    return tuple(found)


def _sum(sections: Sequence[LearnedSection]) -> LearnedSection:
    terms = [section.term for section in sections]
    columns = terms[0].knots.columns
    knots = Knots({c: np.unique(np.concatenate([term.knots.by_column[c] for term in terms])) for c in columns})
    grid = np.meshgrid(*knots.by_column.values(), indexing="ij")
    at = {column: values.ravel() for column, values in zip(columns, grid, strict=True)}
    value = np.sum([term.at(at) for term in terms], axis=0)
    # errors of terms that were found one after another go together at worst
    low, high = (
        np.sum([Term(t.site, t.on, t.knots, v, v, v).at(at) for t, v in zip(terms, values, strict=True)], axis=0)
        for values in ([t.low for t in terms], [t.high for t in terms])
    )
    sentence = "; ".join(dict.fromkeys(section.sentence for section in sections if section.sentence))
    repeats = None if any(s.repeats is None for s in sections) else all(s.repeats for s in sections)
    return LearnedSection.of(Term(terms[0].site, terms[0].on, knots, value, low, high), repeats=repeats, sentence=sentence)
