"""The limits that bind: what the time goes to by what keeps it from being less."""

from collections.abc import Sequence
from dataclasses import dataclass

from cnctwin.reports.gap.markup import Markup, scrollable, section, tag
from cnctwin.reports.gap.written import known, share
from cnctwin.reports.optimisation.bar import bar
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import column, quantity
from twin.optimisation.answer import Binds, LineAnswer, Optimised

LEFT_ALONE = "left alone"
NOTHING = "no limit"
MEANING: dict[str, str] = {
    Binds.FEED: "the feed is at the end of its range",
    Binds.SPEED: "the spindle is at the end of its range",
    Binds.FORCE: "more feed a tooth would exceed the force",
    Binds.POWER: "the spindle drive has no more power to give",
    Binds.TORQUE: "the spindle has no more torque to give",
    Binds.CHIP: "the chip would leave its range",
    Binds.SURFACE_SPEED: "the edge would leave its range of speed",
    Binds.CHATTER: "beyond it the cut is unstable, by the tool's dynamics",
    Binds.TOOL_LIFE: "a faster spindle would cost more in tools than it saves",
    Binds.SPEED_CHANGE: "another speed would be better, but the change of it takes longer than it saves",
    Binds.SHARED_SPEED: "another speed would be better for the line, but not for all that have to have the same",
    Binds.DYNAMICS: "the line is too short for the axes to reach its feed",
    Binds.RUN_UP: "the line waits for the spindle to reach its speed, and a lower one is reached sooner",
    NOTHING: "at none of them; the speed of its neighbours or the search decides",
    LEFT_ALONE: "feed as programmed, and the speed where the line needs it; the reasons are below",
}


@dataclass(frozen=True, slots=True)
class Share:
    """All lines that one thing binds: their time after, s, and how many they are."""

    reason: str
    seconds: float
    lines: int


def bound_by(lines: Sequence[LineAnswer]) -> list[Share]:
    """By what binds, most time first; lines that were left alone last."""
    found: dict[str, tuple[float, int]] = {}
    for line in lines:
        reason = line.binds or (LEFT_ALONE if line.left_alone else NOTHING)
        seconds, count = found.get(reason, (0.0, 0))
        found[reason] = (seconds + (line.after.seconds if known(line.after.seconds) else 0.0), count + 1)
    rows = [Share(reason, *sums) for reason, sums in found.items()]
    return sorted(rows, key=lambda row: (row.reason == LEFT_ALONE, -row.seconds, row.reason))


def binding(answer: Optimised) -> Markup | None:
    """The section; none where no line cuts or feeds."""
    if not answer.lines:
        return None
    rows = bound_by(answer.lines)
    total = sum(row.seconds for row in rows)
    first = rows[0]
    if first.reason in (LEFT_ALONE, NOTHING):
        lead = "Every line was left as it is." if first.reason == LEFT_ALONE else "Most of the time no limit binds, as modelled."
    else:
        part = share(first.seconds / total) if total > 0.0 else counted(first.lines, "line")
        bind = "bind" if " and " in first.reason else "binds"
        lead = f"{first.reason[:1].upper()}{first.reason[1:]} {bind} {part} of the time on lines that cut or feed, as modelled."
    drawn = [_row(row, row.seconds / total if total > 0.0 else 0.0) for row in rows]
    head = tag(
        "tr",
        *(
            tag("th", text, scope="col", colspan=wide)
            for text, wide in (("What limits it", None), ("Share of that time, after", "2"), ("Time, s", None), ("Lines", None))
        ),
    )
    table = tag("table", tag("thead", head), tag("tbody", *drawn), class_="data binding")
    rest = answer.after.seconds - total
    note = (
        f"The other {quantity(rest, 's', 3)} of the program are not on these lines: rapids, dwells, changes of tool and of speed."
        if known(rest) and rest > 0.001 * abs(answer.after.seconds)
        else None
    )
    return section(
        "binding",
        "Where the limits bind",
        lead,
        scrollable("What limits the time", table),
        tag("p", note, class_="note") if note else None,
    )


def meaning_of(reason: str) -> str:
    """Return the meaning of a reason, or of several of them.

    >>> meaning_of("cutting force and axis dynamics")
    'more feed a tooth would exceed the force; the line is too short for the axes to reach its feed'
    """
    return "; ".join(said for part in reason.split(" and ") if (said := MEANING.get(part)))


def _row(row: Share, part: float) -> Markup:
    meaning = meaning_of(row.reason)
    return tag(
        "tr",
        tag("th", row.reason, tag("span", meaning, class_="meaning") if meaning else None, scope="row"),
        tag("td", bar(part, "alone" if row.reason == LEFT_ALONE else ""), class_="draw"),
        tag("td", share(part), class_="number"),
        tag("td", column(row.seconds, 3), class_="number"),
        tag("td", f"{row.lines:,}", class_="number"),
    )
