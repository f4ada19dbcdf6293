"""The size curve of a blind check as a picture: how often what is said is right, over the size of the effect.

Plain SVG. A line a score, its points at the middle of each bin of size, with 95 % intervals of Clopper and Pearson.
"""

from math import inf, log, sqrt

from cnctwin.blind_check.rate import Rate
from cnctwin.blind_check.scoring import JUDGED_FROM, Scored

WIDTH, HEIGHT = 760, 380
LEFT, RIGHT, TOP, BOTTOM = 62, 745, 20, 330
SMALLEST, LARGEST = 0.6, 33.0
"""Ends of the axis of sizes, floors."""
LINES = (
    ("single_right", "a single effect: named right", "#1b6ca8", -6.0),
    ("single_wrong", "a single effect: a wrong name", "#c1272d", -2.0),
    ("outside_told", "outside the catalogue: called so, or taken up", "#3a7d44", 2.0),
    ("pair_both", "a pair: both right", "#8a6d00", 6.0),
)
"""Score, title, colour, and by how many pixels its points stand aside, so that intervals do not cover each other."""


def picture(found: Scored, title: str) -> str:
    """Return the picture of a check as SVG."""
    whole = f'viewBox="0 0 {WIDTH} {HEIGHT}" role="img" font-family="sans-serif" font-size="12"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {whole}>',
        f"<title>{title}</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        *_frame(),
    ]
    for number, (name, label, colour, aside) in enumerate(LINES):
        points = [(_middle(low, high), getattr(scores, name)) for (low, high), scores in found.by_size.items()]
        parts += _line([(at, rate) for at, rate in points if rate.count], colour, aside)
        x, y = LEFT + 12 + 330 * (number % 2), HEIGHT - 22 + 16 * (number // 2)
        parts.append(f'<rect x="{x}" y="{y - 7}" width="18" height="4" fill="{colour}"/>')
        parts.append(f'<text x="{x + 24}" y="{y}">{label}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def _x(size: float) -> float:
    return LEFT + (RIGHT - LEFT) * log(size / SMALLEST) / log(LARGEST / SMALLEST)


def _y(share: float) -> float:
    return BOTTOM - (BOTTOM - TOP) * share


def _middle(low: float, high: float) -> float:
    """Return the geometric middle of a bin."""
    return sqrt(max(low, 0.7) * (30.0 if high == inf else high))


def _frame() -> list[str]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _y(share)
        parts.append(f'<line x1="{LEFT}" x2="{RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dddddd"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{100 * share:.0f} %</text>')
    for size in (0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0):
        parts.append(f'<line x1="{_x(size):.1f}" x2="{_x(size):.1f}" y1="{BOTTOM}" y2="{BOTTOM + 4}" stroke="#333333"/>')
        parts.append(f'<text x="{_x(size):.1f}" y="{BOTTOM + 16}" text-anchor="middle">{size:g}</text>')
    judged = f"{_x(JUDGED_FROM):.1f}"
    parts.append(f'<line x1="{judged}" x2="{judged}" y1="{TOP}" y2="{BOTTOM}" stroke="#333333" stroke-dasharray="3 4"/>')
    parts.append(f'<text x="{judged}" y="{TOP - 6}" text-anchor="middle" fill="#333333">targets hold from here on</text>')
    parts.append(f'<text x="{RIGHT}" y="{HEIGHT - 6}" text-anchor="end" fill="#555555">size of the effect / floor</text>')
    return parts


def _line(points: list[tuple[float, Rate]], colour: str, aside: float) -> list[str]:
    parts = []
    for size, rate in points:
        x = _x(size) + aside
        bar = f'x1="{x:.1f}" x2="{x:.1f}" y1="{_y(rate.low):.1f}" y2="{_y(rate.high):.1f}"'
        parts.append(f'<line {bar} stroke="{colour}" stroke-opacity="0.45" stroke-width="2"/>')
        parts.append(f'<circle cx="{x:.1f}" cy="{_y(rate.share):.1f}" r="4" fill="{colour}"><title>{rate}</title></circle>')
    path = " ".join(f"{_x(size) + aside:.1f},{_y(rate.share):.1f}" for size, rate in points)
    return [*parts, f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>']
