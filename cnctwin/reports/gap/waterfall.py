"""The closure: the gap step by step down to the floor, and by signal.

The length of a step is its share of the reducible gap, before² − floor², so that the steps add up; beside it stands the rms over
the floor that is left, √(floor² + rest · (before² − floor²)).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from cnctwin.reports.gap.markup import Markup, each, joined, scrollable, section, tag
from cnctwin.reports.gap.signal_name import effect_name, gap_unit, in_order_of_signals, signal_name
from cnctwin.reports.gap.written import NONE, figure, known, share, times
from twin.gap.diagnosis import Diagnosis, GapNumbers, SignalGap, Verdict, closure_of


@dataclass(frozen=True, slots=True)
class Step:
    """A bar: from `low` to `high`, shares of the reducible gap that are left; what it is, what it says, what is left after it."""

    name: str
    kind: str
    low: float
    high: float
    says: str
    left: str


def how_far(diagnosis: Diagnosis) -> Markup:
    """The section."""
    gap = diagnosis.gap
    if diagnosis.verdict is Verdict.HEALTHY or not (known(gap.before) and known(gap.floor) and gap.before > gap.floor):
        lead = f"There is nothing to close: {times(gap.before)} × the repeatability is no more than what repeated runs differ by."
        return section("far", "How far it shrinks", lead, _by_signal(gap))
    total = f"{share(gap.closure)} of the gap above the repeatability is closed"
    if known(gap.closure_low) and known(gap.closure_high):
        total += f" (90 % interval {share(gap.closure_low)} to {share(gap.closure_high)})"
    lead = f"{total}, judged on runs that were not fitted." if diagnosis.causes else "Nothing in the catalogue closes it."
    return section("far", "How far it shrinks", lead, _chart(list(steps(diagnosis)), gap), _by_signal(gap))


def steps(diagnosis: Diagnosis) -> Iterator[Step]:
    """The gap before, a step for each cause, largest first, the remainder without a name."""
    gap = diagnosis.gap
    yield Step("Before", "before", 0.0, 1.0, "100 %", f"{times(gap.before)} × repeatability")
    left = 1.0
    for cause in sorted(diagnosis.causes, key=lambda c: -c.closure if known(c.closure) else 0.0):
        size = min(max(cause.closure, 0.0), left) if known(cause.closure) else 0.0
        left = max(left - size, 0.0)
        says = f"− {share(cause.closure)}" if known(cause.closure) else NONE
        yield Step(effect_name(cause.effect, cause.on), "cause", left, left + size, says, f"leaves {times(_level(gap, left))} ×")
    if diagnosis.causes and known(gap.closure):
        left = 1.0 - min(max(gap.closure, 0.0), 1.0)
    yield Step(
        "Without a name",
        "rest",
        0.0,
        left,
        share(left),
        f"{times(gap.after if diagnosis.causes else gap.before)} × repeatability",
    )


def _level(gap: GapNumbers, left: float) -> float:
    return math.sqrt(max(gap.floor**2 + left * (gap.before**2 - gap.floor**2), 0.0))


def _percent(value: float) -> str:
    return f"{100 * min(max(value, 0.0), 1.0):.2f}%"


def _bar(step: Step, gap: GapNumbers) -> Markup:
    drawn = [
        tag("line", x1="0%", x2="0%", y1=0, y2="100%", class_="base"),
        tag("rect", x=_percent(step.low), width=_percent(step.high - step.low), y=5, height=18, class_=f"bar {step.kind}"),
    ]
    if step.kind == "cause":
        drawn.append(tag("line", x1=_percent(step.low), x2=_percent(step.low), y1=5, y2="100%", class_="fall"))
    if step.kind == "rest" and known(gap.closure_low) and known(gap.closure_high):
        low, high = _percent(1.0 - gap.closure_high), _percent(1.0 - gap.closure_low)
        drawn += [
            tag("line", x1=low, x2=high, y1=14, y2=14, class_="whisker"),
            *(tag("line", x1=at, x2=at, y1=9, y2=19, class_="whisker") for at in (low, high)),
        ]
    return tag("svg", *drawn, width="100%", height=28, aria_hidden="true", focusable="false")


def _chart(drawn: list[Step], gap: GapNumbers) -> Markup:
    rows = [
        tag(
            "tr",
            tag("th", step.name, scope="row"),
            tag("td", _bar(step, gap), class_="draw"),
            tag("td", step.says, class_="number"),
            tag("td", step.left, class_="number quiet"),
            class_=f"is-{step.kind}",
        )
        for step in drawn
    ]
    floor = tag(
        "tr",
        tag("th", "Repeatability", scope="row"),
        tag(
            "td",
            tag(
                "svg", tag("line", x1="0%", x2="0%", y1=0, y2="100%", class_="base"), width="100%", height=28, aria_hidden="true"
            ),
        ),
        tag("td", "0 %", class_="number"),
        tag("td", f"{times(gap.floor)} ×", class_="number quiet"),
        class_="is-floor",
    )
    head = each("th", ("Step", "Gap above the repeatability (rms² − repeatability²)", "Share", "Rms"), scope="col")
    return tag("table", tag("thead", tag("tr", head)), tag("tbody", *rows, floor), class_="waterfall")


def _by_signal(gap: GapNumbers) -> Markup | None:
    signals = in_order_of_signals(gap.by_signal)
    if not signals:
        return None
    largest = max(
        [2.0, *(ratio for name in signals if known(ratio := _ratio(gap.by_signal[name].before, gap.by_signal[name].floor)))]
    )
    top = math.log(largest) * 1.04
    head = ("Signal", "Before", "After", "Repeatability", "Unit", "× repeatability", "Closed")
    rows = [_signal_row(name, gap.by_signal[name], top) for name in signals]
    table = tag(
        "table", tag("thead", tag("tr", *(tag("th", h, scope="col") for h in head))), tag("tbody", *rows), class_="data signals"
    )
    shapes = [("●", "before", " before, "), ("◆", "after", f" after; from 1 to {times(largest)} ×, logarithmic")]
    key = joined(part for sign, kind, says in shapes for part in (tag("span", sign, class_=f"key {kind}"), says))
    return joined([tag("h3", "By signal"), scrollable("The gap by signal", table), tag("p", key, class_="note signals-key")])


def _ratio(value: float, floor: float) -> float:
    return value / floor if known(value) and known(floor) and floor > 0 else math.nan


def _signal_row(name: str, gap: SignalGap, top: float) -> Markup:
    scale, unit = gap_unit(gap.unit)
    cells = [
        tag("td", figure(value * scale if known(value) else None), class_="number")
        for value in (gap.before, gap.after, gap.floor)
    ]
    numbers = known(gap.before) and known(gap.after) and known(gap.floor)
    closed = share(closure_of(gap.before, gap.after, gap.floor)) if numbers and gap.before > 1.2 * gap.floor else NONE
    return tag(
        "tr",
        tag("th", signal_name(name), scope="row", title=name),
        *cells,
        tag("td", unit, class_="unit"),
        tag("td", _dumbbell(_ratio(gap.before, gap.floor), _ratio(gap.after, gap.floor), top), class_="draw"),
        tag("td", closed, class_="number"),
    )


def _dumbbell(before: float, after: float, top: float) -> Markup:
    if not (known(before) and known(after)):
        return Markup("")
    from_, to = (_percent(math.log(max(ratio, 1.0)) / top) for ratio in (before, after))
    diamond = tag("svg", tag("path", d="M0-5.5 5.5 0 0 5.5-5.5 0z", class_="after"), x=to, y=10, class_="place")
    return tag(
        "svg",
        tag("line", x1="0%", x2="100%", y1=10, y2=10, class_="rail"),
        tag("line", x1=from_, x2=to, y1=10, y2=10, class_="between"),
        tag("circle", cx=from_, cy=10, r=4.5, class_="before"),
        diamond,
        width="100%",
        height=20,
        role="img",
        aria_label=f"{times(before)} times the floor before, {times(after)} after",
    )
