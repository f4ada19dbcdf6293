"""The twin's uncertainty and the limit of force: how surely it is kept, what that costs, and which constant matters."""

import math

from cnctwin.reports.gap.markup import Markup, joined, scrollable, section, tag
from cnctwin.reports.gap.written import figure, known, stated
from cnctwin.reports.optimisation.bar import both_ways
from cnctwin.reports.optimisation.quantity import limit_figure, percent, probability, quantity, shortened
from twin.optimisation.answer import Optimised, Parted, Sensitivity

PARTS_MAX = 12


def sensitivity(answer: Optimised) -> Markup:
    """The section."""
    title = "What the twin's uncertainty makes of it"
    given = answer.sensitivity
    if given is None:
        lead = "Not told: with no limit of force, or no uncertainty of the constants, there is nothing to be uncertain of."
        return section("sensitivity", title, lead)
    lead = f"As modelled, the limit of force is kept on every line with a probability of {probability(given.kept)}"
    if given.asked is not None:
        lead += f"; {probability(given.asked)} was asked for"
    return section(
        "sensitivity", title, f"{lead}.", _facts(answer, given), _interval(answer, given), *_parts(given), _source(given)
    )


def _facts(answer: Optimised, given: Sensitivity) -> Markup:
    off = (
        math.sqrt(max(given.kept * (1.0 - given.kept), 0.0) / given.draws) if given.draws > 0 and known(given.kept) else math.nan
    )
    kept = f"{probability(given.kept)} ± {percent(off, 2)}" if known(off) and off > 0.0 else probability(given.kept)
    planned = "the constants as stated: the limit is kept with no probability that was asked for"
    if given.asked is not None:
        planned = f"{probability(given.asked)}{_verdict(given, off)}"
    facts = (
        ("Kept", f"{kept}, on {given.draws:,} draws of the constants other than those it was planned with"),
        ("Planned for", planned),
        ("Greatest force", f"{quantity(given.force_low_n, 'N', 3)} to {quantity(given.force_high_n, 'N', 3)}, 90 % interval"),
        (f"Price of {probability(given.priced)}", _price(answer, given)),
    )
    return tag("dl", *(tag("div", tag("dt", term), tag("dd", text)) for term, text in facts), class_="method")


def _verdict(given: Sensitivity, off: float) -> str:
    """Return True if what was asked for is kept, as far as so many draws tell."""
    if given.asked is None or not known(given.kept):
        return ""
    if given.kept >= given.asked:
        return ", and kept"
    near = known(off) and given.kept + 2.0 * off >= given.asked
    return ", and kept as far as so many draws tell" if near else ", and not kept ▲"


def _price(answer: Optimised, given: Sensitivity) -> str:
    what = {"time": "time", "cost": "cost"}.get(str(answer.objective), "objective")
    would = "is" if given.asked is not None else "would be"
    if not known(given.price_pct):
        return f"no program is known that keeps it with {probability(given.priced)}"
    sign = "+" if given.price_pct > 0.0 else ""
    return (
        f"{sign}{figure(given.price_pct, 3)} %: so much worse the {what} {would} if the limit is kept with "
        f"{probability(given.priced)} instead of with the constants as stated"
    )


def _interval(answer: Optimised, given: Sensitivity) -> Markup | None:
    """The interval of the greatest force on a scale from nothing, with the limit."""
    low, high, mean = given.force_low_n, given.force_high_n, answer.after.force_n
    limit = limit_figure(answer.limits, "force")
    if not (known(low) and known(high) and high >= low) or high <= 0.0:
        return None
    top = 1.08 * max(value for value in (high, mean, limit) if value is not None and known(value))
    at = {name: f"{100.0 * value / top:.2f}%" for name, value in (("low", low), ("high", high))}
    drawn = [
        tag("rect", x=0, y=14, width="100%", height=12, class_="track"),
        tag("rect", x=at["low"], y=14, width=f"{100.0 * (high - low) / top:.2f}%", height=12, class_="bar spread"),
    ]
    said = f"bar: 90 % interval, {quantity(low, 'N', 3)} to {quantity(high, 'N', 3)}"
    if known(mean):
        place = f"{100.0 * mean / top:.2f}%"
        drawn.append(tag("svg", tag("path", d="M0-6 6 0 0 6-6 0z", class_="after"), x=place, y=20, class_="place"))
        said += f"; ◆ with the constants as stated, {quantity(mean, 'N', 3)}"
    if limit is not None:
        place = f"{100.0 * limit / top:.2f}%"
        drawn.append(tag("line", x1=place, x2=place, y1=4, y2=36, class_="limit"))
        said += f"; dots: the limit, {quantity(limit, 'N')}"
    chart = tag("svg", *drawn, class_="interval", width="100%", height=40, role="img", aria_label=said)
    return tag(
        "figure",
        tag("figcaption", "Greatest force of the program, from 0"),
        chart,
        tag("p", said, class_="note"),
        class_="spread",
    )


def _parts(given: Sensitivity) -> list[Markup]:
    parts = [part for part in given.parts if known(part.force_pct)]
    if not parts:
        return []
    shown = sorted(parts, key=lambda part: -abs(part.force_pct))
    largest = max(abs(shown[0].force_pct), 1e-9)
    rows = [_part(part, largest) for part in shown[:PARTS_MAX]]
    head = tag(
        "tr",
        *(
            tag("th", text, scope="col", colspan=wide)
            for text, wide in (("Constant", None), ("One standard deviation of it", None), ("Greatest force by", "2"))
        ),
    )
    table = tag("table", tag("thead", head), tag("tbody", *rows), class_="data parts")
    more = len(shown) - PARTS_MAX
    note = tag("p", f"{more} smaller ones; all are in the answer's JSON.", class_="note cut") if more > 0 else None
    return [tag("h3", "How much each constant contributes"), joined([scrollable("Parts of the uncertainty", table), note])]


def _part(part: Parted, largest: float) -> Markup:
    sign = "±" if part.force_pct >= 0.0 else "∓"
    return tag(
        "tr",
        tag("th", tag("code", shortened(part.path)), scope="row"),
        tag("td", f"± {percent(part.relative, 2)}", class_="number"),
        tag("td", both_ways(part.force_pct / largest), class_="draw"),
        tag("td", f"{sign} {figure(abs(part.force_pct), 2)} %", class_="number"),
    )


def _source(given: Sensitivity) -> Markup | None:
    if not given.source:
        return None
    return tag("p", tag("strong", "Where the intervals come from: "), stated(shortened(given.source, 600)), class_="note")
