"""The evidence that a tool is broken: a sequential test between a cut that takes nothing and the least that a healthy one takes.

    Λ = m (m − 2 cut) / 2 σ²        m = 2 · share · usual ratio · least        rate = clip(Λ / ln(1/α), −1, 1)
    evidence += rate · Δt, never below 0        broken: evidence ≥ tool_broken_s · (1 + misled)

Λ is the logarithm of the likelihood ratio of a sample with the spread σ (Wald, Sequential Tests of Statistical Hypotheses, Ann.
Math. Statist. 16, 1945), its sum held at 0 from below a CUSUM (Page, Biometrika 41, 1954). It changes its sign at the share of
the expected cut. A heavy cut is decided in `tool_broken_s`, a light one as much later as its Λ is smaller. Errors of neighbouring
samples are alike, so a sample counts for its time, never for more than ln(1/α) a second. σ² is the mean square of the cut where
none is expected: noise, rounding, and what the spindle takes in air otherwise than is known.

Where the tool stands clear of the work the evidence rests for some seconds. A start that the next sample took back says that cuts
begin or end elsewhere than is expected: it is remembered as `misled`, and more is asked for.
"""

import math
from typing import NamedTuple

SURE = math.log(1e6)
"""ln(1/α): the evidence, as a logarithm, that decides in one `tool_broken_s`."""
SEEN_SIGMAS = 2.0
"""A cut whose m is less than so many σ is not judged: errors that last do not average out."""
USUAL_MAX = 2.0
"""A ratio was learned on other cuts of the tool too, with thicker and thinner chips."""
NOISE_PCT2, NOISE_PCT2_MAX, NOISE_OVER_S = 1.0, 25.0, 200.0
STEP_S_MAX, REST_S = 1.0, 10.0
MISLED_MAX, MISLED_OVER_S = 2.0, 1800.0
SECONDS_MAX = 60.0
DT_S_MAX = 3600.0


class Evidence(NamedTuple):
    """seconds: of evidence; rate: of the sample before; at_s: its time; rested_s: since the last sample that was judged

    noise_pct2: σ²; misled: seconds of evidence that were taken back, forgotten in half an hour
    """

    seconds: float = 0.0
    rate: float = 0.0
    at_s: float | None = None
    rested_s: float = 0.0
    noise_pct2: float = NOISE_PCT2
    misled: float = 0.0


def log_ratio(cut_pct: float, healthy_pct: float, noise_pct2: float) -> float:
    """Return Λ of one sample; healthy_pct: m.

    >>> log_ratio(0.0, 4.0, 0.5), log_ratio(2.0, 4.0, 0.5), log_ratio(4.0, 4.0, 0.5)
    (16.0, 0.0, -16.0)
    """
    return healthy_pct * (healthy_pct - 2.0 * cut_pct) / (2.0 * noise_pct2)


def is_seen(evidence: Evidence, healthy_pct: float) -> bool:
    """Return True where a cut stands out of the noise."""
    return healthy_pct * healthy_pct >= SEEN_SIGMAS**2 * evidence.noise_pct2


def in_air(evidence: Evidence, cut_pct: float, at_s: float) -> Evidence:
    """Return the evidence after a sample in air, which shows σ."""
    since_s = _since_s(evidence, at_s)
    kept = math.exp(-min(since_s, STEP_S_MAX) / NOISE_OVER_S)
    noise_pct2 = kept * evidence.noise_pct2 + (1.0 - kept) * min(cut_pct * cut_pct, NOISE_PCT2_MAX)
    return at_rest(evidence, at_s)._replace(noise_pct2=noise_pct2)


def at_rest(evidence: Evidence, at_s: float) -> Evidence:
    """Return the evidence after a sample that cannot be judged: what the one before showed has lasted until now."""
    seconds, rate, _, rested_s, noise_pct2, misled = evidence
    since_s = _since_s(evidence, at_s)
    if seconds > 0.0 or rate > 0.0:
        rested_s = rested_s + since_s
        seconds = _gained(seconds, rate, since_s) if rested_s <= REST_S else 0.0
    return tuple.__new__(Evidence, (seconds, 0.0, at_s, rested_s, noise_pct2, _forgotten(misled, since_s)))


def judged(evidence: Evidence, cut_pct: float, healthy_pct: float, at_s: float, needed_s: float = 1.0) -> Evidence:
    """Return the evidence after a sample of a cut that stands out of the noise. needed_s: what raises an alarm"""
    seconds, before, _, _, noise_pct2, misled = evidence
    since_s = _since_s(evidence, at_s)
    rate = max(-1.0, min(1.0, log_ratio(cut_pct, healthy_pct, noise_pct2) / SURE))
    misled = _forgotten(misled, since_s)
    if rate > 0.0:
        seconds = _gained(seconds, before, since_s)
    elif cut_pct >= healthy_pct or rate <= -1.0:
        taken_back_s = _gained(seconds, before, since_s)
        if taken_back_s <= needed_s:  # else it was an alarm, and is another tool
            misled = min(MISLED_MAX, misled + taken_back_s)
        seconds = 0.0
    else:
        seconds = max(0.0, seconds + rate * min(since_s, STEP_S_MAX))
    return tuple.__new__(Evidence, (seconds, rate, at_s, 0.0, noise_pct2, misled))


def _since_s(evidence: Evidence, at_s: float) -> float:
    return 0.0 if evidence.at_s is None else min(max(at_s - evidence.at_s, 0.0), DT_S_MAX)


def _gained(seconds: float, rate: float, since_s: float) -> float:
    return min(SECONDS_MAX, seconds + max(rate, 0.0) * min(since_s, STEP_S_MAX))


def _forgotten(misled: float, since_s: float) -> float:
    return misled * math.exp(-since_s / MISLED_OVER_S) if misled > 1e-3 else 0.0
