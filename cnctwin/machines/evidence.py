"""The evidence for a description: what it came from, how it scores on runs that it was not fitted to, how it did as a shadow.

A card lies beside the version in the history, `history/<machine>/<version>.json`; the shadow is kept by the loop while it watches
the challenger's standing gap, in `history/<machine>/shadow.json`. Figures of gaps are in floors: rms of twin minus measured over
what repeats.
"""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

SECONDS_MIN = 900.0
"""A shadow shorter than that says too little, where the loop's configuration does not say otherwise."""


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class Score(_Kept):
    """The gap of the live description and of this one on so many runs that neither was fitted to; `against` is that live one."""

    live: float
    challenger: float
    runs: int = Field(ge=0)
    against: str = ""


class Card(_Kept):
    """The origin of a version.

    sentence: of the diagnosis, in short; says: its causes in plain words
    signal, words: in which its gap was largest, and how that is called; gap_before, gap_after: of the diagnosis
    fitted_from, fitted_to: the stretch that it was fitted to, ms since 1970
    """

    sentence: str = ""
    verdict: str = ""
    causes: tuple[dict[str, Any], ...] = ()
    says: str = ""
    signal: str = ""
    words: str = ""
    gap_before: float | None = None
    gap_after: float | None = None
    score: Score | None = None
    case: str = ""
    job: str = ""
    fitted_from: int = 0
    fitted_to: int = 0


class Shadow(_Kept):
    """A challenger beside the live description: for how long their standing gaps were compared, and these, by signal."""

    version: str
    against: str
    seconds: float = 0.0
    seconds_min: float = SECONDS_MIN
    live: Mapping[str, float] = Field(default_factory=dict)
    challenger: Mapping[str, float] = Field(default_factory=dict)

    @property
    def sums(self) -> tuple[float, float] | None:
        """The sums over the signals that both are known of, live and challenger; None where there is no such signal."""
        both = [signal for signal in self.live if signal in self.challenger]
        if not both:
            return None
        return sum(self.live[signal] for signal in both), sum(self.challenger[signal] for signal in both)


def why_not(version: str, live: str, card: Card | None, shadow: Shadow | None) -> str | None:
    """Return why a version may not be promoted over the live one; None where it may.

    Nothing is promoted on the data that it was fitted to: it takes runs that it was not fitted to, or its time as a shadow, which
    comes after them.

    >>> why_not("3f2a", "9c01", Card(score=Score(live=3.1, challenger=1.1, runs=2)), None) is None
    True
    >>> why_not("3f2a", "9c01", Card(score=Score(live=1.1, challenger=3.1, runs=2)), None)
    'on 2 runs that it was not fitted to its gap is 3.10 floors, that of the live one 1.10'
    """
    score = card.score if card is not None and card.score is not None and card.score.against in ("", live) else None
    if score is not None and score.runs and score.challenger >= score.live:
        runs = "1 run" if score.runs == 1 else f"{score.runs} runs"
        told = f"its gap is {score.challenger:.2f} floors, that of the live one {score.live:.2f}"
        return f"on {runs} that it was not fitted to {told}"
    own = shadow if shadow is not None and (shadow.version, shadow.against) == (version, live) else None
    if own is not None and own.seconds >= own.seconds_min and (sums := own.sums) is not None and sums[1] >= sums[0]:
        return f"beside the live one its standing gap is {sums[1]:.2f} floors, that of the live one {sums[0]:.2f}"
    if score is not None and score.runs:
        return None
    if own is None:
        return "it has no score on runs that it was not fitted to, and the loop has not watched it beside the live one"
    if own.seconds < own.seconds_min:
        return f"it has run beside the live one for {own.seconds:.0f} of {own.seconds_min:.0f} s, and has no score on other runs"
    if own.sums is None:
        return "no standing gap is known of both, and it has no score on runs that it was not fitted to"
    return None


def read_card(document: Mapping[str, Any] | None) -> Card | None:
    """Return the card in a document; None where it holds none."""
    try:
        return None if document is None else Card.model_validate(document)
    except ValidationError:
        return None


def read_shadow(document: Mapping[str, Any] | None) -> Shadow | None:
    """Return the shadow in a document; None where it holds none."""
    try:
        return None if document is None else Shadow.model_validate(document)
    except ValidationError:
        return None
