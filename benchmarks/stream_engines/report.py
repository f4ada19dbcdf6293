"""The figures of the engines as a table in Markdown."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

from benchmarks.stream_engines.fold import KEYS

SIZES = (200, 20_000)
"""Bytes of state."""


@dataclass(frozen=True, slots=True)
class Disturbed:
    """The effect of a kill: seconds without committed outputs, outputs that came again, keys that ended exact."""

    seconds: float
    repeated: int
    exact: int


@dataclass
class Outcome:
    """The figures of an engine, and its failures."""

    cpu_us: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))
    ratios: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))
    killed: list[Disturbed] = field(default_factory=list)
    taken_over: list[Disturbed] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def span(values: Sequence[float], digits: int, *, unit: str = "") -> str:
    """Return the median of some figures with their range.

    >>> span([1.0, 3.0, 1.26], 1, unit=" s"), span([2.0], 1), span([], 1)
    ('1.3 s (1.0–3.0)', '2.0', '–')
    """
    if not values:
        return "–"
    low, high = (f"{one:.{digits}f}" for one in (min(values), max(values)))
    return f"{median(values):.{digits}f}{unit}" + (f" ({low}–{high})" if low != high else "")


def disturbed(results: Sequence[Disturbed]) -> list[str]:
    """Return seconds, repeated outputs and exact keys as cells of the table."""
    if not results:
        return ["–", "–", "–"]
    exact = min(one.exact for one in results)
    return [
        span([one.seconds for one in results], 1, unit=" s"),
        span([one.repeated for one in results], 0),
        f"{exact} of {KEYS}",
    ]


def table(outcomes: dict[str, Outcome]) -> str:
    """Return the figures as a table in Markdown."""
    kinds = [f"{size:,} B" for size in SIZES]
    head = ["engine", *(f"CPU a message, state {kind}" for kind in kinds), *(f"× plain, state {kind}" for kind in kinds)]
    head += ["kill -9: first new output", "repeated", "keys exact", "takeover: every key", "repeated", "keys exact"]
    rows = [head, ["---"] * len(head)]
    for name, outcome in outcomes.items():
        costs = [span(outcome.cpu_us[size], 1, unit=" µs") for size in SIZES]
        ratios = [span(outcome.ratios[size], 2) for size in SIZES]
        rows.append([name, *costs, *ratios, *disturbed(outcome.killed), *disturbed(outcome.taken_over)])
    lines = [f"| {' | '.join(row)} |" for row in rows]
    failed = [f"- {failure}" for outcome in outcomes.values() for failure in outcome.failures]
    return "\n".join([*lines, *(["", "What failed:", *failed] if failed else [])]) + "\n"
