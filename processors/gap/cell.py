"""One cell of the gap: a signal in a regime. Its standing figures, what was learned of it while healthy, its block, its charts.

All means are over time in the regime, not over messages. The standing figures forget, with a time constant of
hours of that regime:

    gain = dt / min(T, standing_s),   mean += gain · (d − mean),   variance = (1 − gain)(variance + gain · (d − mean)²)

A value further than 6 of its standard deviations from the standing mean counts as 6, so that a spike is a spike and a step is
followed within minutes.

Where a machine is described again, its twin is another one: the standing figures and the charts begin again, and so does the
level
that growth is judged from, learned from the next hours. What a healthy machine's samples scatter by is a property of machine and
sensor, and stays: it is counted about the mean under each description.
"""

import math
from typing import NamedTuple

from processors.gap.growth import BLOCKS_MIN, Baseline, Chart, Rule, charted, is_enough, learned, rule_of

STRAY = 6.0
STRAYS_CUT_S = 60.0
"""The time of a regime before which nothing is taken for a stray."""
BLOCK_PART_MIN = 1.0 / 60.0
"""A block that has seen its regime for less than this part of its length is carried on into the next one."""
ANEW_BLOCKS_MAX = 3 * BLOCKS_MIN
"""A level that is learned again is learned from no more blocks than this; a drift behind them is not taken for the twin."""
SPREAD_WORTH = math.log(1.5)
"""A scatter that has grown to 1.5 times what it was is worth an alarm."""


class Moments(NamedTuple):
    """The mean of a value held for so long; `m2` is the integral of the square about the mean."""

    seconds: float = 0.0
    mean: float = 0.0
    m2: float = 0.0

    @property
    def deviation(self) -> float:
        """Root mean square about the mean."""
        return math.sqrt(max(self.m2, 0.0) / self.seconds) if self.seconds > 0.0 else 0.0

    def held(self, value: float, seconds: float) -> "Moments":
        """Add a `value` that was held for `seconds`."""
        total = self.seconds + seconds
        step = value - self.mean
        mean = self.mean + step * seconds / total
        return Moments(total, mean, self.m2 + seconds * step * (value - mean))


class Standing(NamedTuple):
    """See the module. `seconds` stops at the time constant."""

    seconds: float = 0.0
    mean: float = 0.0
    variance: float = 0.0

    def held(self, value: float, seconds: float, standing_s: float) -> "Standing":
        """Add a `value` that was held for `seconds`."""
        total = min(self.seconds + seconds, standing_s)
        gain = min(seconds / total, 1.0)
        step = value - self.mean
        return Standing(total, self.mean + gain * step, (1.0 - gain) * (self.variance + gain * step * step))


class Stretch(NamedTuple):
    """A stretch of time, and how far its blocks were from the baseline, in the direction of the growth, σ, summed up."""

    start_s: float
    end_s: float
    departure: float


class Cell(NamedTuple):
    """d is twin minus measured; of a signal that has only a learned baseline, minus measured, and the baseline is the twin.

    is_learned: the twin is the baseline
    standing, healthy, block: of d; healthy only while the machine was said to be, block since `block_start_s`
    level, spread: baselines and charts of the blocks' means, and of the logarithms of their scatter
    last_level, last_spread, last_block: figures and number of the last healthy block
    recent: the last blocks of the present growth; most: the stretch of it that departs most
    before: healthy, as it was under descriptions before; is_anew: the level is learned from the next blocks
    open_since_s: since when its standing gap is beyond what counts as open, None while it is not
    """

    is_learned: bool = False
    standing: Standing = Standing()
    healthy: Moments = Moments()
    block: Moments = Moments()
    block_start_s: float = 0.0
    level: Baseline = Baseline()
    spread: Baseline = Baseline()
    last_level: float = 0.0
    last_spread: float = 0.0
    last_block: int = -1
    level_chart: Chart = Chart()
    spread_chart: Chart = Chart()
    recent: tuple[Stretch, ...] = ()
    most: Stretch | None = None
    before: Moments = Moments()
    is_anew: bool = False
    open_since_s: float | None = None

    @property
    def deviation(self) -> float:
        """Root mean square of the healthy samples about their mean, under each description its own."""
        seconds = self.before.seconds + self.healthy.seconds
        return math.sqrt(max(self.before.m2 + self.healthy.m2, 0.0) / seconds) if seconds > 0.0 else 0.0

    @property
    def has_floor(self) -> bool:
        """Return True if the healthy samples were enough to take a floor from."""
        return self.is_judged or (self.is_anew and self.spread.blocks >= BLOCKS_MIN)

    @property
    def is_judged(self) -> bool:
        """True if there is a baseline to judge growth by."""
        return is_enough(self.level)

    @property
    def mean(self) -> float:
        """Standing mean of twin minus measured."""
        return self.standing.mean - self.healthy.mean if self.is_learned else self.standing.mean

    @property
    def rms(self) -> float:
        """Standing root mean square of twin minus measured."""
        return math.hypot(self.mean, math.sqrt(self.standing.variance))

    @property
    def rise(self) -> float:
        """The charts' distance towards an alarm, 1 = there."""
        return max(self.level_chart.level, self.spread_chart.level)

    @property
    def grows(self) -> bool:
        """True if one of its charts says so."""
        return bool(self.level_chart.grows or self.spread_chart.grows)


class Terms(NamedTuple):
    """The rules by which a cell is kept.

    floor: of d, None while it is not known; resolution: to which controls show the signal; growth_floors: worth an alarm
    blocks_between_alarms: false ones, of one side of a chart; blocks_of_window: that make a stretch to diagnose
    """

    floor: float | None
    resolution: float
    standing_s: float
    block_s: float
    growth_floors: float
    blocks_between_alarms: float
    blocks_of_window: int


def seen(cell: Cell, terms: Terms, d: float, at_s: float, seconds: float, *, is_healthy: bool) -> Cell:
    """The cell with `d` held for the `seconds` up to `at_s`."""
    standing = cell.standing
    if standing.seconds >= STRAYS_CUT_S:
        reach = STRAY * max(math.sqrt(standing.variance), terms.floor or 0.0, terms.resolution)
        d = min(max(d, standing.mean - reach), standing.mean + reach)
    return cell._replace(
        standing=standing.held(d, seconds, terms.standing_s),
        healthy=cell.healthy.held(d, seconds) if is_healthy else cell.healthy,
        block=cell.block.held(d, seconds),
        block_start_s=cell.block_start_s if cell.block.seconds > 0.0 else at_s - seconds,
    )


def closed(cell: Cell, terms: Terms, block: int, at_s: float, healthy_s: tuple[float, float]) -> Cell:
    """The cell when block number `block` ends at `at_s`: what it shows is learned, or judged, or waits for more time."""
    if cell.block.seconds < terms.block_s * BLOCK_PART_MIN:
        return cell
    level = cell.block.mean
    spread = math.log(math.hypot(cell.block.deviation, terms.resolution / math.sqrt(12.0)))
    start_s, from_s, until_s = cell.block_start_s, *healthy_s
    emptied = cell._replace(block=Moments(), block_start_s=at_s)
    is_healthy = start_s >= from_s and at_s <= until_s
    if is_healthy or (start_s >= until_s and _learns_anew(cell)):
        follows = cell.last_block == block - 1
        spread_known = learned(cell.spread, spread, cell.last_spread if follows else None)
        return emptied._replace(
            level=learned(cell.level, level, cell.last_level if follows else None),
            spread=spread_known if is_healthy or not is_enough(cell.spread) else cell.spread,
            last_level=level,
            last_spread=spread,
            last_block=block,
        )
    return _judged(emptied, terms, level, spread, (start_s, at_s)) if start_s >= until_s else emptied


def described_anew(cell: Cell) -> Cell:
    """Return the cell as it goes on where the twin that it compares with has become another one."""
    before = cell.before
    if cell.healthy.seconds > 0.0:
        before = Moments(before.seconds + cell.healthy.seconds, 0.0, before.m2 + cell.healthy.m2)
    return Cell(before=before, spread=cell.spread, is_anew=True)


def _learns_anew(cell: Cell) -> bool:
    return cell.is_anew and not is_enough(cell.level) and cell.level.blocks < ANEW_BLOCKS_MAX


def _judged(cell: Cell, terms: Terms, level: float, spread: float, span_s: tuple[float, float]) -> Cell:
    """The cell with its charts carried on by one block."""
    start_s, end_s = span_s
    rules = rules_of(cell, terms)
    if rules is None:
        return cell
    level_chart = charted(cell.level_chart, rules[0], cell.level, level, start_s)
    spread_chart = charted(cell.spread_chart, rules[1], cell.spread, spread, start_s, down=False)
    if max(level_chart.level, spread_chart.level) == 0.0:
        return cell._replace(level_chart=level_chart, spread_chart=spread_chart, recent=(), most=None)
    departure = (spread - cell.spread.mean) / rules[1].sigma
    if level_chart.level >= spread_chart.level:
        departure = math.copysign(1.0, level_chart.up - level_chart.down) * (level - cell.level.mean) / rules[0].sigma
    recent = (*cell.recent, Stretch(start_s, end_s, departure))[-terms.blocks_of_window :]
    stretch = Stretch(recent[0].start_s, end_s, sum(part.departure for part in recent))
    is_short = len(recent) < terms.blocks_of_window
    most = stretch if cell.most is None or is_short or stretch.departure > cell.most.departure else cell.most
    return cell._replace(level_chart=level_chart, spread_chart=spread_chart, recent=recent, most=most)


def rules_of(cell: Cell, terms: Terms) -> tuple[Rule, Rule] | None:
    """Return the rules for its level and its scatter; None while there is no baseline or no floor."""
    if terms.floor is None:
        return None
    level = rule_of(cell.level, terms.growth_floors * terms.floor, terms.blocks_between_alarms)
    spread = rule_of(cell.spread, SPREAD_WORTH, terms.blocks_between_alarms)
    return None if level is None or spread is None else (level, spread)
