"""The subsystems, each compared alone with what was measured at its input, in the order in which a signal goes through them."""

from collections.abc import Sequence

from cnctwin.reports.gap.markup import Markup, joined, scrollable, section, tag
from cnctwin.reports.gap.signal_name import effect_phrase, signal_name
from cnctwin.reports.gap.written import times
from twin.gap.diagnosis import Diagnosis, Subsystem, Verdict

_ORDER = ("controller", "mechanics", "table", "cut", "spindle load", "heat", "program", "clock")
_WORD = {
    Verdict.HEALTHY: "healthy",
    Verdict.EXPLAINED: "explained",
    Verdict.PARTLY: "partly explained",
    Verdict.UNKNOWN: "cause unknown",
}


def subsystems(diagnosis: Diagnosis) -> Markup | None:
    """The section of the subsystems; None where none was compared alone."""
    if not diagnosis.subsystems:
        return None
    lead = "Each part alone, driven by what was measured at its input: whatever is wrong in one is not blamed on the next."
    rows = [_row(one) for one in in_order(diagnosis.subsystems)]
    titles = ("Part", "Driven by", "Compared", "Gap, before → after", "Verdict")
    head = tag("tr", *(tag("th", title, scope="col") for title in titles))
    table = tag("table", tag("thead", head), tag("tbody", *rows), class_="data subsystems")
    return section("subsystems", "Part by part", lead, scrollable("Subsystems", table))


def in_order(found: Sequence[Subsystem]) -> list[Subsystem]:
    """The subsystems axis by axis, controller first, then cut, spindle, heat, program and clock."""

    def place(one: Subsystem) -> tuple[int, str, int]:
        axis, _, part = one.subsystem.partition(" ")
        of_axis = part in _ORDER[:3]
        name = part if of_axis else one.subsystem
        return (0 if of_axis else 1, axis if of_axis else "", _ORDER.index(name) if name in _ORDER else len(_ORDER))

    return sorted(found, key=place)


def subsystem_name(subsystem: str) -> str:
    """A subsystem in words.

    >>> subsystem_name("x mechanics"), subsystem_name("spindle load")
    ('X mechanics', 'Spindle load')
    """
    return subsystem[:1].upper() + subsystem[1:]


def _row(one: Subsystem) -> Markup:
    gap = joined([times(one.before), " → ", times(one.after), tag("small", " ×")])
    causes = ", ".join(effect_phrase(name) for name in one.causes)
    called = joined([tag("span", _WORD[one.verdict], class_=f"called-{one.verdict.value}"), f": {causes}" if causes else None])
    return tag(
        "tr",
        tag("th", subsystem_name(one.subsystem), scope="row"),
        tag("td", ", ".join(signal_name(name) for name in one.driven_by), class_="words"),
        tag("td", signal_name(one.compared), class_="words"),
        tag("td", gap, class_="number"),
        tag("td", called, class_="words"),
    )
