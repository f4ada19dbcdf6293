"""The rule by which a tool wears fast: it became so worn in far fewer parts than its earlier lives did.

    z = (m − log n) / √(s² + e²) > t(K + L − 1; 1 − CHANCE)   and   n ≤ exp(m) / times   and   w ≥ WORN · R

n: parts of this life, w: its wear; m, s: middle and predictive spread of log T_i(w) over L earlier lives, T_i(w) being the parts
in which life i became so worn (twin/wear/life.py pools them, with K lives' worth of the usual spread); e: error of log n by that
of the wear; R: wear at the end of a life. w / n and w / T_i(w) are slopes over the same stretch of wear, so it is their ratio
that is judged, and lives are compared where both have been run in. This is the one-sided prediction limit for one more
observation (Hahn and Meeker, Statistical Intervals, 1991, section 4.7), with the spread's prior counted as K lives.

Before WORN, lives differ most in how they are run in. With fewer than FAST_LIVES lives nothing is said, and nothing of a life
in which the load stepped up: its mean slope is that of the step.

>>> from twin.wear.curve import LINE
>>> lives = [Life(uses, 0.3, tuple(0.3 * share for share in LINE)) for uses in (90, 100, 110, 105)]
>>> [is_faster(lives, 0.3, 0.21, uses, 0.0, 2.0) for uses in (70, 30, 10)]
[False, False, True]
"""

from collections.abc import Sequence
from functools import lru_cache
from math import atan2, cos, exp, log, pi, sin, sqrt

from twin.wear.curve import KNOTS
from twin.wear.life import USUAL_LIVES, Life, pooled

FAST_LIVES = 3
WORN = 0.6
CHANCE = 1e-3
SPREAD = 0.25
"""WORN, CHANCE and SPREAD, the usual spread of log lives, were chosen on the development seeds of benchmarks/worn_tools."""


def uses_to(life: Life, wear: float) -> float:
    """Return the parts in which a life became so worn; a life that did not is taken to have gone on evenly."""
    levels = life.levels
    for knot in range(KNOTS):
        low, high = levels[knot], levels[knot + 1]
        if high >= wear and high > low:
            return max(life.uses * (knot + max(wear - low, 0.0) / (high - low)) / KNOTS, 0.5)
    return life.uses * wear / life.end


def is_faster(lives: Sequence[Life], end: float, wear: float, uses: int, error: float, times: float) -> bool:
    """Return True where a tool so worn after so many parts wears `times` as fast as its lives, beyond what they spread by.

    end: wear at the end of a life; error: standard deviation of log uses by that of the wear
    """
    if len(lives) < FAST_LIVES or uses < 1 or wear < WORN * end:
        return False
    middle, spread = pooled([log(uses_to(life, wear)) for life in lives], SPREAD)
    if uses > exp(middle) / times:
        return False
    return (middle - log(uses)) / sqrt(spread * spread + error * error) > _limit(len(lives))


@lru_cache(maxsize=64)
def _limit(lives: int) -> float:
    return t_limit(round(USUAL_LIVES) + lives - 1, CHANCE)


def t_limit(degrees: int, chance: float) -> float:
    """Return what Student's t of so many degrees of freedom, 2 or more, exceeds with a chance below a half.

    By halving, on the closed form of its distribution (Abramowitz and Stegun 1964, 26.7.3 and 26.7.4).

    >>> round(t_limit(4, 1e-3), 3), round(t_limit(7, 0.05), 3)
    (7.173, 1.895)
    """
    low, high = 0.0, 1e6
    while high - low > 1e-9 * (1.0 + low):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _beyond(middle, degrees) > chance else (low, middle)
    return high


def _beyond(t: float, degrees: int) -> float:
    """Return the chance that t is exceeded."""
    angle = atan2(t, sqrt(degrees))
    is_odd, squared = degrees % 2, cos(angle) ** 2
    term = total = cos(angle) if is_odd else 1.0
    for n in range(2 + is_odd, degrees - 1, 2):
        term *= (n - 1) / n * squared
        total += term
    within = 2.0 / pi * (angle + sin(angle) * total) if is_odd else sin(angle) * total
    return 0.5 * (1.0 - within)
