"""The learned terms of a machine at one moment, as far as a live machine tells what they depend on.

A term that needs what no live signal tells is left out, and `left_out` says so. The table of a term is a numpy one; where numpy
is not installed, its terms are left out likewise.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from twin.learned.section import LearnedSection
from twin.learned.sites import MACHINE_QUANTITIES, MACHINE_READINGS
from twin.learned.words import LearnedSite

if TYPE_CHECKING:
    from twin.learned.term import Term


@dataclass(frozen=True, slots=True, eq=False)
class LiveTerms:
    """Terms on one quantity or reading.

    signed: each with the sign by which it is added; left_out: sentences on those that cannot be had
    """

    signed: "tuple[tuple[float, Term], ...]" = ()
    in_words: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @classmethod
    def of_quantity(cls, sections: Sequence[LearnedSection], quantity: str, known: Collection[str]) -> Self:
        """Return the terms on a quantity of heat or spindle, over no more than the known arguments."""
        signs = {site: own[quantity] for site, own in MACHINE_QUANTITIES.items() if quantity in own}
        return cls._of(sections, signs, ("",), known)

    @classmethod
    def of_reading(cls, sections: Sequence[LearnedSection], signal: str, known: Collection[str]) -> Self:
        """Return the terms on what the sensor of a signal reads."""
        signs = {site: 1.0 for site, signals in MACHINE_READINGS.items() if signal in signals}
        return cls._of(sections, signs, ("", signal), known)

    @classmethod
    def _of(
        cls, sections: Sequence[LearnedSection], signs: Mapping[LearnedSite, float], on: Collection[str], known: Collection[str]
    ) -> Self:
        signed, in_words, left_out = [], [], []
        for section in sections:
            if section.site not in signs or section.on not in on or section.is_recording:
                continue
            over = ", ".join(section.arguments)
            if unknown := [name for name in section.arguments if name not in known]:
                left_out.append(f"without the learned term at {section}: no live signal tells {', '.join(unknown)}")
                continue
            try:
                signed.append((signs[section.site], section.term))
            except ImportError as error:
                left_out.append(f"without the learned term at {section}: it needs {error.name}, pip install 'cnctwin[twin]'")
                continue
            in_words.append(f"with a learned term at {section} over {over}")
        return cls(tuple(signed), tuple(in_words), tuple(left_out))

    def __bool__(self) -> bool:
        """Return True where there is a term to add."""
        return bool(self.signed)

    def needs(self, argument: str) -> bool:
        """Return True where a term depends on the argument."""
        return any(argument in term.knots.columns for _, term in self.signed)

    def at(self, arguments: Mapping[str, float]) -> float:
        """Return what the terms add at these arguments."""
        import numpy as np  # noqa: PLC0415 - there is a term, so there is numpy

        total = 0.0
        for sign, term in self.signed:
            total += sign * float(term.at({name: np.array([arguments[name]]) for name in term.knots.columns})[0])
        return total
