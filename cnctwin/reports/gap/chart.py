"""A line chart as SVG, by little code of our own: ticks, paths, axes.

A plot is drawn in a box of 1000 by its height and stretched to whatever width the page has; its labels are drawn beside it in
per cent of the width, so that they are not stretched. `report.js` draws into the same boxes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cnctwin.reports.gap.markup import Markup, escaped, joined, tag
from cnctwin.reports.gap.written import figure

Floats = NDArray[np.float64]

WIDTH = 1000.0
COLUMNS = 500
"""Finest division of a path that is drawn into the page; on screen it is drawn again as finely as the screen is."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The box of a plot: what its edges are in the units of the data, and its height in px."""

    left: float
    right: float
    bottom: float
    top: float
    height: int

    def x(self, at: Floats) -> Floats:
        """Places across, 0 to 1000."""
        return np.asarray(WIDTH * (at - self.left) / (self.right - self.left))

    def y(self, values: Floats) -> Floats:
        """Places down, 0 to the height."""
        return np.asarray(self.height * (self.top - values) / (self.top - self.bottom))


def frame_of(at: Floats, series: Sequence[Floats], height: int) -> Frame:
    """The box in which all of the series are seen, with a little room; never an empty one."""
    finite = [kept for values in series if len(kept := values[np.isfinite(values)])]
    low = min((float(values.min()) for values in finite), default=0.0)
    high = max((float(values.max()) for values in finite), default=1.0)
    room = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    left, right = (float(at[0]), float(at[-1])) if len(at) else (0.0, 1.0)
    return Frame(left, right if right > left else left + 1.0, low - room, high + room, height)


def ticks(low: float, high: float, count: int) -> list[float]:
    """About `count` round numbers from low to high.

    >>> ticks(0.0, 10.0, 5)
    [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    """
    if not (math.isfinite(low) and math.isfinite(high)) or high <= low:
        return []
    raw = (high - low) / max(count, 1)
    unit = 10.0 ** math.floor(math.log10(raw))
    step = min((m * unit for m in (1.0, 2.0, 5.0, 10.0)), key=lambda s: abs(math.log(s / raw)))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(n * step, 12) for n in range(first, last + 1)]


def envelope(x: Floats, y: Floats, columns: int = COLUMNS) -> tuple[Floats, Floats]:
    """At most two points a column, its least and its greatest, in the order in which the line goes; (n,) each."""
    if len(x) <= 2 * columns:
        return x, y
    column = np.clip((x / WIDTH * columns).astype(int), 0, columns - 1)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    least, greatest = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    last = np.append(starts[1:], len(y)) - 1
    rising = np.nan_to_num(y[last]) <= np.nan_to_num(y[starts])  # y goes downwards in the box; either order is right
    first, second = np.where(rising, greatest, least), np.where(rising, least, greatest)
    middle = (column[starts] + 0.5) * WIDTH / columns
    return np.repeat(middle, 2), np.column_stack([first, second]).ravel()


def path(frame: Frame, at: Floats, values: Floats, columns: int = COLUMNS) -> str:
    """The line through the values, broken where one is missing."""
    x, y = envelope(frame.x(at), frame.y(values), columns)
    words, down = [], False
    for across, along in zip(x.tolist(), y.tolist(), strict=True):
        if not math.isfinite(along):
            down = False
            continue
        words.append(
            f"{'' if down else 'M'}{across:.0f} {along:.1f}" if len(x) > 400 else f"{'' if down else 'M'}{across:.1f} {along:.1f}"
        )
        down = True
    return " ".join(words)


def band(frame: Frame, at: Floats, half: Floats) -> str:
    """The area between −half and +half, in steps; where there is none it is a line."""
    if not len(at):
        return ""
    kept = np.flatnonzero(np.append(True, np.diff(np.nan_to_num(half)) != 0))
    if len(kept) > COLUMNS:
        kept = kept[:: len(kept) // COLUMNS + 1]
    left = frame.x(at[kept]).tolist()
    wide = np.nan_to_num(half[kept])
    upper, lower = frame.y(wide).tolist(), frame.y(-wide).tolist()
    right = [*left[1:], WIDTH]
    areas = (f"M{a:.1f} {u:.1f}H{b:.1f}V{d:.1f}H{a:.1f}z" for a, b, u, d in zip(left, right, upper, lower, strict=True))
    return "".join(areas)


def plot(frame: Frame, inside: str, columns: int = 8) -> Markup:
    """The box, with lines at the round numbers below what is in it."""
    across = "".join(f"M0 {y:.1f}H1000" for y in frame.y(np.array(ticks(frame.bottom, frame.top, row_count(frame)))).tolist())
    along = "".join(f"M{x:.1f} 0V{frame.height}" for x in frame.x(np.array(ticks(frame.left, frame.right, columns))).tolist())
    zero = f"M0 {float(frame.y(np.zeros(1))[0]):.1f}H1000" if frame.bottom < 0.0 < frame.top else ""
    drawn = [tag("path", d=across + along, class_="grid"), tag("path", d=zero, class_="zero"), inside]
    box = f"0 0 1000 {frame.height}"
    return tag(
        "svg", *drawn, class_="plot", viewBox=box, preserveAspectRatio="none", width="100%", height=frame.height,
        aria_hidden="true", focusable="false",
    )  # fmt: skip


def row_count(frame: Frame) -> int:
    """Return how many labels there is room for."""
    return max(2, frame.height // 30)


def y_axis(frame: Frame, digits: int = 3) -> Markup:
    """The labels to the left of a plot, with so many significant digits."""
    at = ticks(frame.bottom, frame.top, row_count(frame))
    places = frame.y(np.array(at)).tolist()
    texts = [
        tag("text", figure(value, digits), x="100%", dx=-8, y=round(min(max(y + 4, 10), frame.height - 1), 1), text_anchor="end")
        for value, y in zip(at, places, strict=True)
    ]
    return tag("svg", *texts, class_="y", width=64, height=frame.height, aria_hidden="true", focusable="false")


def x_axis(frame: Frame, unit: str, columns: int = 8) -> Markup:
    """The labels below a plot; the unit stands to the left of them."""
    at = ticks(frame.left, frame.right, columns)
    texts = [
        tag("text", figure(value, 6), x=f"{x / 10:.2f}%", y=14, text_anchor=anchor(x))
        for value, x in zip(at, frame.x(np.array(at)).tolist(), strict=True)
    ]
    drawn = tag("svg", *texts, class_="x", width="100%", height=20, aria_hidden="true", focusable="false")
    return joined([tag("span", escaped(unit), class_="unit"), drawn])


def anchor(place: float) -> str:
    """Return how a label at this place, 0 to 1000, is held so that it stays within the plot."""
    return "start" if place < 15 else "end" if place > 985 else "middle"


def panel(frame: Frame, label: str, inside: str, /, digits: int = 3, **attributes: str) -> Markup:
    """A plot with its labels and what it shows."""
    return tag("div", tag("p", label, class_="label"), y_axis(frame, digits), plot(frame, inside), class_="panel", **attributes)
