"""The curves of docs/explanation/fleet.md as an SVG: share of a core and age at 99 %, by machines, before and now."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 420, 300, 62, 40, 16, 46
COLOUR = {"old": "#b0713c", "new": "#2f7f86"}
WORD = {"old": "before", "new": "now"}
STYLE = """\
text { font: 12px system-ui, sans-serif; fill: #333 } .title { font-weight: 600 } .grid { stroke: #8884; stroke-width: 1 }
.limit { stroke: #888; stroke-dasharray: 4 4 } path.curve { fill: none; stroke-width: 2 }
@media (prefers-color-scheme: dark) { text { fill: #ddd } }"""
Points = Sequence[tuple[float, float]]


class Panel:
    """One chart with two logarithmic axes, its left edge at `x0`."""

    def __init__(self, x0: float, title: str, unit: str, across: tuple[float, float], up: tuple[float, float]) -> None:
        self.x0, self.across, self.up = x0, across, up
        self.parts = [f'<text class="title" x="{x0 + LEFT}" y="22">{title}</text>']
        for value in _ticks(*across):
            x = self._x(value)
            self.parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
            self.parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
        for value in _ticks(*up):
            y = self._y(value)
            self.parts.append(f'<line class="grid" x1="{x0 + LEFT}" x2="{x0 + WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
            self.parts.append(f'<text x="{x0 + LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g} {unit}</text>')
        middle = x0 + (LEFT + WIDTH - RIGHT) / 2
        self.parts.append(f'<text x="{middle}" y="{HEIGHT - 10}" text-anchor="middle">machines at 10 Hz</text>')

    def limit(self, value: float) -> None:
        """Draw a dashed line across."""
        if self.up[0] <= value <= self.up[1]:
            y = self._y(value)
            self.parts.append(
                f'<line class="limit" x1="{self.x0 + LEFT}" x2="{self.x0 + WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            )

    def curve(self, points: Points, tree: str) -> None:
        """Draw a curve with its points, and its name at its end."""
        places = [(self._x(x), self._y(y)) for x, y in points]
        way = " ".join(f"{'L' if index else 'M'}{x:.1f} {y:.1f}" for index, (x, y) in enumerate(places))
        self.parts.append(f'<path class="curve" stroke="{COLOUR[tree]}" d="{way}"/>')
        self.parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{COLOUR[tree]}"/>' for x, y in places]
        x, y = places[-1]
        self.parts.append(f'<text x="{x - 6:.1f}" y="{y - 8:.1f}" text-anchor="end">{WORD[tree]}</text>')

    def _x(self, value: float) -> float:
        return self.x0 + LEFT + _share(value, *self.across) * (WIDTH - LEFT - RIGHT)

    def _y(self, value: float) -> float:
        return HEIGHT - BOTTOM - _share(value, *self.up) * (HEIGHT - TOP - BOTTOM)


def draw(trials: Sequence[dict[str, Any]], file: Path) -> None:
    """Write the picture; nothing where there are no trials."""
    curves = {tree: _curves([trial for trial in trials if trial["tree"] == tree]) for tree in COLOUR}
    shown = {tree: pair for tree, pair in curves.items() if pair[0]}
    if not shown:
        return
    across = _range([x for cores, _ in shown.values() for x, _ in cores])
    parts = []
    titles = (("CPU time of all processors", "%", 100.0), ("Age at the reader, 99 %", "ms", 1000.0))
    for index, (title, unit, limit) in enumerate(titles):
        points = {tree: pair[index] for tree, pair in shown.items() if pair[index]}
        panel = Panel(index * WIDTH, title, unit, across, _range([limit, *(y for one in points.values() for _, y in one)]))
        panel.limit(limit)
        for tree, one in points.items():
            panel.curve(one, tree)
        parts += panel.parts
    size = f'viewBox="0 0 {2 * WIDTH} {HEIGHT}" width="{2 * WIDTH}" height="{HEIGHT}"'
    file.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{STYLE}</style>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _curves(trials: Sequence[dict[str, Any]]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return share of a core in %, and age at 99 % in ms, by machines; the mean of trials with the same number."""
    cores: dict[int, list[float]] = {}
    ages: dict[int, list[float]] = {}
    for trial in trials:
        cores.setdefault(trial["machines"], []).append(100.0 * trial["used"]["processors"]["cores"])
        if trial["age_ms"]:
            ages.setdefault(trial["machines"], []).append(max(1.0, trial["age_ms"]["p99"]))
    return tuple([(float(x), sum(ys) / len(ys)) for x, ys in sorted(one.items())] for one in (cores, ages))  # type: ignore[return-value]


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Return the powers of ten around the values.

    >>> _range([4.0, 250.0])
    (1.0, 1000.0)
    """
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return 10.0**low, 10.0 ** max(high, low + 1)


def _ticks(low: float, high: float) -> list[float]:
    return [10.0**power for power in range(round(math.log10(low)), round(math.log10(high)) + 1)]


def _share(value: float, low: float, high: float) -> float:
    return math.log(value / low) / math.log(high / low)
