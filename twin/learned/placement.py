"""The place of a learned term on a machine: site, what it is on, and what it depends on. A machine has one term on each."""

from collections.abc import Iterable, Sequence

from twin.errors import EffectError
from twin.learned.section import LearnedSection
from twin.learned.sites import check_place
from twin.learned.words import LearnedSite

Place = tuple[LearnedSite, str, frozenset[str]]
SINCE = "time_since_start_s"
"""The argument of a term of the program's time."""


def place_of(section: LearnedSection) -> Place:
    """Return the place on which a machine has one term: site, what it is on, and what it depends on."""
    return section.site, section.on, frozenset(section.arguments)


def check_terms(sections: Sequence[LearnedSection], axes: Iterable[str]) -> None:
    """Raises EffectError where a learned term of a machine is put on what there is not, or is there twice."""
    seen: set[Place] = set()
    letters = tuple(axes)
    for section in sections:
        check_place(section.site, section.on, letters)
        if section.site is LearnedSite.PROGRAM_TIME and not section.is_recording and section.arguments != (SINCE,):
            raise EffectError(f"the learned term at {section} is over {', '.join(section.arguments)}; it has to be over {SINCE}")
        if not section.is_recording and place_of(section) in seen:
            raise EffectError(
                f"the learned term at {section} over {', '.join(section.arguments)} is there twice; add the tables up"
            )
        seen.add(place_of(section))
