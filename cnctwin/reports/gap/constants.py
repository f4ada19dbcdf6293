"""The constants that take up a part of the gap: stated and found, and by how many stated deviations they moved."""

from cnctwin.reports.gap.markup import Markup, scrollable, section, tag
from cnctwin.reports.gap.written import figure, share
from twin.gap.diagnosis import Diagnosis, MovedConstant

FAR = 2.0
"""Stated deviations beyond which a constant that moved is a finding."""


def constants(diagnosis: Diagnosis) -> Markup | None:
    """The section of the constants that moved; None where none did."""
    moved = diagnosis.constants
    if not moved:
        return None
    far = sum(one.deviations > FAR for one in moved)
    lead = (
        "The refitted constants of the machine that take up a part of the gap as stated, each by itself: what two of them can "
        "both take up is counted twice, so the shares need not add up to 100 %."
    )
    if far:
        lead += f" {far} of them moved by more than two of the deviations that the file states: that is a finding."
    head = tag("tr", *(tag("th", t, scope="col") for t in ("Constant", "Stated", "Found", "Moved by", "Takes of the gap")))
    table = tag("table", tag("thead", head), tag("tbody", *(_row(one) for one in moved)), class_="data")
    return section("constants", "What the constants take up", lead, scrollable("Constants that moved", table))


def _row(one: MovedConstant) -> Markup:
    return tag(
        "tr",
        tag("th", tag("code", one.name), scope="row"),
        tag("td", figure(one.stated), class_="number"),
        tag("td", figure(one.found, 4), class_="number"),
        tag("td", f"{figure(one.deviations, 2)} σ", class_="number"),
        tag("td", share(one.closure), class_="number"),
        class_="named" if one.deviations > FAR else None,
    )
