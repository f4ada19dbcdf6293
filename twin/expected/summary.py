"""The figures of an expectation by tool: time, greatest load and force, and the lines whose load is not known."""

from typing import NamedTuple

from twin.expected.expectation import Expectation
from twin.expected.expected import Run


class ToolSummary(NamedTuple):
    """Figures of one tool, 0 = before the first change. load_pct, force_n: the greatest of any stretch, None = not known

    lines: that feed or move; unknown: those of them whose load is not known
    """

    tool: int
    time_s: float
    lines: int
    unknown: int
    load_pct: float | None
    force_n: float | None


def summary_of(expectation: Expectation) -> tuple[ToolSummary, ...]:
    """Return the figures of each tool in the order of their first use."""
    by_tool: dict[int, list[Run]] = {}
    for run in expectation.runs:
        by_tool.setdefault(run.tool, []).append(run)
    return tuple(_of_tool(expectation, tool, runs) for tool, runs in by_tool.items())


def _of_tool(expectation: Expectation, tool: int, runs: list[Run]) -> ToolSummary:
    peaks = [found for run in runs if (found := expectation.peak_of(run)) is not None]
    loads = [load for load, _ in peaks if load == load]  # noqa: PLR0124  NaN alone differs from itself
    return ToolSummary(
        tool=tool,
        time_s=sum(run.time_s for run in runs),
        lines=len({run.line for run in runs if run.length_mm > 0.0}),
        unknown=len({run.line for run in runs if not run.stretches}),
        load_pct=max(loads, default=None),
        force_n=max((force for _, force in peaks), default=None),
    )
