"""A tool of a machine over its parts: the level of each of its operations when it is sharp, its trend, and when it is replaced.

    log ratio_o = sharp_o + material + gain_o · wear + ε_o,   ε_o ~ N(0, σ_o²)      over its operations o
    level of the tool in a part = Σ (log ratio_o − sharp_o) / σ_o² / Σ 1 / σ_o²

The sharp level of an operation is the mean of its first SHARP_USES uses after a replacement, of the first two lives, and stands
still from then on. Until the first replacement, levels are counted from the first parts that were seen. σ_o is learned, and so
is gain_o: an edge that is worn costs more force where the chip is thin. It is 1 for the first operation of a tool, in whose
level its wear is given.
"""

from collections.abc import Mapping
from math import sqrt
from typing import NamedTuple

from twin.wear.curve import LINE, at, slope
from twin.wear.fast import is_faster
from twin.wear.life import LIVES_MAX, Course, Known, Life, ended, followed, known
from twin.wear.terms import Terms
from twin.wear.trend import HUBER, Trend, Wander, advanced, updated

SHARP_USES, SHARP_LIVES = 5, 2
NOISE, NOISE_MIN, NOISE_MAX = 0.03, 0.004, 0.3
NOISE_PRIOR, NOISE_COUNT = 10, 200
LIMIT_ASSUMED = 0.3
"""The scale of a trend while no limit is known; nothing that is published depends on it."""
RATE_WIDE, RATE_UNKNOWN = 4.0, 0.05
SHARE_WANDER, RATE_WANDER = 0.03, 0.15
WIDE_IS_BETTER = 5.0
FAST_USES = 4
STEPPED_USES, REPLACED_USES = 3, 2
OPERATIONS_MAX = 40
MEMORY_USES = 10.0
PROVISIONAL = 0.03
SHARP_ERROR = 0.02
"""Errors of a sharp level: inferred from a worn tool, and of several operations, from one sharp tool."""
EARLY, EARLY_WANDER = 0.25, 0.08
"""Until this share of a life, lives differ by so much more: each is run in in its own way."""
GAIN_SPREAD, GAIN_MIN, GAIN_VAR_MIN, GAIN_NOISE = 0.4, 0.4, 4e-4, 0.05
"""Spread of gains from 1, bounds, and the least noise with which one is learned: the error of the wear lasts for many parts."""


class Base(NamedTuple):
    """The sharp level of an operation, learned from so many uses; the variance of its level from part to part, from so many.

    uses: 0 while it was only seen on a tool that was worn already; level_var: of the sharp level; count: parts that taught the
    noise gain: by how much of the tool's wear it rises; gain_var: 0 for the first operation of a tool; last: its level less the
    material's when it was seen last
    """

    level: float
    uses: int
    noise: float
    taught: int = 0
    gain: float = 1.0
    gain_var: float = 0.0
    level_var: float = 0.0
    last: float | None = None


class Tool(NamedTuple):
    """The state of a tool. uses: parts of the life that runs; is_whole: it was seen from its beginning

    wide: the trend without earlier lives; sharp_lives: lives whose first uses are in the bases low, high: uses in a row at
    which it seemed to be replaced, or far above what was expected; has_stepped: a sudden rise was taken in; replaced_part,
    fell: of the last replacement, and by how much the level fell at it; vibration: mean of its log ratio
    """

    trend: Trend
    wide: Trend
    bases: Mapping[str, Base] = {}
    uses: int = 0
    is_whole: bool = False
    sharp_lives: int = 0
    low: int = 0
    high: int = 0
    has_stepped: bool = False
    is_fast: bool = False
    was_fast: bool = False
    course: Course = Course()
    lives: tuple[Life, ...] = ()
    seen_s: float = 0.0
    replaced_part: int = -1
    fell: float = 0.0
    vibration: float | None = None

    def known(self, terms: Terms) -> Known:
        """Return what is known of its lives; by assumption where that is nothing."""
        return known(self.lives, terms.wear_limit) or Known(LIMIT_ASSUMED, 0.0, 0.0, 0.0, LINE, 0)

    @property
    def is_learning(self) -> bool:
        """True while the sharp level is still being learned, so that a level means nothing yet."""
        return self.sharp_lives == 0 and self.uses < SHARP_USES


class Told(NamedTuple):
    """The records of a tool's operations in a part: log ratios, and the spreads of the ratio over healthy parts where they are
    known.
    """

    logs: Mapping[str, float]
    spreads: Mapping[str, float]


class Level(NamedTuple):
    """The level of a tool in a part over that of a sharp one, material and all; its variance; how it rises with the wear."""

    level: float
    noise: float
    gain: float = 1.0


def begun(life: Known, terms: Terms) -> tuple[Trend, Trend]:
    """Return the trend of a sharp tool by what earlier lives say, and the one that lets it wear as it likes."""
    sharp = (terms.sharp / (life.end * slope(life.curve, 0.0))) ** 2
    if life.uses <= 0.0:
        trend = Trend(0.0, 0.0, sharp, 0.0, RATE_UNKNOWN**2)
        return trend, trend
    rate = 1.0 / life.uses
    return Trend(0.0, rate, sharp, 0.0, (rate * life.uses_spread) ** 2), Trend(0.0, rate, sharp, 0.0, (RATE_WIDE * rate) ** 2)


def new_tool(terms: Terms) -> Tool:
    """Return a tool that is seen for the first time, in the middle of a life."""
    return Tool(*begun(Tool(_NONE, _NONE).known(terms), terms))


_NONE = Trend(0.0, 0.0, 1.0, 0.0, 1.0)


def wander_of(life: Known, trend: Trend) -> Wander:
    """Return by how much share and rate wander in a use: by so much of themselves over a life."""
    rate = min(1.0 / life.uses if life.uses > 0.0 else max(trend.rate, 0.001), 0.1)
    early = EARLY_WANDER**2 / EARLY * rate if trend.share < EARLY else 0.0
    return Wander(SHARE_WANDER**2 * rate * 10.0 + early, (RATE_WANDER * rate) ** 2 * rate)


def level_of(tool: Tool, logs: Mapping[str, float], wear: float) -> Level | None:
    """Return the level of a tool by the log ratios of its operations in a part; None where none was seen before.

    wear: what is expected, since a gain that is not well known makes the level uncertain by so much
    """
    weight = total = gain = 0.0
    for operation, value in logs.items():
        base = tool.bases.get(operation)
        if base is not None and not (base.uses == 0 and tool.is_learning):
            own = 1.0 / (base.noise + base.level_var + wear * wear * base.gain_var)
            weight += own
            total += own * (value - base.level)
            gain += own * base.gain
    return Level(total / weight, 1.0 / weight, gain / weight) if weight else None


def used(tool: Tool, terms: Terms, trend: Trend, level: Level | None, material: float, material_var: float) -> Tool:
    """Return the tool after a part in which it cut: `trend` is what is known of it now, with all tools together.

    The trend that wears as it likes takes its level less the material's, and where that fits far better, it is the trend.
    """
    life = tool.known(terms)
    wander = wander_of(life, tool.trend)
    wide, course, fit = advanced(tool.wide, 1.0, wander), tool.course, tool.trend.fit
    if level is not None and not tool.is_learning:
        own, noise, end = level.level - material, level.noise + material_var, level.gain * life.end
        fit = updated(advanced(tool.trend, 1.0, wander), own, noise, end, life.curve).fit
        wide = updated(wide, own, noise, end, life.curve)
        if wide.fit - fit > WIDE_IS_BETTER:
            trend, wide, fit = wide, wide._replace(fit=0.0), 0.0
        if tool.is_whole:
            course = followed(course, tool.uses, own / level.gain)
    tool = tool._replace(trend=trend._replace(fit=fit), wide=wide, course=course, uses=tool.uses + 1)
    if tool.uses == SHARP_USES and tool.is_whole and tool.sharp_lives < SHARP_LIVES:
        tool = tool._replace(sharp_lives=tool.sharp_lives + 1)
    return tool._replace(is_fast=tool.is_fast or _is_fast(tool, life, terms))


def rises_freely(tool: Tool, terms: Terms, level: Level, material: float, material_var: float) -> bool:
    """Return True where a level that is far above what was expected is what a tool that wears as it likes would show."""
    life = tool.known(terms)
    wide = advanced(tool.wide, 1.0, wander_of(life, tool.trend))
    end = level.gain * life.end
    var = (end * slope(life.curve, wide.share)) ** 2 * wide.var + level.noise + material_var
    return abs(level.level - material - end * at(life.curve, wide.share)) < HUBER * sqrt(var)


def _is_fast(tool: Tool, life: Known, terms: Terms) -> bool:
    """Return True where a tool that was seen from its beginning, by its own trend, became so worn far too soon."""
    share = tool.wide.share
    if not tool.is_whole or tool.has_stepped or tool.is_learning or tool.uses < FAST_USES or share <= 0.0:
        return False
    wear = life.end * at(life.curve, share)
    return is_faster(tool.lives, life.end, wear, tool.uses, sqrt(tool.wide.var) / share, terms.fast)


def learned(tool: Tool, told: Told, material: float, wear: float) -> Tool:
    """Return the tool with what a part tells of its operations: sharp levels while it is sharp, and their noise."""
    bases = dict(tool.bases)
    is_sharp = tool.uses < SHARP_USES
    for operation, value in told.logs.items():
        base = bases.get(operation)
        if base is not None:
            bases[operation] = _base_after(base, value - material, wear, is_sharp=is_sharp, is_known=tool.sharp_lives > 0)
        elif len(bases) < OPERATIONS_MAX:
            noise = min(max(told.spreads.get(operation, NOISE), NOISE_MIN), NOISE_MAX) ** 2
            gain_var = GAIN_SPREAD**2 if bases else 0.0
            bases[operation] = Base(
                value - material - wear, int(is_sharp), noise, 0, 1.0, gain_var, _level_var(wear, gain_var), value - material
            )
    return tool._replace(bases=bases)


def _base_after(base: Base, own: float, wear: float, *, is_sharp: bool, is_known: bool) -> Base:
    """Return an operation after a part in which its level, less the material's, was `own`."""
    noise, gain, gain_var = base.noise, base.gain, base.gain_var
    off = own - base.level - gain * wear
    if base.taught > 0:
        count = min(base.taught + NOISE_PRIOR, NOISE_COUNT)
        noise += (min(off * off, 9.0 * noise) - noise) / (count + 1)
    if is_known and not is_sharp and gain_var > 0.0 and base.uses:
        pull = gain_var * wear / (wear * wear * gain_var + max(noise, GAIN_NOISE**2))
        gain = min(max(gain + pull * off, GAIN_MIN), 1.0 / GAIN_MIN)
        gain_var = max(gain_var * (1.0 - pull * wear), GAIN_VAR_MIN)
    level, uses, level_var = base.level, base.uses, base.level_var
    if is_sharp and uses < SHARP_USES * SHARP_LIVES:
        level, uses = (own - gain * wear if uses == 0 else level + off / (uses + 1)), uses + 1
        level_var = (noise + SHARP_ERROR**2) / uses if gain_var else noise / uses
    elif uses == 0 and _level_var(wear, gain_var) < 0.7 * level_var:
        level, level_var = own - gain * wear, _level_var(wear, gain_var)
    return Base(level, uses, max(noise, NOISE_MIN**2), base.taught + 1, gain, gain_var, level_var, own)


def _level_var(wear: float, gain_var: float) -> float:
    """Return the variance of a sharp level that is inferred from a worn tool."""
    return PROVISIONAL**2 + wear * wear * gain_var


def leap(tool: Tool, told: Told, material: float) -> float | None:
    """Return by how much a tool's operations stand above where each was seen last, the largest of them; None = none was seen
    before.

    A tool that changed shows it in the very operation. One that seems to change as another program comes is another program's.
    """
    leaps = [
        value - material - base.last
        for name, value in told.logs.items()
        if (base := tool.bases.get(name)) and base.last is not None
    ]
    return max(leaps, key=abs) if leaps else None


def doubted(tool: Tool, told: Told, material: float, wear: float) -> Tool:
    """Return the tool whose sharp level in these operations is not believed any more, and learned again from its wear."""
    bases = dict(tool.bases)
    for name, value in told.logs.items():
        own = value - material
        if (base := bases.get(name)) is not None:
            gain_var = GAIN_SPREAD**2
            bases[name] = Base(own - wear, 0, base.noise, base.taught, 1.0, gain_var, _level_var(wear, gain_var), own)
    return tool._replace(bases=bases)


def replaced(tool: Tool, terms: Terms, part: int, fell: float) -> Tool:
    """Return the tool with a new life, which has just begun; the life before is remembered if it was seen as a whole.

    One that was told to wear fast, or in which the load stepped up, teaches nothing; the second fast one in a row does.
    """
    is_taught = tool.is_whole and not tool.has_stepped and (tool.was_fast or not tool.is_fast)
    life = ended(tool.course) if is_taught else None
    lives = tool.lives if life is None else (*tool.lives, life)[-LIVES_MAX:]
    bases = {name: base._replace(last=None, uses=base.uses if tool.sharp_lives else 0) for name, base in tool.bases.items()}
    fresh = tool._replace(lives=lives)
    trend, wide = begun(fresh.known(terms), terms)
    return Tool(
        trend, wide, bases, is_whole=True, sharp_lives=tool.sharp_lives, lives=lives, seen_s=tool.seen_s,
        replaced_part=part, fell=fell, was_fast=tool.is_fast,
    )  # fmt: skip
