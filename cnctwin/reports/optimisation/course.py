"""Line by line along the program: force, feed and spindle speed, before and after, with their limits.

Across runs the time that the program took before, so that each line is as wide as the time that was to be gained on it, and
before and after stand above each other. A line that runs several times is drawn once, as wide as all its runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cnctwin.reports.gap.chart import Frame, panel, path, x_axis
from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.gap.written import figure
from cnctwin.reports.optimisation.quantity import limit_figure
from twin.optimisation.answer import Cutting, LineAnswer, Optimised

Floats = NDArray[np.float64]

COLUMNS = 240
"""Finest division of a curve; a program of more lines is drawn by the least and the greatest in each."""
TITLED_MAX = 150
"""Up to so many lines each has its figures as a tooltip."""
NUMBERED_MAX = 24
BLOCKS = 10


@dataclass(frozen=True, slots=True)
class Shown:
    """A panel's curve over the lines. of: as its limit is called in `quantity`."""

    of: str
    name: str
    unit: str
    height: int
    value: Callable[[Cutting], float]


PANELS = (
    Shown("force", "Greatest resultant force of the line", "N", 170, lambda c: c.force_n),
    Shown("feed", "Feed", "mm/min", 120, lambda c: c.feed_mm_min),
    Shown("speed", "Spindle speed", "rev/min", 120, lambda c: c.spindle_rpm),
)


def course(answer: Optimised) -> Markup:
    """The section."""
    lines = answer.lines
    if not lines:
        return section("course", "Along the program", "No line of this program cuts or feeds.")
    edges, timed = edges_of(lines)
    panels = [_panel(answer, edges, shown) for shown in PANELS]
    axis = Frame(0.0, float(edges[-1]), 0.0, 1.0, 20)
    body = tag(
        "div",
        *panels,
        tag("div", _strip(lines, edges), class_="panel regimes"),
        tag("div", x_axis(axis, "time, s" if timed else "lines"), class_="panel time"),
        class_="charts",
        role="group",
        aria_label="Force, feed and speed of each line, before and after; the same figures are in the table of lines",
    )
    caption = tag("figcaption", tag("p", _keys(), class_="keys"))
    lead = "The greatest force, the feed and the speed of each line, before and after, as modelled."
    across = "Across: the time that these lines took before" if timed else "Across: the lines that cut or feed"
    across_said = f"{across}. The strip below the curves has the numbers of the lines in the file."
    if len(lines) > COLUMNS:
        across_said += f" {len(lines):,} lines are drawn by their least and greatest in each of {COLUMNS} columns."
    note = tag("p", across_said, class_="note")
    return section("course", "Along the program", lead, tag("figure", caption, body, class_="trace course"), note)


def edges_of(lines: Sequence[LineAnswer]) -> tuple[Floats, bool]:
    """Return the edges of the lines, (n + 1,), in time before; False: where that is nothing, in lines."""
    wide = np.array([line.before.seconds for line in lines])
    wide = np.where(np.isfinite(wide) & (wide > 0.0), wide, 0.0)
    if wide.sum() <= 0.0:
        return np.arange(len(lines) + 1.0), False
    return np.append(0.0, np.cumsum(wide)), True


def steps(edges: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The corners of a course that holds each value over its line; (2 n,) each."""
    return np.repeat(edges, 2)[1:-1], np.repeat(values, 2)


def _panel(answer: Optimised, edges: Floats, shown: Shown) -> Markup:
    of, unit = shown.of, shown.unit
    before = np.array([shown.value(line.before) for line in answer.lines])
    after = np.array([shown.value(line.after) for line in answer.lines])
    limit = limit_figure(answer.limits, of)
    both = np.append(before, after)
    most = float(np.max(both[np.isfinite(both)], initial=0.0))
    seen = limit is not None and (of == "force" or limit <= 2.5 * most)
    top = max(most, limit if limit is not None and seen else 0.0)
    frame = Frame(0.0, float(edges[-1]), 0.0, 1.1 * top if top > 0.0 else 1.0, shown.height)
    drawn = [
        tag("path", d=path(frame, *steps(edges, values), COLUMNS), class_=f"line {kind}", data_series=kind)
        for kind, values in (("before", before), ("after", after))
    ]
    label = f"{shown.name}, {unit}"
    if limit is not None:
        at = float(frame.y(np.array([limit]))[0])
        if seen:
            drawn.append(tag("path", d=f"M0 {at:.1f}H1000", class_="limit"))
        label += f"; limit {figure(limit, 4)} {unit}{'' if seen else ', far above'}"
    hits = _hits(answer.lines, edges, frame, shown) if len(answer.lines) <= TITLED_MAX else []
    return panel(frame, label, joined([*drawn, *hits]), data_panel=of)


def _hits(lines: Sequence[LineAnswer], edges: Floats, frame: Frame, shown: Shown) -> list[Markup]:
    """Over each line its figures, where a mouse rests on it."""
    hits = []
    for line, (left, right) in zip(lines, pairwise(frame.x(edges).tolist()), strict=True):
        said = f"{figure(shown.value(line.before), 4)} → {figure(shown.value(line.after), 4)} {shown.unit}"
        title = tag("title", f"line {line.line + 1}: {said}")
        hits.append(tag("rect", title, x=round(left, 1), width=round(right - left, 1), y=0, height=frame.height, class_="hit"))
    return hits


def blocks(lines: Sequence[LineAnswer], edges: Floats) -> list[tuple[int, int]]:
    """First and last index of each block of the strip: a line each, or about equal parts of the time."""
    if len(lines) <= NUMBERED_MAX:
        return [(n, n) for n in range(len(lines))]
    firsts = sorted({int(n) for n in np.searchsorted(edges[:-1], np.linspace(0.0, edges[-1], BLOCKS, endpoint=False))})
    return [(first, last - 1) for first, last in pairwise([*(n for n in firsts if n < len(lines)), len(lines)])]


def _strip(lines: Sequence[LineAnswer], edges: Floats) -> Markup:
    drawn, whole = [], float(edges[-1])
    for number, (first, last) in enumerate(blocks(lines, edges)):
        left, right = float(edges[first]) / whole, float(edges[last + 1]) / whole
        title = f"{lines[first].line + 1}" if first == last else f"{lines[first].line + 1}–{lines[last].line + 1}"
        place = {"x": f"{100 * left:.2f}%", "width": f"{100 * (right - left):.2f}%"}
        drawn.append(tag("rect", tag("title", f"line {title}"), **place, y=0, height=16, class_=f"r{3 * (number % 2)}"))
        if right - left > 0.011 * len(title):
            drawn.append(tag("text", title, x=f"{50 * (left + right):.2f}%", y=12, text_anchor="middle"))
    return tag("svg", *drawn, class_="strip", width="100%", height=16, aria_hidden="true", focusable="false")


def _keys() -> Markup:
    return joined(
        tag(
            "span", tag("svg", tag("path", d="M0 6H26", class_=kind), width=26, height=12, aria_hidden="true"), says, class_="key"
        )
        for kind, says in (("line before", "before (dashed)"), ("line after", "after"), ("limit", "limit (dots)"))
    )
