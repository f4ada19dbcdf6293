"""Time against cost: the front, its chosen program, the program as it was, and the bound that none may pass.

Marks are placed in per cent of the width, so that they are not stretched with the chart; the line between them is.
"""

import math
from collections.abc import Sequence

import numpy as np

from cnctwin.reports.gap.chart import Frame, plot, x_axis, y_axis
from cnctwin.reports.gap.markup import Markup, each, joined, scrollable, section, tag
from cnctwin.reports.gap.written import figure, known
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import change, column, quantity, written_s
from cnctwin.reports.optimisation.totals import bounds
from twin.optimisation.answer import FrontPoint, Optimised

HEIGHT = 320
FAR = 6.0
"""A program that would squeeze the front to less than a part in so many of the chart is told in words instead."""
ROWS_MAX = 24
MARK = {
    "point": "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0z",
    "chosen": "M0-8 8 0 0 8-8 0z",
    "was": "M-6-6 6 6M-6 6 6-6",
}


def front(answer: Optimised) -> Markup | None:
    """The section; none where no front was asked for."""
    points = sorted((p for p in answer.front if known(p.seconds) and known(p.cost)), key=lambda p: (p.seconds, p.cost, p.force_n))
    if not points:
        return None
    title = "Time against cost"
    if len(points) == 1:
        one = points[0]
        at = f"{quantity(one.seconds, 's')} and {quantity(one.cost, answer.currency)}"
        lead = f"Time and cost share one optimum: one program is best in both, at {at}, as modelled."
        return section("front", title, lead)
    fastest, cheapest = points[0], min(points, key=lambda p: (p.cost, p.seconds))
    kept = " All keep the limits." if answer.after.over == 0 else ""
    lead = (
        f"{counted(len(points), 'program')}, none of which is better than another in both, as modelled: the fastest takes "
        f"{quantity(fastest.seconds, 's')} for {quantity(fastest.cost, answer.currency)}, the cheapest "
        f"{quantity(cheapest.seconds, 's')} for {quantity(cheapest.cost, answer.currency)}.{kept}"
    )
    return section("front", title, lead, *_chart(answer, points), _table(answer, points))


def _chart(answer: Optimised, points: Sequence[FrontPoint]) -> list[Markup]:
    was = (answer.before.seconds, answer.before.cost)
    placed = was[1] is not None and known(was[0]) and known(was[1]) and _near(points, was[0], was[1])
    everything = [(p.seconds, p.cost) for p in points]
    if placed and was[1] is not None:
        everything.append((was[0], was[1]))
    bound = bounds(answer)
    frame = _frame(everything)
    drawn = []
    if bound and known(answer.bound.value):
        drawn.append(_bound(frame, bound, answer.bound.value))
    at = np.array([(p.seconds, p.cost) for p in points])
    corners = " ".join(
        f"{'L' if n else 'M'}{x:.1f} {y:.1f}" for n, (x, y) in enumerate(zip(frame.x(at[:, 0]), frame.y(at[:, 1]), strict=True))
    )
    drawn.append(tag("path", d=corners, class_="line front"))
    marks = [_mark(frame, p.seconds, p.cost, "point", _spoken(answer, p)) for p in points if not p.chosen]
    marks += [_mark(frame, p.seconds, p.cost, "chosen", f"chosen: {_spoken(answer, p)}") for p in points if p.chosen]
    if placed and was[1] is not None:
        marks.append(_mark(frame, was[0], was[1], "was", "the program as it was"))
    shown = tag("svg", *marks, class_="marks", width="100%", height=HEIGHT, aria_hidden="true", focusable="false")
    chart = tag(
        "div",
        tag("p", f"cost, {answer.currency}", class_="label"),
        y_axis(frame, 4),
        tag("div", plot(frame, joined(drawn)), shown, class_="plotted"),
        class_="panel",
    )
    axis = tag("div", x_axis(frame, "time, s"), class_="panel time")
    caption = tag("figcaption", tag("p", _keys(placed=placed, bound=bool(bound)), class_="keys"))
    body = tag(
        "div", chart, axis, class_="charts", role="img", aria_label="Cost against time; the figures are in the table below"
    )
    parts = [tag("figure", caption, body, class_="trace")]
    if not placed and was[1] is not None:
        text = (
            f"The program as it was lies far outside of this chart: {quantity(was[0], 's')}, {quantity(was[1], answer.currency)}."
        )
        parts.append(tag("p", text, class_="note"))
    return parts


def _near(points: Sequence[FrontPoint], seconds: float, cost: float) -> bool:
    """Return True if this program leaves the front room enough in the chart, in both directions."""
    for own, other in (([p.seconds for p in points], seconds), ([p.cost for p in points], cost)):
        wide = max(own) - min(own)
        if max(*own, other) - min(*own, other) > FAR * wide > 0.0:
            return False
    return True


def _frame(everything: Sequence[tuple[float, float]]) -> Frame:
    edges = []
    for values in zip(*everything, strict=True):
        low, high = min(values), max(values)
        room = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
        edges += [low - room, high + room]
    return Frame(edges[0], edges[1], edges[2], edges[3], HEIGHT)


def _bound(frame: Frame, of: str, value: float) -> Markup | None:
    if of == "seconds":
        at = float(frame.x(np.array([value]))[0])
        return tag("path", d=f"M{at:.1f} 0V{HEIGHT}", class_="limit") if 0.0 <= at <= 1000.0 else None
    at = float(frame.y(np.array([value]))[0])
    return tag("path", d=f"M0 {at:.1f}H1000", class_="limit") if 0.0 <= at <= HEIGHT else None


def _mark(frame: Frame, seconds: float, cost: float, kind: str, title: str) -> Markup:
    x, y = float(frame.x(np.array([seconds]))[0]) / 10.0, float(frame.y(np.array([cost]))[0])
    shape = tag("path", tag("title", title), d=MARK[kind], class_=f"mark {kind}")
    return tag("svg", shape, x=f"{x:.2f}%", y=round(y, 1), class_="place")


def _spoken(answer: Optimised, point: FrontPoint) -> str:
    return f"{quantity(point.seconds, 's')}, {quantity(point.cost, answer.currency)}, {quantity(point.force_n, 'N', 3)}"


def _keys(*, placed: bool, bound: bool) -> Markup:
    said = [("point", "a program of the front"), ("chosen", "chosen, written out")]
    if placed:
        said.append(("was", "as it was"))
    shapes = [
        tag("span", tag("svg", tag("path", d=MARK[kind], class_=f"mark {kind}"), viewBox="-9 -9 18 18", width=18, height=18,
            aria_hidden="true"), says, class_="key")
        for kind, says in said
    ]  # fmt: skip
    if bound:
        line = tag("svg", tag("path", d="M0 6H26", class_="limit"), width=26, height=12, aria_hidden="true")
        shapes.append(tag("span", line, "bound (dots)", class_="key"))
    return joined(shapes)


def _table(answer: Optimised, points: Sequence[FrontPoint]) -> Markup:
    step = max(1, math.ceil(len(points) / ROWS_MAX))
    shown = [p for n, p in enumerate(points) if n % step == 0 or p.chosen or n == len(points) - 1]
    rows = [
        tag(
            "tr",
            tag("th", written_s(p.seconds), tag("span", "chosen", class_="role") if p.chosen else None, scope="row"),
            tag("td", change(answer.before.seconds, p.seconds), class_="number"),
            tag("td", column(p.cost), class_="number"),
            tag("td", change(answer.before.cost, p.cost), class_="number"),
            tag("td", column(p.force_n, 3), class_="number"),
            tag("td", _range(p.spindle_rpm), class_="number"),
            tag("td", str(answer.front.index(p)), class_="number"),
            class_="named" if p.chosen else None,
        )
        for p in shown
    ]
    head = ("Time, s", "Change", f"Cost, {answer.currency}", "Change", "Greatest force, N", "Speeds, rev/min", "--pick")
    table = tag(
        "table", tag("thead", tag("tr", each("th", head, scope="col"))), tag("tbody", *rows), class_="data front candidates"
    )
    note = (
        f"{len(shown)} of {len(points)} programs; all are in the answer's JSON, under front."
        if len(shown) < len(points)
        else None
    )
    return joined([scrollable("The front", table), tag("p", note, class_="note cut") if note else None])


def _range(given: tuple[float, float]) -> str:
    low, high = (figure(value, 4) for value in given)
    return low if low == high else f"{low} … {high}"
