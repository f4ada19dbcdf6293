"""Measured beside the twin before and after: the signals with the largest gap, zoomed to where it is seen best.

Above, the signal; below it, twin − measured with the floor; then what the axis is told to do, and the whole run to choose from.
A gap in position is micrometres in strokes of hundreds of millimetres, so there the signal itself only shows where the axis is.
The page shows the chosen part without any script; with it, every part can be looked at.
"""

from collections.abc import Iterator

import numpy as np

from cnctwin.reports.gap.chart import Frame, anchor, band, frame_of, panel, path, plot, x_axis
from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.gap.signal_name import gap_unit, is_position, regime_name, signal_name
from cnctwin.reports.gap.trace_choice import at_own_samples, changed, chosen, over_floor, window_s
from cnctwin.reports.gap.trace_data import as_script, packed, rows_max, thinned
from cnctwin.reports.gap.written import times
from twin.gap.diagnosis import Diagnosed, Trace

VALUE_HEIGHT = 150
CONTEXT_HEIGHT = 64
GAP_HEIGHT = 150
OVERVIEW_HEIGHT = 48

_TOOLS = (
    ("earlier", "←", "Earlier"),
    ("later", "→", "Later"),
    ("closer", "+", "Closer"),
    ("wider", "−", "Wider"),
    ("whole", "Whole run", ""),
    ("chosen", "Back", "Back to the part chosen first"),
)


def traces(diagnosed: Diagnosed) -> Markup:
    """The section, with the samples that its script draws."""
    picked = [at_own_samples(trace) for trace in chosen(diagnosed.traces)]
    if not picked:
        return section("traces", "Measured against twin", "No recording came with this diagnosis to be looked at.")
    left_out = len({trace.signal for trace in diagnosed.traces}) - len(picked)
    lead = "The signals with the largest gap" if left_out else "The signals"
    lead += ", each over the part of its run where the gap is seen best."
    limit = rows_max(len(picked), 3 if any(changed(t) for t in picked) else 2)
    drawn, data = [], []
    for number, trace in enumerate(picked):
        even = thinned(trace, limit)
        if even is not trace:
            even = thinned(trace, limit * 6 // 11)  # the time of each sample travels as well
        window = window_s(trace)
        drawn.append(_figure(number, trace, window))
        data.append(packed(even, gap_unit(trace.unit)[0], window))
    script = tag("script", Markup(as_script(data)), type="application/json", id="samples")
    hint = "Drag across a chart to look closer, or focus it: ← → move, + − zoom, Home goes back, End shows the whole run."
    return section("traces", "Measured against twin", lead, tag("p", hint, class_="note scripted", hidden=True), *drawn, script)


def _figure(number: int, trace: Trace, window: tuple[float, float]) -> Markup:
    scale, unit = gap_unit(trace.unit)
    here = (trace.t_s >= window[0]) & (trace.t_s <= window[1])
    t_s, measured = trace.t_s[here], trace.measured[here]
    twins = [("before", trace.before), *([("after", trace.after)] if changed(trace) else [])]
    gaps = [(name, scale * (values - trace.measured)) for name, values in twins]
    floor = scale * trace.floor
    frame = frame_of(t_s, [*(g[here] for _, g in gaps), floor[here], -floor[here]], GAP_HEIGHT)
    lines = [_line(name, path(frame, t_s, g[here])) for name, g in gaps]
    shaded = tag("path", d=band(frame, t_s, floor[here]), class_="band")
    name = signal_name(trace.signal)
    parts = [
        _caption(trace, name),
        _values(trace, t_s, measured, [(n, v[here]) for n, v in twins]),
        panel(frame, f"twin − measured, {unit}", joined([shaded, *lines]), data_panel="gap"),
        tag("div", _strip(trace, here), class_="panel regimes") if trace.regimes else None,
        tag("div", x_axis(frame, "time, s"), class_="panel time"),
    ]
    whole = window == (float(trace.t_s[0]), float(trace.t_s[-1]))
    if not whole:
        parts.append(_overview(trace, gaps, window))
    parts.append(_tools(name))
    body = tag("div", *parts[1:-1], class_="charts", tabindex="0", role="group", aria_label=_spoken(trace, name, window))
    return tag("figure", parts[0], body, parts[-1], class_="trace", data_trace=str(number), data_unit=unit, data_own=trace.unit)


def _spoken(trace: Trace, name: str, window: tuple[float, float]) -> str:
    return (
        f"{name}, {window[0]:.4g} to {window[1]:.4g} s of {trace.run}: measured, twin before"
        f"{' and after' if changed(trace) else ''}, and their difference"
    )


def _caption(trace: Trace, name: str) -> Markup:
    keys = [_key("measured", "measured"), _key("before", "twin before" if changed(trace) else "twin")]
    if changed(trace):
        keys.append(_key("after", "twin after"))
    keys.append(_key("band", "repeatability"))
    role = "fitted" if trace.fitted else "not fitted"
    about = f"{times(over_floor(trace))} × repeatability · {trace.run}, {role}"
    return tag("figcaption", tag("h3", name), tag("p", about, class_="quiet"), tag("p", *keys, class_="keys"))


def _key(kind: str, text: str) -> Markup:
    shape = (
        tag("rect", x=0, y=2, width=22, height=8, class_="band")
        if kind == "band"
        else tag("path", d="M0 6H22", class_=f"line {kind}")
    )
    return tag("span", tag("svg", shape, width=22, height=12, aria_hidden="true"), text, class_="key")


def _line(name: str, drawn: str) -> Markup:
    return tag("path", d=drawn, class_=f"line {name}", data_series=name)


def _values(trace: Trace, t_s: np.ndarray, measured: np.ndarray, twins: list[tuple[str, np.ndarray]]) -> Markup:
    """The signal itself, with its twins unless they cannot be told from it by eye."""
    context = is_position(trace.signal)
    shown = [] if context else twins
    frame = frame_of(t_s, [measured, *(values for _, values in shown)], CONTEXT_HEIGHT if context else VALUE_HEIGHT)
    lines = [_line("measured", path(frame, t_s, measured)), *(_line(n, path(frame, t_s, v)) for n, v in shown)]
    label = f"{'measured position' if context else 'measured and twin'}, {trace.unit}"
    return panel(frame, label, joined(lines), data_panel="context" if context else "value")


def _stretches(trace: Trace, here: np.ndarray) -> Iterator[tuple[int, float, float]]:
    """Regime, start and end in parts of the window."""
    regime, t_s = trace.regime[here], trace.t_s[here]
    starts = np.flatnonzero(np.diff(regime, prepend=-100))
    span = float(t_s[-1] - t_s[0]) or 1.0
    for first, end in zip(starts, [*starts[1:], len(regime) - 1], strict=True):
        yield int(regime[first]), float(t_s[first] - t_s[0]) / span, float(t_s[end] - t_s[0]) / span


def _strip(trace: Trace, here: np.ndarray) -> Markup:
    drawn = []
    for regime, start, end in _stretches(trace, here):
        if not 0 <= regime < len(trace.regimes):
            continue
        title = regime_name(trace.regimes[regime])
        block = tag(
            "rect",
            tag("title", title),
            x=f"{100 * start:.2f}%",
            width=f"{100 * (end - start):.2f}%",
            y=0,
            height=16,
            class_=f"r{regime % 6}",
        )
        drawn.append(block)
        if end - start > 0.011 * len(title):
            drawn.append(tag("text", title, x=f"{50 * (start + end):.2f}%", y=12, text_anchor="middle"))
    return tag("svg", *drawn, class_="strip", width="100%", height=16, aria_hidden="true", focusable="false")


def _overview(trace: Trace, gaps: list[tuple[str, np.ndarray]], window: tuple[float, float]) -> Markup:
    frame = frame_of(trace.t_s, [g for _, g in gaps], OVERVIEW_HEIGHT)
    lines = [_line(name, path(frame, trace.t_s, g, 900)) for name, g in gaps]
    left, right = frame.x(np.array(window)).tolist()
    shade = tag("path", d=_outside(frame, left, right), class_="outside")
    mark = tag("rect", x=round(left, 1), width=round(right - left, 1), y=0, height=frame.height, class_="window")
    ends = [(trace.t_s[0], 0.0), (trace.t_s[-1], 1000.0)]
    labels = [tag("text", f"{at:.4g}", x=f"{x / 10:g}%", y=12, text_anchor=anchor(x)) for at, x in ends]
    axis = tag("svg", *labels, class_="x", width="100%", height=16, aria_hidden="true", focusable="false")
    label = tag("p", "whole run, twin − measured", class_="label")
    return tag("div", label, plot(frame, joined([*lines, shade, mark])), axis, class_="panel overview", data_panel="overview")


def _outside(frame: Frame, left: float, right: float) -> str:
    return f"M0 0H{left:.1f}V{frame.height}H0zM{right:.1f} 0H1000V{frame.height}H{right:.1f}z"


def _tools(name: str) -> Markup:
    buttons = [
        tag("button", text, type="button", data_do=do, aria_label=f"{spoken or text}: {name}", title=spoken or None)
        for do, text, spoken in _TOOLS
    ]
    return tag("div", *buttons, tag("output", "", class_="readout"), class_="tools scripted", hidden=True)
