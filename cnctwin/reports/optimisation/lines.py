"""Line by line: source, feed, speed, force and time before and after, and what binds. Of a long program, what matters most."""

from collections.abc import Callable, Sequence

from cnctwin.reports.gap.markup import Markup, each, escaped, joined, scrollable, section, tag
from cnctwin.reports.gap.written import figure, known
from cnctwin.reports.optimisation.binding import NOTHING
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import column, limit_figure, quantity, shortened, to
from twin.optimisation.answer import Cutting, LineAnswer, Optimised

SHOWN = 40
"""So many in sight; the others are folded."""
FORCE = "cutting force"
ROUNDED = 1e-4
"""A figure that is above its limit by no more than it is rounded by is at it."""
Limits = tuple[tuple[str, Callable[[Cutting], float], float], ...]
_MEASURES: tuple[tuple[str, str, Callable[[Cutting], float]], ...] = (
    ("force", FORCE, lambda cut: cut.force_n),
    ("power", "spindle power", lambda cut: cut.power_kw),
    ("torque", "spindle torque", lambda cut: cut.torque_nm),
    ("chip", "chip thickness", lambda cut: 1000.0 * cut.chip_mm),
)
ROWS_MAX = 150
BYTES_MAX = 150_000
"""A longer table is cut."""


def lines(answer: Optimised) -> Markup | None:
    """The section; none where no line cuts or feeds."""
    given = answer.lines
    if not given:
        return None
    kept = limits_of(answer)
    picked = chosen(given, kept)
    lead = "Each line that cuts or feeds, numbered from 1; before → after, as modelled: the worst of its cut over all its runs."
    parts = [_table(answer, picked[:SHOWN], kept, "Lines")]
    if len(picked) > SHOWN:
        summary = tag("summary", f"{counted(len(picked) - SHOWN, 'more line')} of the program")
        parts.append(tag("details", summary, _table(answer, picked[SHOWN:], kept, "More lines")))
    if len(picked) < len(given):
        text = (
            f"{len(given) - len(picked):,} of {len(given):,} lines are left out here: shown are those above a limit "
            "and those whose time changed most. All are in the answer's JSON, under lines."
        )
        parts.append(tag("p", text, class_="note cut"))
    best = "Best: what would be best for the line alone, if changes of speed were free and the axes ideal; told where it differs."
    parts.append(tag("p", best, class_="note"))
    return section("lines", "Line by line", lead, *parts)


def limits_of(answer: Optimised) -> Limits:
    """Upper limits of what a cut may be above: what it is called, how much it is of a line, the figure."""
    found = ((name, value, limit_figure(answer.limits, of)) for of, name, value in _MEASURES)
    return tuple((name, value, limit) for name, value, limit in found if limit is not None)


def above(line: LineAnswer, kept: Limits) -> list[str]:
    """Return which quantities of the line are above their limit, after."""
    return [name for name, value, limit in kept if value(line.after) > limit * (1.0 + ROUNDED)]


def chosen(given: Sequence[LineAnswer], kept: Limits) -> list[LineAnswer]:
    """Return the lines that are shown, in the order of the program: those above a limit, then those whose time changed most."""

    def rank(index: int) -> tuple[bool, float, int]:
        line = given[index]
        changed = abs(line.before.seconds - line.after.seconds)
        return (not above(line, kept), -changed if known(changed) else 0.0, index)

    shown, room = [], BYTES_MAX
    for index in sorted(range(len(given)), key=rank)[:ROWS_MAX]:
        room -= _bytes(given[index])
        if room < 0:
            break
        shown.append(index)
    return [given[index] for index in sorted(shown)]


def _bytes(line: LineAnswer) -> int:
    """About what its row takes in the page."""
    texts = (shortened(line.text_before), shortened(line.text_after), shortened(line.left_alone, 120))
    return 900 + sum(len(escaped(text).encode()) for text in texts)


def _table(answer: Optimised, given: Sequence[LineAnswer], kept: Limits, label: str) -> Markup:
    head = ["Line", "Source", "Feed, mm/min", "Speed, rev/min", "Force, N", "Time, s"]
    if answer.currency and any(line.after.cost is not None for line in given):
        head.append(f"Cost, {answer.currency}")
    rows = [_row(line, above(line, kept), with_cost=len(head) == 7) for line in given]
    table = tag(
        "table",
        tag("thead", tag("tr", each("th", [*head, "What limits it"], scope="col"))),
        tag("tbody", *rows),
        class_="data lines",
    )
    return scrollable(label, table)


def _row(line: LineAnswer, over: Sequence[str], *, with_cost: bool) -> Markup:
    before, after = line.before, line.after
    source: list[str] = [tag("code", shortened(line.text_before.strip()))]
    if line.times > 1:
        source.append(tag("span", f" ×\u00a0{line.times:,}", class_="quiet", title="runs of this line"))
    if line.text_after != line.text_before:
        arrow = tag("span", "→ ", aria_hidden="true")
        source += [
            tag("span", " becomes ", class_="unseen"),
            tag("code", arrow, shortened(line.text_after.strip()), class_="became"),
        ]
    force = [to(column(before.force_n, 3), column(after.force_n, 3)) if line.force_known else Markup("–")]
    if FORCE in over:
        force.append(tag("span", " ▲", class_="above", title="above the limit"))
    cells = [
        tag("td", *source, class_="source"),
        tag("td", to(figure(before.feed_mm_min, 4), figure(after.feed_mm_min, 4)), class_="number"),
        tag("td", to(figure(before.spindle_rpm, 5), figure(after.spindle_rpm, 5)), class_="number"),
        tag("td", joined(force), class_="number"),
        tag("td", to(column(before.seconds, 3), column(after.seconds, 3)), class_="number"),
    ]
    if with_cost:
        cells.append(tag("td", to(column(before.cost, 3), column(after.cost, 3)), class_="number"))
    return tag(
        "tr",
        tag("th", f"{line.line + 1}", scope="row"),
        *cells,
        tag(
            "td", _binds(line), *(tag("span", f"▲ {name} above its limit", class_="above best") for name in over), class_="words"
        ),
    )


def _binds(line: LineAnswer) -> Markup:
    if not line.binds and line.left_alone:
        return tag("span", f"left alone: {shortened(line.left_alone, 120)}", class_="quiet")
    binds = line.binds or NOTHING
    if line.bound is None:
        return joined([binds])
    feed, speed = line.bound
    pairs = [(line.after.feed_mm_min, feed), *([(line.after.spindle_rpm, speed)] if speed > 0.0 else [])]
    if all(known(best) and abs(got - best) <= 5e-3 * abs(best) for got, best in pairs):
        return joined([binds])
    at = f" at {quantity(speed, 'rev/min')}" if speed > 0.0 else ""  # a line in air has no speed of its own
    return joined([binds, tag("span", f"best: {quantity(feed, 'mm/min')}{at}", class_="best")])
