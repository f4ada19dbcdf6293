"""The curve of wear over a life: g(u), the level over that at the end, at the share u of the life; g(0) = 0, g(1) = 1.

A tool wears fast while it is run in, evenly for most of its life, and fast again at its end (the wear curve of ISO 8688-2). The
curve is the mean of earlier lives in KNOTS pieces, each at least RISE_MIN of an even one, so that it can be inverted; a straight
line counts as LINE_LIVES lives more. Before 0 and after 1 the outer pieces go on.

>>> [round(at(LINE, u), 2) for u in (-0.5, 0.25, 1.5)]
[-0.5, 0.25, 1.5]
"""

from collections.abc import Sequence

KNOTS = 8
RISE_MIN = 0.25
LINE_LIVES = 1.0
Curve = tuple[float, ...]
LINE: Curve = tuple(number / KNOTS for number in range(KNOTS + 1))


def at(curve: Curve, share: float) -> float:
    """Return g at a share of the life."""
    piece = min(max(int(share * KNOTS), 0), KNOTS - 1)
    return curve[piece] + (share * KNOTS - piece) * (curve[piece + 1] - curve[piece])


def slope(curve: Curve, share: float) -> float:
    """Return dg/du around a share, over a stretch as long as a piece, so that it does not jump."""
    half = 0.5 / KNOTS
    return (at(curve, share + half) - at(curve, share - half)) * KNOTS


def mean_curve(lives: Sequence[Sequence[float]]) -> Curve:
    """Return the curve of lives, each as its levels at the knots.

    >>> steep = mean_curve([[0.0] * 8 + [0.3]] * 9)
    >>> steep[0], steep[-1], round(steep[4], 3) < 0.5
    (0.0, 1.0, True)
    """
    rises = [LINE_LIVES / KNOTS] * KNOTS
    for levels in lives:
        span = levels[-1] - levels[0]
        if span <= 0.0:
            continue
        for piece in range(KNOTS):
            rises[piece] += (levels[piece + 1] - levels[piece]) / span
    total = sum(rises)
    rises = [max(rise / total, RISE_MIN / KNOTS) for rise in rises]
    total, curve = sum(rises), [0.0]
    for rise in rises:
        curve.append(curve[-1] + rise / total)
    curve[-1] = 1.0
    return tuple(curve)
