"""A diagnosis of a case, reduced to what is scored; read from `diagnosis.json` (formats, section 6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from twin.gap.diagnosis import Verdict

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
class GivenTerm:
    """A term that was learned: where it acts, what it is on, on what it depends, and the share of the gap that it closes."""

    site: str
    on: str
    depends_on: frozenset[str]
    closure: float


@dataclass(frozen=True, slots=True)
class Given:
    """The diagnosis as it came.

    closure_unseen: on runs the diagnosis never had; failed: why there is no diagnosis
    subsystems: name → verdict; learned: the term that closes most first
    constants: path of each that moved → stated deviations
    """

    verdict: Verdict
    causes: tuple[GivenCause, ...]
    not_identifiable: tuple[str, ...]
    seconds: float
    closure_unseen: float | None = None
    failed: str = ""
    subsystems: Mapping[str, Verdict] = field(default_factory=dict)
    learned: tuple[GivenTerm, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict)


def given_of(kept: Mapping[str, Any]) -> Given:
    """Return what is scored of a kept diagnosis: `diagnosis`, `seconds`, `failed`, `closure_unseen`."""
    found = kept["diagnosis"]
    learned = [
        GivenTerm(term["site"], term.get("on", ""), frozenset(term["depends_on"]), term.get("closure") or 0.0)
        for term in found.get("learned", ())
    ]
    return Given(
        Verdict(found.get("verdict", Verdict.UNKNOWN)),
        _causes(found.get("causes", ())),
        tuple(found.get("not_identifiable", ())),
        kept["seconds"],
        kept["closure_unseen"],
        kept["failed"],
        {one["subsystem"]: Verdict(one["verdict"]) for one in found.get("subsystems", ())},
        tuple(sorted(learned, key=lambda term: -term.closure)),
        {one["name"]: one["deviations"] for one in found.get("constants", ())},
    )


def _causes(causes: Sequence[Mapping[str, Any]]) -> tuple[GivenCause, ...]:
    return tuple(
        GivenCause(
            (cause["effect"], cause["on"]),
            frozenset((other["effect"], other["on"]) for other in cause["indistinguishable_from"]),
            {name: _interval(values) for name, values in cause["parameters"].items()},
        )
        for cause in causes
    )


def _interval(values: Mapping[str, Any]) -> Interval:
    """Return the ends of an interval; one that is null is open."""
    low, high = values["low"], values["high"]
    return (float("-inf") if low is None else low, float("inf") if high is None else high)
