"""Learned terms: what is there and in no catalogue, drawn with its band. They describe; they name no cause."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cnctwin.reports.gap.chart import Frame, frame_of, path, plot, x_axis, y_axis
from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.gap.signal_name import effect_phrase, signal_name
from cnctwin.reports.gap.written import figure, known, share, stated
from twin.gap.diagnosis import Diagnosis, Learned

Floats = NDArray[np.float64]
HEIGHT = 150
CURVES_MOST = 6
"""Curves of one term that are drawn: values of its second argument, or runs."""
VALUES = ("value", "low", "high")
_SITES = {
    "controller": "Torque command",
    "axis_force": "Force",
    "friction": "Friction",
    "table_position": "Table position",
    "position_reading": "Position reading",
    "table_reading": "Table reading",
    "torque_reading": "Torque reading",
    "cut_force": "Cutting force",
    "force_reading": "Force reading",
    "spindle_power": "Spindle power",
    "heat_input": "Heat input",
    "heat_loss": "Heat loss",
    "temperature_reading": "Temperature reading",
    "program_time": "Program time",
}
_UNITS = {
    "mm_s": "mm/s",
    "mm_s2": "mm/s²",
    "deg_s": "deg/s",
    "deg_s2": "deg/s²",
    "rpm": "rev/min",
    "a": "A",
    "c": "°C",
    "pct": "%",
}


def learned(diagnosis: Diagnosis) -> Markup | None:
    """The section of the learned terms; None where nothing was learned."""
    if not diagnosis.learned:
        return None
    lead = (
        "Terms that are in no catalogue, learned in the simulator. They say where it acts and on what it depends, not what it is."
    )
    return section("learned", "What has no name, described", lead, *(_term(one) for one in diagnosis.learned))


def _term(one: Learned) -> Markup:
    where = f" on {one.on.upper() if len(one.on) <= 2 else signal_name(one.on)}" if one.on else ""
    over = " and ".join(_words(word) for word in one.depends_on) or "nothing"
    facts = (_fact("Closes", share(one.closure)), _fact("Repeats", "yes" if one.repeats else "no"))
    told = [
        tag("dl", *facts, class_="facts"),
        tag("h3", f"{_SITES.get(one.site, one.site)}{where}, over {over}"),
        tag("p", stated(one.sentence)),
        _drawn(one),
    ]
    if known(one.closure_low) and known(one.closure_high):
        between = f"{share(one.closure_low).removesuffix(' %')} … {share(one.closure_high)}"
        told.append(
            tag("p", f"It closes {between} of what is left without it, with 90 % confidence, on runs not fitted.", class_="note")
        )
    if one.looks_like:
        alike = one.looks_like
        near = "; ".join(f"{effect_phrase(like.effect, like.on)}, but {like.why_not}" for like in alike)
        told.append(tag("p", tag("strong", "Looks like "), near, ".", class_="doubt"))
    return tag("article", *told, class_="cause")


def _words(word: str) -> str:
    return word.replace("_", " ").replace("axis:", "the motion of axis ")


def _fact(term: str, value: str) -> Markup:
    return tag("div", tag("dt", term), tag("dd", value))


def _drawn(one: Learned) -> Markup | None:
    """The values over the first argument: a curve for each value of the second one, or for each run."""
    columns = [name for name in one.table if name not in (*VALUES, "run")]
    if not columns or not one.depends_on or "value" not in one.table:
        return None
    at = _numbers(one.table, columns[0])
    group = one.table.get("run") or (one.table[columns[1]] if len(columns) > 1 else ("",) * len(at))
    kinds = list(dict.fromkeys(group))[:CURVES_MOST]
    curves = [(kind, np.array([g == kind for g in group])) for kind in kinds]
    curves = [(kind, here) for kind, here in curves if here.sum() > 1]
    if not curves:
        return None
    series = [_numbers(one.table, name) for name in VALUES if name in one.table]
    frame = frame_of(np.sort(at), [*series, np.zeros(1)], HEIGHT)
    unit = columns[0].split("_", 1)[1] if "_" in columns[0] else ""
    charts = [_curve(one, frame, at, here, _kind_words(columns, kind)) for kind, here in curves]
    axis = tag("div", x_axis(frame, _UNITS.get(unit, unit)), class_="panel time")
    label = f"{_SITES.get(one.site, one.site).lower()}, {one.unit}, over {_words(one.depends_on[0])}"
    return tag("div", tag("p", label, class_="label"), *charts, axis, class_="charts")


def _kind_words(columns: Sequence[str], kind: float | str) -> str:
    """The second argument in words: a direction, a run, or a value."""
    if isinstance(kind, str):
        return kind
    if columns[1] == "direction":
        return "moving in +" if kind > 0 else "moving in −" if kind < 0 else "at rest"
    return f"{columns[1].rsplit('_', 1)[0].replace('_', ' ')} {figure(kind)}"


def _curve(one: Learned, frame: Frame, at: Floats, here: NDArray[np.bool_], words: str) -> Markup:
    order = np.flatnonzero(here)[np.argsort(at[here], kind="stable")]
    x, value = at[order], _numbers(one.table, "value")[order]
    band = None
    if "low" in one.table and "high" in one.table:
        low, high = (_numbers(one.table, name)[order] for name in ("low", "high"))
        band = tag("path", d=_between(frame, x, low, high), class_="band")
    line = tag("path", d=path(frame, x, value), class_="line after")
    label = tag("p", words, class_="label") if words else None
    return tag("div", label, y_axis(frame), plot(frame, joined([band, line])), class_="panel")


def _between(frame: Frame, x: Floats, low: Floats, high: Floats) -> str:
    """The area between two curves."""
    there = np.isfinite(low) & np.isfinite(high)
    if not there.any():
        return ""
    across = frame.x(x[there])
    up, down = (list(zip(across.tolist(), frame.y(edge[there]).tolist(), strict=True)) for edge in (high, low))
    return "M" + " ".join(f"{a:.1f} {b:.1f}" for a, b in [*up, *reversed(down)]) + "z"


def _numbers(table: Mapping[str, Sequence[float | str]], name: str) -> Floats:
    return np.array([float("nan") if v is None else float(v) for v in table[name]], dtype=np.float64)
