"""The published figures: standing figures, growth, what stands open, the window to diagnose, and the basis of it all."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from processors.contract import Output
from processors.gap.cell import Cell
from processors.gap.described import Given
from processors.gap.growth import BLOCKS_MIN
from processors.gap.signals import GAP, LOAD, NAMES, REGIMES, RESOLUTIONS, SIGNALS, TEMPERATURE, TOOL_CHANGE, UNITS
from processors.gap.state import State, cells_of, floor_of, healthy_s
from processors.gap.watch import ToolChange
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

GROWING, GROWING_SIGNAL, FINDINGS = twin_signals.GAP_GROWING, twin_signals.GAP_GROWING_SIGNAL, twin_signals.GAP_FINDINGS
OPEN, WINDOW = twin_signals.GAP_OPEN, twin_signals.GAP_WINDOW
BASIS, LEFT_OUT = twin_signals.GAP_BASIS, twin_signals.GAP_LEFT_OUT_PCT
NONE = "none"
SHOWN_MAX = 3


def opened(given: Given, state: State, at_s: float) -> State:
    """Return the state with the cells whose gap is beyond what counts as open: since when it has been."""
    cells = dict(state.cells)
    for key, cell in state.cells.items():
        since_s = (at_s if cell.open_since_s is None else cell.open_since_s) if _is_beyond(given, state, key, at_s) else None
        if since_s != cell.open_since_s:
            cells[key] = cell._replace(open_since_s=since_s)
    return replace(state, cells=cells)


def _is_beyond(given: Given, state: State, key: str, at_s: float) -> bool:
    """Return True for a cell of the described twin whose mean is more floors than a twin that is right leaves.

    Once a healthy machine's baseline is there, its growth is judged by that: then only a gap that was there from the first day
    stands open, since a warm-up on another morning than those before is no fault of the twin.
    """
    cell, config = state.cells[key], given.config
    if cell.is_learned or cell.standing.seconds < config.shown_s_min:
        return False
    floor = floor_of(given, state, key.partition("/")[0], cell, at_s)
    if floor is None or abs(cell.mean) <= config.open_floors * floor.value:
        return False
    is_judged_by_growth = cell.is_judged and at_s >= healthy_s(given, state)[1]
    return not is_judged_by_growth or abs(cell.level.mean) > config.open_floors * floor.value


def outputs(given: Given, state: State, missing: Mapping[str, str], at_s: float) -> list[Output]:
    """Return all that is published."""
    found: list[Output] = []
    for signal in SIGNALS:
        found += _figures(given, state, signal, missing.get(signal), at_s)
    cells = state.cells
    growing = sorted((key for key, cell in cells.items() if cell.grows), key=lambda key: -cells[key].rise)
    if any(cell.is_judged for cell in cells.values()) and at_s >= healthy_s(given, state)[1]:
        found.append(Output(GROWING, bool(growing)))
    else:
        found.append(Output.null(GROWING, _why_not_judged(given, state, at_s)))
    said = "; ".join(_growth_in_words(key, cells[key]) for key in growing[:SHOWN_MAX])
    findings = json.dumps([_finding(key, cells[key]) for key in growing[:SHOWN_MAX]])
    found += [Output(GROWING_SIGNAL, said or NONE), Output(FINDINGS, findings), Output(OPEN, _open_in_words(given, state, at_s))]
    found += [Output(WINDOW, _window(given, state, growing)), Output(BASIS, _basis(given, state, at_s))]
    return [*found, Output(LEFT_OUT, round(100.0 * state.left_out, 1))]


def _figures(given: Given, state: State, signal: str, missing: str | None, at_s: float) -> list[Output]:
    """The gap of a signal over its floor, of each of its regimes, and its mean; stale where an input is missing now."""
    name, quality = f"{GAP}{signal}", Quality.GOOD if missing is None else Quality.STALE
    shown_s_min = given.config.shown_s_min
    cells = cells_of(state.cells, signal)
    known = _known(given, state, signal, cells, at_s)
    found_outputs: list[Output] = []
    for title, regime in NAMES[signal].items():
        found = [one for key, one in known.items() if key.startswith(regime)]  # cutting has one for each program
        if found:
            square = sum(cell.standing.seconds * (cell.rms / floor) ** 2 for cell, floor in found)
            total_s = sum(cell.standing.seconds for cell, _ in found)
            found_outputs.append(Output(title, round(math.sqrt(square / total_s), 3), quality, missing))
        elif missing or any(cell.standing.seconds >= shown_s_min for key, cell in cells.items() if key.startswith(regime)):
            found_outputs.append(Output.null(title, missing or _why_not_judged(given, state, at_s)))
        else:
            of = regime or " or ".join(REGIMES[signal])
            found_outputs.append(Output.null(title, f"less than {shown_s_min:g} s seen of {of}"))
    if not known:
        return [*found_outputs, Output.null(f"{name}/mean", found_outputs[0].reason or "")]
    total_s = sum(cell.standing.seconds for cell, _ in known.values())
    mean = sum(cell.standing.seconds * cell.mean for cell, _ in known.values()) / total_s
    return [*found_outputs, Output(f"{name}/mean", round(mean, 4), quality, missing)]


def _known(given: Given, state: State, signal: str, cells: Mapping[str, Cell], at_s: float) -> dict[str, tuple[Cell, float]]:
    """The cells that have a standing figure, with their floor, by regime."""
    is_learned = at_s >= healthy_s(given, state)[1]
    known = {}
    for regime, cell in cells.items():
        if cell.standing.seconds >= given.config.shown_s_min and (not cell.is_learned or (is_learned and cell.is_judged)):
            floor = floor_of(given, state, signal, cell, at_s)
            if floor is not None:
                known[regime] = cell, floor.value
    return known


def _why_not_judged(given: Given, state: State, at_s: float) -> str:
    until_s = healthy_s(given, state)[1]
    if at_s < until_s:
        return f"what a healthy machine does is being learned until {_iso(until_s)}"
    return f"fewer than {BLOCKS_MIN} blocks, or too much alike, were seen while the machine was healthy, until {_iso(until_s)}"


def _growth_in_words(key: str, cell: Cell) -> str:
    signal, _, regime = key.partition("/")
    chart = cell.level_chart
    if not chart.grows:
        return f"{signal} in {regime}: scatter has grown since {_iso(cell.spread_chart.since_s)}"
    return f"{signal} in {regime}: twin minus measured has {'risen' if chart.grows > 0 else 'fallen'} since {_iso(chart.since_s)}"


def _finding(key: str, cell: Cell) -> dict[str, Any]:
    """Return a growth in values: by how much the measurement has gone up or down against the twin since it was healthy.

    The amount is rounded as a control shows the signal, so that it is not published again at each change; a scatter has none.
    """
    signal, _, regime = key.partition("/")
    chart = cell.level_chart if cell.level_chart.grows else cell.spread_chart
    found: dict[str, Any] = {"signal": signal, "regime": regime, "since": round(1000 * chart.since_s)}
    if chart is cell.spread_chart:
        return found | {"way": "scatter"}
    steps = round(abs(cell.standing.mean - cell.level.mean) / RESOLUTIONS[signal])
    amount = round(steps * RESOLUTIONS[signal], 3)
    return found | {"way": "down" if chart.grows > 0 else "up", "amount": amount, "unit": UNITS[signal]}


def _open_in_words(given: Given, state: State, at_s: float) -> str:
    """The gaps that stand open, the largest first; no live figures, which would be published again at each change."""
    found = []
    for key, cell in state.cells.items():
        if cell.open_since_s is not None and at_s - cell.open_since_s >= given.config.open_s:
            signal, _, regime = key.partition("/")
            floor = floor_of(given, state, signal, cell, at_s)
            if floor is not None:
                side = "above" if cell.mean > 0.0 else "below"
                said = f"{signal} in {regime}: the twin is {side} what is measured since {_iso(cell.open_since_s)}"
                found.append((abs(cell.mean) / floor.value, said))
    return "; ".join(said for _, said in sorted(found, reverse=True)[:SHOWN_MAX]) or NONE


def _window(given: Given, state: State, growing: Sequence[str]) -> str:
    """Start and end of the stretch to diagnose, of what grows most."""
    stretch = next((most for key in growing if (most := state.cells[key].most) is not None), None)
    if stretch is None:
        return NONE
    start_s = min(stretch.start_s, stretch.end_s - given.config.window_hours * 3600.0)
    return f"{_iso(start_s)}/{_iso(stretch.end_s)}"


def _basis(given: Given, state: State, at_s: float) -> str:
    """Return the basis of the figures, and who said that the machine was healthy."""
    config, twin = given.config, given.twin
    from_s, until_s = healthy_s(given, state)
    described = f"description {twin.version}" if twin.version else "not described"
    if state.described_s is not None:
        described += f" since {_iso(state.described_s)}"
    learned = "learned"
    idle = learned
    if twin.idle_load_pct is not None:
        idle = "idle power by speed" if twin.version else f"idle power, {twin.idle_load_pct(0.0):.3g} % of rated"
    change = learned if twin.tool_change_s is None else f"{twin.tool_change_s:.3g} s from a stopped spindle, else learned"
    heat = "the description's heat" if twin.version else "thermal network"
    notes = {signal: " (assumed)" if signal in twin.assumed else "" for signal in (TEMPERATURE, LOAD, TOOL_CHANGE)}
    stated = "stated" if config.healthy_from is not None else "assumed, not stated"
    floors = ", ".join(f"{signal} {floor:g}" for signal, floor in config.floors.items()) or "none"
    until_learned = _floors_of_noise(given, state, at_s)
    effects = f"; with {', '.join(twin.effects)}" if twin.effects else ""
    gate = "; tool changes are not gated: no signal reports them" if state.watch.change is ToolChange.ABSENT else ""
    return (
        f"{described}; temperature: {heat}{notes[TEMPERATURE]}; {LOAD}: in air {idle}{notes[LOAD]}, cutting learned by program; "
        f"speed: command; tool change: {change}{notes[TOOL_CHANGE]}; program time and axis loads: learned{effects}; "
        f"healthy {_iso(from_s)}/{_iso(until_s)} ({stated}); floors configured: {floors}, else {until_learned}learned{gate}"
    )


def _floors_of_noise(given: Given, state: State, at_s: float) -> str:
    """The signals whose floor is for now the noise that the description states."""
    signals = dict.fromkeys(
        signal
        for key, cell in state.cells.items()
        if (floor := floor_of(given, state, signal := key.partition("/")[0], cell, at_s)) is not None and not floor.is_learned
    )
    return f"{', '.join(signals)} by the noise of the description until learned, else " if signals else ""


def _iso(at_s: float) -> str:
    """UTC to the second; for a time that no calendar reaches, the seconds since 1970."""
    try:
        return f"{datetime.fromtimestamp(at_s, UTC).isoformat(timespec='seconds').removesuffix('+00:00')}Z"
    except (OverflowError, ValueError, OSError):
        return f"{at_s:g} s"
