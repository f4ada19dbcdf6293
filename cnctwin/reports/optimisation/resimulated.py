"""The rewritten program on the whole simulated machine, beside the original: what the search's quick evaluation left out."""

from cnctwin.reports.gap.markup import Markup, each, scrollable, section, tag
from cnctwin.reports.gap.written import stated
from cnctwin.reports.optimisation.quantity import change, column, limit_figure, shortened, written_s
from cnctwin.reports.optimisation.totals import place
from twin.optimisation.answer import Optimised

NOTES_MAX = 20


def resimulated(answer: Optimised) -> Markup:
    """The section."""
    title = "Run again on the whole simulated machine"
    given = answer.resimulated
    if given is None:
        return section("again", title, "It was not: the figures above are those of the search.")
    rows = [
        _row("Time", "s", given.seconds, 4),
        _row("Greatest resultant force", "N", given.force_n, 3),
        *(
            _row(f"Greatest following error of {axis.upper()}", "mm", pair, 3)
            for axis, pair in sorted(given.following_error_mm.items())
        ),
    ]
    limit = limit_figure(answer.limits, "force")
    lead = "Original and rewritten program, servo loops included; modelled, not measured."
    if limit is not None:
        lead += f" The force after is {place(given.force_n[1], limit)}{' the limit' if _beside(given.force_n[1], limit) else ''}."
    head = ("Of the program", "Before", "After", "Unit", "Change")
    table = tag("table", tag("thead", tag("tr", each("th", head, scope="col"))), tag("tbody", *rows), class_="data totals")
    notes = tag("ul", each("li", (stated(shortened(note, 300)) for note in given.notes[:NOTES_MAX]))) if given.notes else None
    return section("again", title, lead, scrollable("Run again", table), notes)


def _beside(value: float, limit: float) -> bool:
    return place(value, limit) != "at the limit"


def _row(name: str, unit: str, pair: tuple[float, float], digits: int) -> Markup:
    before, after = pair
    cells = (
        tag("td", written_s(before) if unit == "s" else column(before, digits), class_="number"),
        tag("td", tag("b", written_s(after) if unit == "s" else column(after, digits)), class_="number"),
        tag("td", unit, class_="unit"),
        tag("td", change(before, after), class_="number"),
    )
    return tag("tr", tag("th", name, scope="row"), *cells)
