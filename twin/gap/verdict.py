"""The verdict: what may be said of what was found.

An effect that may as well not be there is no cause (`twin.gap.naming.there`), and beside a remainder only those are that are
certain (`twin.gap.naming.certain`). A stage whose constants had to move
by more than two stated deviations is explained by them, and not healthy.
"""

from dataclasses import dataclass

from twin.gap.diagnosis import Effected, Verdict
from twin.gap.naming.there import only_there
from twin.gap.search import Explained, leaves_a_gap


@dataclass(frozen=True, slots=True)
class Judged:
    """A stage with its verdict. likeness: what the gap that is left partly looks like."""

    explained: Explained
    verdict: Verdict
    likeness: tuple[Effected, ...]


def judged(explained: Explained) -> Judged:
    """The verdict on one stage, with those of its effects that are there for sure."""
    explained = only_there(explained)
    likeness = explained.alike
    if explained.stops or leaves_a_gap(explained.stage, explained.best):
        return Judged(explained, Verdict.PARTLY if explained.best.effects else Verdict.UNKNOWN, likeness)
    if explained.best.effects or explained.beyond:
        return Judged(explained, Verdict.EXPLAINED, likeness)
    return Judged(explained, Verdict.HEALTHY, likeness)


def overall(stages: list[Judged]) -> Verdict:
    """Return the verdict of the machine: unknown where nothing could be named, partly explained where something could and
    something could not."""
    verdicts = {s.verdict for s in stages}
    if verdicts <= {Verdict.HEALTHY}:
        return Verdict.HEALTHY
    named = verdicts & {Verdict.EXPLAINED, Verdict.PARTLY}
    if not named:
        return Verdict.UNKNOWN
    return Verdict.EXPLAINED if verdicts <= {Verdict.HEALTHY, Verdict.EXPLAINED} else Verdict.PARTLY
