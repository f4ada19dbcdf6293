"""The gap over position, phase, time or section, and the contrasts; a small profile where there is one."""

from collections.abc import Sequence

import numpy as np

from cnctwin.reports.gap.chart import Frame, frame_of, path, plot, x_axis, y_axis
from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.gap.signal_name import gap_unit, signal_name
from cnctwin.reports.gap.written import p_value, stated
from twin.gap.diagnosis import Diagnosis, Pattern

SHOWN = 6
HEIGHT = 96
COLUMNS = 5


def patterns(diagnosis: Diagnosis) -> Markup:
    """The section: what stands first, the rest to be opened."""
    if not diagnosis.patterns:
        return section(
            "patterns", "What it goes with", "No pattern over position, phase, time or section was looked for or found."
        )
    stands = [p for p in diagnosis.patterns if p.discovered]
    others = [p for p in diagnosis.patterns if not p.discovered]
    lead = (
        "The gap before, averaged over what it goes with."
        if stands
        else "Over position, phase, time and section the gap has no pattern that stands out beyond chance."
    )
    rest = None
    if hidden := [*stands[SHOWN:], *others]:
        summary = f"{len(hidden)} more {'patterns' if len(hidden) > 1 else 'pattern'}"
        summary += f", {len(others)} of them within chance" if others else ""
        rest = tag("details", tag("summary", summary), _cards(hidden))
    return section("patterns", "What it goes with", lead, _cards(stands[:SHOWN]) if stands else None, rest)


def _cards(found: Sequence[Pattern]) -> Markup:
    return tag("div", *(_card(pattern) for pattern in found), class_="cards")


def _card(pattern: Pattern) -> Markup:
    scale, unit = _scale(pattern.signal)
    at, mean = np.array(pattern.at, dtype=float), scale * np.array(pattern.mean, dtype=float)
    drawn = _profile(at, mean, pattern.at_unit) if len(at) > 1 and len(at) == len(mean) else None
    label = tag("p", f"twin − measured, {unit}" if unit else "twin − measured", class_="label") if drawn else None
    facts = f"p {p_value(pattern.significance)}{'' if pattern.discovered else ', within chance'}"
    heading = tag("h3", signal_name(pattern.signal), tag("span", f" · {pattern.over}", class_="quiet"))
    return tag(
        "article", heading, tag("p", stated(pattern.sentence)), label, drawn, tag("p", facts, class_="note"), class_="pattern"
    )


def _scale(signal: str) -> tuple[float, str]:
    """By the end of the signal's name, which is its unit."""
    ends = {"mm": "mm", "deg": "deg", "a": "A", "n": "N", "pct": "%", "c": "K", "kw": "kW"}
    unit = ends.get(signal.rsplit("_", 1)[-1], "")
    return gap_unit(unit)


def _profile(at: np.ndarray, mean: np.ndarray, at_unit: str) -> Markup:
    order = np.argsort(at, kind="stable")
    at, mean = at[order], mean[order]
    half_bin = float(np.median(np.diff(at))) / 2.0
    frame = frame_of(np.array([at[0] - half_bin, at[-1] + half_bin]), [mean, np.zeros(1)], HEIGHT)
    line = tag("path", d=path(frame, at, mean), class_="line before")
    bins = _points(frame, at, mean) if len(at) <= 40 else None
    across = tag("div", y_axis(frame), plot(frame, joined([line, bins]), COLUMNS), class_="panel")
    return tag("div", across, tag("div", x_axis(frame, at_unit, COLUMNS), class_="panel time"), class_="charts small")


def _points(frame: Frame, at: np.ndarray, mean: np.ndarray) -> Markup:
    """A dot a bin: a line of no length with a round end, which is not stretched with the plot."""
    places = zip(frame.x(at).tolist(), frame.y(mean).tolist(), strict=True)
    return tag("path", d="".join(f"M{x:.1f} {y:.1f}h.01" for x, y in places if np.isfinite(y)), class_="points")
