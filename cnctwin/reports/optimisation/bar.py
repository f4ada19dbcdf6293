"""Bars in a row of a table, drawn in per cent of its width so that they fit every screen."""

from cnctwin.reports.gap.markup import Markup, tag
from cnctwin.reports.gap.written import known


def bar(share: float, kind: str = "") -> Markup:
    """A bar of this share, 0 to 1, of its row."""
    width = 100.0 * min(max(share, 0.0), 1.0) if known(share) else 0.0
    drawn = tag("rect", x=0, y=4, width=f"{width:.2f}%", height=10, class_=f"bar {kind}".strip())
    return _row(tag("rect", x=0, y=4, width="100%", height=10, class_="track"), drawn)


def both_ways(share: float) -> Markup:
    """A bar that goes to both sides of the middle of its row: what goes up by as much as it goes down."""
    half = 50.0 * min(max(abs(share), 0.0), 1.0) if known(share) else 0.0
    return _row(
        tag("rect", x=0, y=4, width="100%", height=10, class_="track"),
        tag("rect", x=f"{50.0 - half:.2f}%", y=4, width=f"{2.0 * half:.2f}%", height=10, class_="bar"),
        tag("line", x1="50%", x2="50%", y1=0, y2=18, class_="base"),
    )


def _row(*drawn: Markup) -> Markup:
    return tag("svg", *drawn, width="100%", height=18, aria_hidden="true", focusable="false")
