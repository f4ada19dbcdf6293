"""The learned terms that a machine has already, as the series that they add to its quantities and readings."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.learned.arguments import motion_arguments
from twin.learned.placement import SINCE
from twin.learned.section import LearnedSection
from twin.learned.sites import AXIS_SITES, MACHINE_QUANTITIES, MACHINE_READINGS, QUANTITIES, READINGS
from twin.learned.term import Term
from twin.learned.words import OF_AXIS, LearnedSite

Floats = NDArray[np.float64]
Arguments = Mapping[str, Floats]
Answer = TypeVar("Answer")
PASSES_MAX = 24
SETTLED = 1e-4
"""Change of a series, over its largest value, below which it is the same."""


def terms_at(sections: Sequence[LearnedSection], sites: Collection[LearnedSite], on: str | None = None) -> tuple[Term, ...]:
    """Return the terms at these sites, on `on` where that is given; those over the time of recordings say nothing of others."""
    here = (s for s in sections if s.site in sites and on in (None, s.on) and not s.is_recording)
    return tuple(section.term for section in here)


def axis_terms(sections: Sequence[LearnedSection], letter: str) -> tuple[Term, ...]:
    """Return the terms on an axis and on what its sensors read."""
    found = terms_at(sections, {*QUANTITIES, *READINGS})
    return tuple(term for term in found if term.on.partition("_")[0] == letter)


def on_axes(sections: Sequence[LearnedSection], axes: Collection[str]) -> tuple[LearnedSection, ...]:
    """Return the learned terms of a machine with no more axes than these: on them, or on the machine as a whole."""
    of_axis = {*AXIS_SITES, *READINGS}
    return tuple(s for s in sections if s.site not in of_axis or s.on.partition("_")[0] in axes)


def moved_by(sections: Sequence[LearnedSection], axes: Collection[str]) -> tuple[LearnedSection, ...]:
    """Return those of `on_axes` that the motion of these axes alone decides; terms of spindle and heat stay."""
    told = {*motion_arguments(np.zeros(1), np.zeros(1)), "torque_a", "coolant_on"}
    told |= {f"{letter}_{column}" for letter in axes for column in OF_AXIS}
    of_axis = {*AXIS_SITES, *READINGS}
    return tuple(s for s in on_axes(sections, axes) if s.site not in of_axis or set(s.arguments) <= told)


def added_series(terms: Sequence[Term], arguments: Arguments) -> dict[str, Floats]:
    """Return quantity → (n,) that the terms add to it; terms of readings add to none."""
    added: dict[str, Floats] = {}
    for term in terms:
        for quantity, sign in (QUANTITIES | MACHINE_QUANTITIES).get(term.site, {}).items():
            series = sign * term.at(arguments)
            added[quantity] = added[quantity] + series if quantity in added else series
    return added


def reading_series(terms: Sequence[Term], signal: str, arguments: Arguments) -> Floats | None:
    """Return what the terms add to the reading of a signal, (n,); None where none does."""
    letter, _, column = signal.partition("_")
    found: Floats | None = None
    for term in terms:
        of_axis = READINGS.get(term.site) == column and term.on in (letter, signal)
        of_machine = signal in MACHINE_READINGS.get(term.site, ()) and term.on in ("", signal)
        if of_axis or of_machine:
            found = term.at(arguments) if found is None else found + term.at(arguments)
    return found


def settled(
    terms: Sequence[Term],
    answer: Callable[[dict[str, Floats]], Answer],
    arguments: Callable[[Answer], Arguments],
    passes_max: int = PASSES_MAX,
) -> Answer:
    """Return the answer of a part of the machine with the terms in it.

    The first pass is without them. Its answer tells what they depend on, and so what they add in the next one; passes go on until
    that changes no more, or there have been `passes_max` with terms.
    """
    found, before = answer({}), dict[str, Floats]()
    for _ in range(passes_max if terms else 0):
        added = added_series(terms, arguments(found))
        if all(
            np.abs(series - before.get(name, 0.0)).max(initial=0.0) <= SETTLED * np.abs(series).max(initial=0.0)
            for name, series in added.items()
        ):
            break
        found, before = answer(added), added
    return found


def seconds_of(sections: Sequence[LearnedSection], planned_s: float) -> float:
    """Return the seconds that the learned terms add to a program, by what it takes without them."""
    terms = terms_at(sections, (LearnedSite.PROGRAM_TIME,))
    return float(sum(term.at({SINCE: np.array([planned_s])})[0] for term in terms))
