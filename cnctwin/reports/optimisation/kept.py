"""The lines that were left alone and why, what is to be known beside, and the limits as they were kept."""

from collections.abc import Sequence

from cnctwin.reports.gap.markup import Markup, each, scrollable, section, tag
from cnctwin.reports.gap.written import stated
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import shortened
from twin.optimisation.answer import LineAnswer, Optimised

NOTES_MAX = 24
RANGES_MAX = 24
LIMITS_MAX = 40
REASONS_MAX = 20


def left_alone(answer: Optimised) -> Markup | None:
    """The section; none where every line was free to change."""
    by_reason: dict[str, list[LineAnswer]] = {}
    for line in answer.lines:
        if line.left_alone:
            by_reason.setdefault(line.left_alone, []).append(line)
    if not by_reason:
        return None
    count = sum(map(len, by_reason.values()))
    keeps = "keeps" if count == 1 else "keep"
    lead = f"{counted(count, 'line')} of {len(answer.lines):,} that cut or feed {keeps} the feed as programmed"
    lead += ", and the speed where it matters."
    rows = [
        tag(
            "tr",
            tag("th", shortened(reason, 160), scope="row"),
            tag("td", ranges([line.line + 1 for line in lines]), class_="words"),
            tag("td", f"{len(lines):,}", class_="number"),
        )
        for reason, lines in list(by_reason.items())[:REASONS_MAX]
    ]
    head = each("th", ("Why", "Lines", "How many"), scope="col")
    table = tag("table", tag("thead", tag("tr", head)), tag("tbody", *rows), class_="data alone")
    more = len(by_reason) - REASONS_MAX
    note = tag("p", f"{more} more reasons; all are in the answer's JSON.", class_="note cut") if more > 0 else None
    return section("alone", "Lines left alone", lead, scrollable("Lines left alone", table), note)


def ranges(numbers: Sequence[int]) -> str:
    """Line numbers, those in a row as a range.

    >>> ranges([3, 5, 6, 7, 12])
    '3, 5–7, 12'
    """
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    said = [f"{first}" if first == last else f"{first}–{last}" for first, last in runs[:RANGES_MAX]]
    return ", ".join(said) + (f" and {len(runs) - RANGES_MAX:,} more places" if len(runs) > RANGES_MAX else "")


def notes(answer: Optimised) -> Markup | None:
    """The section; none where there is nothing to be noted."""
    if not answer.notes:
        return None
    more = len(answer.notes) - NOTES_MAX
    items = [tag("li", stated(shortened(note, 300))) for note in answer.notes[:NOTES_MAX]]
    if more > 0:
        items.append(tag("li", f"{more} more; all are in the answer's JSON."))
    return section("notes", "To be known beside", None, tag("ul", *items))


def limits(answer: Optimised) -> Markup:
    """The section."""
    if not answer.limits:
        return section("limits", "Limits, as they were kept", "No limit was set.")
    rows = [
        tag("tr", tag("th", shortened(name), scope="row"), tag("td", shortened(text, 160), class_="words"))
        for name, text in list(answer.limits.items())[:LIMITS_MAX]
    ]
    head = each("th", ("Limit", "As it was kept"), scope="col")
    table = tag("table", tag("thead", tag("tr", head)), tag("tbody", *rows), class_="data limits")
    lead = "As stated to the optimiser, by the machine's file or by the request; what is not here was not limited."
    return section("limits", "Limits, as they were kept", lead, scrollable("Limits", table))
