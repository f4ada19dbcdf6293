"""The sign beside a verdict. Each has a shape of its own, so that it needs no colour."""

from cnctwin.reports.gap.markup import Markup, joined, tag

RING = tag("circle", cx=16, cy=16, r=13.5, class_="ring")
DISC = tag("circle", cx=16, cy=16, r=15, class_="disc")
TICK = "M8.5 16.8l5 5 10-11"


def drawn(*shapes: Markup) -> Markup:
    """Return the sign that these shapes make, one over another."""
    return tag("svg", joined(shapes), viewBox="0 0 32 32", class_="sign", aria_hidden="true", focusable="false")


def ticked() -> Markup:
    """Return a ring with a tick."""
    return drawn(RING, tag("path", d=TICK, class_="stroke"))


def half() -> Markup:
    """Return a ring whose left half is filled."""
    return drawn(RING, tag("path", d="M16 2.5a13.5 13.5 0 0 0 0 27z", class_="disc"))


def diamond(stroke: str) -> Markup:
    """Return a filled diamond with this path on it."""
    return drawn(tag("path", d="M16 .6 31.4 16 16 31.4.6 16z", class_="disc"), tag("path", d=stroke, class_="stroke on"))
