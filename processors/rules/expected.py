"""Rules on the cut beside the twin's: a broken tool, and a load far over what is expected (a collision, packed chips).

    broken:  cut < tool_broken_share · least        while the twin expects a cut of at least tool_broken_cut_pct, and feeds
    over:    cut > over_expected_ratio · usual ratio · most + over_expected_margin_pct

cut, least and most are those of processor `expected`: the measured load without what the spindle takes in air, and the least and
the greatest cut that the twin expects where the machine may be. In air nothing shows whether a tool is broken: an alarm stays.
"""

from pydantic import Field, NonNegativeFloat, PositiveFloat

from processors.config import ProcessorConfig
from processors.contract import Sample, SampleKind
from processors.rules.alarm import BETWEEN, EXCUSED, UNDER, Judgement, over, unknown
from processors.rules.broken_tool import USUAL_MAX, Evidence, at_rest, in_air, is_seen, judged
from processors.rules.spindle import FEED, Motion
from twin.vocabulary.twin_signals import (
    EXPECTED_CUT_LEAST_PCT,
    EXPECTED_CUT_MOST_PCT,
    EXPECTED_RATIO,
    SPINDLE_CUT_LOAD_PCT,
)

CUT, LEAST, MOST, RATIO = SPINDLE_CUT_LOAD_PCT, EXPECTED_CUT_LEAST_PCT, EXPECTED_CUT_MOST_PCT, EXPECTED_RATIO
FEEDS_MM_MIN = 1.0
ROUNDING_S = 1e-6
HELD_S = 0.5
"""A tick tells nothing new: one sample that is merely held has to be held so much longer, so that a later one can object."""
CLEAR_SHARE = 2.0
"""A tool cuts again where its load is over this times the share at which it was broken."""
CLEAR_OVER = 0.8


class ExpectedLimits(ProcessorConfig):
    """The limits of the cut beside the twin's.

    over_expected_ratio_new: while it is not yet known what is usual of a tool
    """

    tool_broken_share: float = Field(default=0.2, gt=0.0, lt=0.5)
    tool_broken_share_known: float = Field(default=0.3, gt=0.0, lt=0.5)
    tool_broken_cut_pct: PositiveFloat = 1.0
    tool_broken_s: NonNegativeFloat = 1.0
    tool_broken_clear_s: NonNegativeFloat = 2.0
    over_expected_ratio: float = Field(default=2.0, gt=1.0)
    over_expected_ratio_new: float = Field(default=3.0, gt=1.0)
    over_expected_margin_pct: PositiveFloat = 10.0
    over_expected_s: NonNegativeFloat = 1.0
    over_expected_clear_s: NonNegativeFloat = 2.0


def followed(evidence: Evidence, limits: ExpectedLimits, moves: Motion, sample: Sample) -> Evidence:
    """Return the evidence that the tool is broken, as of this sample; it ends where the spindle stands."""
    cut_pct, _ = sample.number(CUT)
    if cut_pct is None and evidence.at_s is None:
        return evidence  # nothing is expected of this machine
    at_s = sample.at_s
    if moves.rpm is None or not moves.is_turning:
        return Evidence(at_s=at_s, noise_pct2=evidence.noise_pct2, misled=evidence.misled)
    least_pct, _ = sample.number(LEAST)
    if cut_pct is None or least_pct is None or moves.is_ramping:
        return at_rest(evidence, at_s)
    if least_pct <= 0.0:
        most_pct, _ = sample.number(MOST)
        return in_air(evidence, cut_pct, at_s) if most_pct is not None and most_pct <= 0.0 else at_rest(evidence, at_s)
    if least_pct < limits.tool_broken_cut_pct or not _feeds(sample):
        return at_rest(evidence, at_s)
    healthy_pct = healthy(limits, sample, least_pct)
    if not is_seen(evidence, healthy_pct):
        return at_rest(evidence, at_s)
    return judged(evidence, cut_pct, healthy_pct, at_s, limits.tool_broken_s * (1.0 + evidence.misled))


def healthy(limits: ExpectedLimits, sample: Sample, least_pct: float) -> float:
    """Return m: the least that a healthy tool takes where the twin expects `least_pct`."""
    usual, _ = sample.number(RATIO)
    if usual is None:
        return CLEAR_SHARE * limits.tool_broken_share * least_pct
    return CLEAR_SHARE * limits.tool_broken_share_known * max(0.5, min(USUAL_MAX, usual)) * least_pct


def _feeds(sample: Sample) -> bool:
    feed, _ = sample.number(FEED)
    return feed is None or abs(feed) >= FEEDS_MM_MIN


def tool_broken(limits: ExpectedLimits, moves: Motion, sample: Sample, evidence: Evidence) -> Judgement:
    """The twin expects a cut, the feed is on, and the spindle runs as in air."""
    cut_pct, no_cut = sample.number(CUT)
    least_pct, no_least = sample.number(LEAST)
    if cut_pct is None or least_pct is None or moves.rpm is None:
        return unknown(no_cut or no_least or moves.why_not)
    feed, no_feed = sample.number(FEED)
    if feed is None and FEED in sample.row:
        return unknown(no_feed or "")
    if moves.is_ramping or not moves.is_turning or least_pct < limits.tool_broken_cut_pct:
        return EXCUSED
    if feed is not None and abs(feed) < FEEDS_MM_MIN:
        return EXCUSED
    healthy_pct = healthy(limits, sample, least_pct)
    if not is_seen(evidence, healthy_pct):
        return EXCUSED
    if cut_pct >= healthy_pct:
        return UNDER
    needed_s = limits.tool_broken_s * (1.0 + evidence.misled) + (HELD_S if sample.kind is SampleKind.TICK else 0.0)
    if evidence.rate <= 0.0 or evidence.seconds + ROUNDING_S < needed_s:
        return BETWEEN
    taken_pct = max(cut_pct, 0.0)
    text = f"the cut takes {taken_pct:.0f} % of spindle load where the twin expects {least_pct:.0f} % or more"
    return over(text, taken_pct, least_pct, "%")


def load_over_expected(limits: ExpectedLimits, moves: Motion, sample: Sample) -> Judgement:
    """The cut takes far more than the twin expects, and than is usual of this tool."""
    cut_pct, no_cut = sample.number(CUT)
    most_pct, no_most = sample.number(MOST)
    if cut_pct is None or most_pct is None or moves.rpm is None:
        return unknown(no_cut or no_most or moves.why_not)
    if moves.is_ramping or not moves.is_turning:
        return EXCUSED
    usual, _ = sample.number(RATIO)
    ratio = limits.over_expected_ratio_new if usual is None else limits.over_expected_ratio * max(usual, 1.0)
    limit_pct = ratio * most_pct + limits.over_expected_margin_pct
    if cut_pct <= limit_pct:
        return UNDER if cut_pct <= CLEAR_OVER * limit_pct else BETWEEN
    text = f"the cut takes {cut_pct:.0f} % of spindle load, over {limit_pct:.0f} %, where the twin expects {most_pct:.0f} %"
    return over(text, cut_pct, limit_pct, "%")
