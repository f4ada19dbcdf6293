"""Before and after, for the whole program, beside the bound of what is made small and the limits of the rest."""

from dataclasses import dataclass

from cnctwin.reports.gap.markup import Markup, each, escaped, joined, scrollable, section, tag
from cnctwin.reports.gap.written import NONE, known, stated
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import (
    change,
    column,
    length_of_time,
    limit_figure,
    limit_text,
    percent,
    quantity,
    shortened,
    written_s,
)
from twin.optimisation.answer import Objective, Optimised

AT_THE_LIMIT = 0.005
"""Nearer than this to a limit, relative, is at it."""


@dataclass(frozen=True, slots=True)
class Compared:
    """A total before and after."""

    name: str
    unit: str
    before: float | None
    after: float | None


def totals(answer: Optimised) -> Markup:
    """The section."""
    twin = f"the twin of {shortened(answer.machine)}" if answer.machine else "the twin"
    lead = f"Every figure is modelled by {twin}; none of them was measured."
    before, after = answer.before, answer.after
    compared = [(Compared("Time", "s", before.seconds, after.seconds), "seconds")]
    if before.cost is not None or after.cost is not None:
        compared.append((Compared("Cost", answer.currency, before.cost, after.cost), "cost"))
    rows = [_row(row, *(_bound(answer, of) if of == bounds(answer) else (NONE, NONE))) for row, of in compared]
    limited = (
        (Compared("Greatest resultant force", "N", before.force_n, after.force_n), "force"),
        (Compared("Greatest spindle power, electrical", "kW", before.power_kw, after.power_kw), "power"),
        (Compared("Greatest torque, mean over a turn", "N·m", before.torque_nm, after.torque_nm), "torque"),
        (Compared("Greatest chip thickness", "µm", 1000.0 * before.chip_mm, 1000.0 * after.chip_mm), "chip"),
    )
    rows += [_row(row, *_limit(answer, row, of)) for row, of in limited]
    rows.append(_over(answer))
    head = ("Of the program", "Before", "After", "Unit", "Change", "Bound or limit", "Where the answer is")
    table = tag("table", tag("thead", tag("tr", each("th", head, scope="col"))), tag("tbody", *rows), class_="data totals")
    how = (
        [tag("strong", "The bound: "), stated(shortened(answer.bound.how, 600)), f" {_reach(answer)}"]
        if answer.bound.how
        else [_reach(answer)]
    )
    spoken = [length_of_time(answer.before.seconds), length_of_time(answer.after.seconds)]
    over = (
        f"As it was, the program was above a limit on {counted(answer.before.over, 'line')}: part of the change is what keeping "
        "the limits takes."
    )
    time = f"{spoken[0] or quantity(answer.before.seconds, 's')} before, {spoken[1]} after." if spoken[1] else None
    said = [joined(how), over if answer.before.over > answer.after.over else None, time]
    parts = [tag("p", text, class_="note") for text in said if text]
    return section("totals", "Before, after, and the bound", lead, scrollable("Before and after", table), *parts)


def bounds(answer: Optimised) -> str:
    """Return the total that the bound is of: "seconds", "cost", or "" where it is of neither (of a front).

    Of a front it is told by the figures: value · (1 + distance) is the total that the bound is of.
    """
    if answer.objective is not Objective.PARETO:
        return "seconds" if answer.objective is Objective.TIME else "cost"
    reached = answer.bound.value * (1.0 + answer.bound.distance)
    for name, total in (("seconds", answer.after.seconds), ("cost", answer.after.cost)):
        if total is not None and known(reached) and known(total) and abs(reached - total) <= 1e-3 * abs(total):
            return name
    return ""


def _bound(answer: Optimised, of: str) -> tuple[str, str]:
    unit = "s" if of == "seconds" else answer.currency
    value = f"{written_s(answer.bound.value)} s" if unit == "s" else quantity(answer.bound.value, unit)
    return f"≥ {value}", _above(answer)


def _above(answer: Optimised) -> str:
    distance = answer.bound.distance
    if known(distance) and distance <= 0.0:
        return "at the bound"
    return f"{percent(distance)} above the bound"


def _reach(answer: Optimised) -> str:
    if answer.bound.exact:
        return "It is exact: a program within the limits reaches it, so the distance is what is left to gain."
    return "No program can beat it, and perhaps none reaches it; the true optimum lies at or above it."


def _row(row: Compared, limit: str, distance: str) -> Markup:
    written = written_s if row.unit == "s" else column
    cells = (
        tag("td", written(row.before), class_="number"),
        tag("td", tag("b", written(row.after)), class_="number"),
        tag("td", row.unit, class_="unit"),
        tag("td", change(row.before, row.after), class_="number"),
        tag("td", limit, class_="number"),
        tag("td", distance, class_="words"),
    )
    return tag("tr", tag("th", row.name, scope="row"), *cells)


def _limit(answer: Optimised, row: Compared, of: str) -> tuple[str, str]:
    limit, text = limit_figure(answer.limits, of), limit_text(answer.limits, of)
    if limit is None or row.after is None or not known(row.after):
        return (shortened(text, 60), "") if text else ("no limit", NONE)
    return f"≤ {quantity(limit, row.unit)}", place(row.after, limit)


def place(value: float, limit: float) -> str:
    """Return in words where a value is to its limit.

    >>> place(59.99, 60.0), place(30.0, 60.0), place(66.0, 60.0)
    ('at the limit', '50 % below', '▲ 10 % above')
    """
    room = 1.0 - value / limit if limit > 0.0 else -1.0
    if abs(room) <= AT_THE_LIMIT:
        return "at the limit"
    return f"{percent(room, 2)} below" if room > 0.0 else f"▲ {percent(-room, 2)} above"


def _over(answer: Optimised) -> Markup:
    before, after = answer.before.over, answer.after.over
    cells = (
        tag("td", f"{before:,}", class_="number"),
        tag("td", tag("b", f"{after:,}"), class_="number"),
        tag("td", "lines", class_="unit"),
        tag("td", f"{after - before:+,}".replace("-", "−") if after != before else "no change", class_="number"),
        tag("td", "0", class_="number"),
        tag("td", escaped("all within" if after == 0 else "▲ see the lines"), class_="words"),
    )
    return tag("tr", tag("th", "Lines above a limit", scope="row"), *cells)
