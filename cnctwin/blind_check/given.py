"""A diagnosis of a case, reduced to what is scored."""

from collections.abc import Mapping
from dataclasses import dataclass

from twin.gap.diagnosis import Diagnosis, Verdict

Interval = tuple[float, float]
Named = tuple[str, str]
"""An effect and what it is on."""


@dataclass(frozen=True, slots=True)
class GivenCause:
    """A cause. alike: effects that are said to be indistinguishable from it; intervals: parameter → 90 % interval."""

    named: Named
    alike: frozenset[Named]
    intervals: Mapping[str, Interval]

    @property
    def reported(self) -> frozenset[Named]:
        """The class that is reported: its name and those it cannot be told from."""
        return self.alike | {self.named}


@dataclass(frozen=True, slots=True)
class Given:
    """The diagnosis as it came. closure_unseen: on runs the diagnosis never had; failed: why there is no diagnosis."""

    verdict: Verdict
    causes: tuple[GivenCause, ...]
    not_identifiable: tuple[str, ...]
    seconds: float
    closure_unseen: float | None = None
    failed: str = ""


def given_of(diagnosis: Diagnosis, seconds: float) -> Given:
    """The diagnosis, reduced."""
    causes = tuple(
        GivenCause(
            (cause.effect, cause.on),
            frozenset((other.effect, other.on) for other in cause.indistinguishable_from),
            {name: (interval.low, interval.high) for name, interval in cause.parameters.items()},
        )
        for cause in diagnosis.causes
    )
    return Given(diagnosis.verdict, causes, diagnosis.not_identifiable, seconds)
