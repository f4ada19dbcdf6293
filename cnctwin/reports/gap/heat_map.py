"""The gap by place: signal by regime, rms over the floor, before and after. One hue from light to dark, and the figure itself.

A cell that stands after the control of false discoveries has a dot and a bold figure. Signals are grouped with those that have
the same regimes, so that no table is mostly empty.
"""

from collections.abc import Sequence
from itertools import pairwise

from cnctwin.reports.gap.markup import Markup, each, joined, scrollable, section, tag
from cnctwin.reports.gap.signal_name import in_order_of_regimes, in_order_of_signals, is_of_axis, regime_name, signal_name
from cnctwin.reports.gap.written import NONE, known, stated, times
from twin.gap.diagnosis import Cell, Diagnosis

STEPS = (1.2, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Upper ends of the colours but the last: fixed, so that two reports can be laid side by side."""
SENTENCES_MAX = 3

Table = dict[tuple[str, str], Cell]


def where(diagnosis: Diagnosis) -> Markup:
    """The section, its first sentences those of the largest cells."""
    if not diagnosis.where:
        return section("where", "Where it is", "The recordings could not be split into parts.")
    found = [cell for cell in diagnosis.where if cell.discovered and cell.sentence]
    first = stated(found[0].sentence) if found else "No part of it stands out from what repeated runs differ by."
    more = each("li", (stated(cell.sentence) for cell in found[1:SENTENCES_MAX]))
    return section("where", "Where it is", first, tag("ul", more, class_="also") if more else None, _maps(diagnosis), _legend())


def step_of(rms: float) -> int:
    """The colour of a cell, 0 = floor.

    >>> step_of(1.0), step_of(3.0), step_of(1000.0)
    (0, 2, 6)
    """
    return sum(rms > top for top in STEPS)


def groups(cells: Sequence[Cell]) -> list[tuple[list[str], list[str]]]:
    """Signals with the regimes that they have: axes, and of the others those that share a regime, are a group."""
    found: list[tuple[set[str], set[str]]] = []
    for signal in in_order_of_signals(cell.signal for cell in cells):
        signals, regimes = {signal}, {cell.regime for cell in cells if cell.signal == signal}
        axis = is_of_axis(signal)
        alike = [g for g in found if any(map(is_of_axis, g[0])) is axis and (axis or g[1] & regimes)]
        for group in alike:
            found.remove(group)
            signals, regimes = signals | group[0], regimes | group[1]
        found.append((signals, regimes))
    order = in_order_of_regimes(cell.regime for cell in cells)
    return [(in_order_of_signals(sorted(signals)), [r for r in order if r in regimes]) for signals, regimes in found]


def _maps(diagnosis: Diagnosis) -> Markup:
    before = {(cell.signal, cell.regime): cell for cell in diagnosis.where}
    after = {(cell.signal, cell.regime): cell for cell in diagnosis.where_after}
    drawn = []
    for signals, regimes in groups(diagnosis.where):
        beside = bool(after) and len(regimes) <= 6
        pair = [_map("Before" if after else "Gap", before, signals, regimes, named=True)]
        if after:
            pair.append(_map("After, with the causes added", after, signals, regimes, named=not beside))
        drawn.append(tag("div", *pair, class_="pair" if beside else "stack"))
    return joined(drawn)


def _map(title: str, cells: Table, signals: Sequence[str], regimes: Sequence[str], *, named: bool) -> Markup:
    head = tag(
        "tr", tag("th", tag("span", "Signal", class_="unseen"), scope="col"), each("th", map(_narrow, regimes), scope="col")
    )
    rows = [
        tag(
            "tr",
            tag("th", signal_name(signal), scope="row", title=signal),
            *(_cell(cells.get((signal, regime))) for regime in regimes),
        )
        for signal in signals
    ]
    caption = tag("caption", title, tag("span", ", rms in multiples of the repeatability", class_="unseen"))
    table = tag("table", caption, tag("thead", head), tag("tbody", *rows), class_="heat" if named else "heat second")
    return scrollable(f"{title}: gap by signal and regime", table)


def _narrow(regime: str) -> str:
    """The name of a regime that may be broken where it has to be."""
    return regime_name(regime).replace("acceleration", "acceler\u00adation").replace("speed ", "speed\u00a0")


def _cell(cell: Cell | None) -> Markup:
    if cell is None or not known(cell.rms):
        return tag("td", NONE, class_="none")
    shown = times(cell.rms)
    marked = joined([tag("b", shown), tag("span", "stands", class_="unseen")]) if cell.discovered else shown
    return tag("td", marked, class_=f"h{step_of(cell.rms)}{' found' if cell.discovered else ''}", title=cell.sentence or None)


def _legend() -> Markup:
    bounds = ("≤ 1.2", *(f"{low:g}–{high:g}" for low, high in pairwise(STEPS)), f"> {STEPS[-1]:g}")
    scale = [tag("span", text, class_=f"swatch h{step}") for step, text in enumerate(bounds)]
    dot = tag("span", tag("b", "4.20"), class_="swatch h3 found")
    return tag(
        "p",
        tag("span", "rms of twin − recording, × repeatability", class_="of"),
        tag("span", *scale, class_="scale"),
        tag("span", dot, " stands out beyond chance (false discoveries controlled)", class_="of"),
        class_="legend",
    )
