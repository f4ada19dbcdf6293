"""The evidence that a tool is broken: as fast as the noise allows, and slower where cuts have begun elsewhere than expected."""

import math

import pytest

from processors.rules.broken_tool import MISLED_OVER_S, REST_S, SURE, Evidence, at_rest, in_air, is_seen, judged

HEALTHY_PCT = 8.0


def taken(evidence: Evidence, *cuts_pct: float, healthy_pct: float = HEALTHY_PCT, every_s: float = 1.0) -> Evidence:
    """The evidence after cuts that take so much."""
    for cut_pct in cuts_pct:
        evidence = judged(evidence, cut_pct, healthy_pct, (evidence.at_s or 0.0) + every_s)
    return evidence


def test_one_sample_decides_nothing_and_two_of_a_heavy_cut_do() -> None:
    one = taken(Evidence(at_s=0.0), 0.0)
    assert (one.seconds, one.rate) == (0.0, 1.0)
    assert taken(one, 0.0).seconds == 1.0


@pytest.mark.parametrize("every_s", [0.1, 0.5, 1.0])
def test_evidence_counts_time_not_samples(every_s: float) -> None:
    count = round(4.0 / every_s)
    assert taken(Evidence(at_s=0.0), *[0.0] * count, every_s=every_s).seconds == pytest.approx(4.0 - every_s)


def test_a_light_cut_takes_longer_as_the_square_of_its_distance_from_the_noise() -> None:
    rates = [taken(Evidence(at_s=0.0), 0.0, healthy_pct=pct).rate for pct in (2.0, 4.0)]
    assert rates[1] == pytest.approx(4.0 * rates[0])
    assert rates[0] == pytest.approx(2.0 / SURE)


def test_the_noise_in_air_says_which_cuts_are_seen() -> None:
    """Half a percent of noise: cuts from 1 % on are seen, after some minutes of air."""
    evidence = Evidence(at_s=0.0)
    assert not is_seen(evidence, 1.5)
    for second in range(2000):
        evidence = in_air(evidence, 0.5 * (-1.0) ** second, float(second))
    assert evidence.noise_pct2 == pytest.approx(0.25, rel=0.01)
    assert is_seen(evidence, 1.01) and not is_seen(evidence, 0.99)


def test_what_one_sample_of_air_takes_is_bounded() -> None:
    assert in_air(Evidence(at_s=0.0), 1e200, 1.0).noise_pct2 < 1.2


def test_evidence_rests_between_two_cuts_and_is_let_go_after_long() -> None:
    seen = taken(Evidence(at_s=0.0), 0.0)
    rests = at_rest(at_rest(seen, 2.0), 4.0)
    assert rests.seconds == 1.0
    assert taken(rests, 0.0).seconds == 1.0
    assert at_rest(rests, 4.0 + REST_S).seconds == 0.0


def test_a_healthy_sample_takes_all_back_and_is_remembered() -> None:
    back = taken(Evidence(at_s=0.0), 0.0, HEALTHY_PCT)
    assert (back.seconds, back.misled) == (0.0, 1.0)
    later = at_rest(back, (back.at_s or 0.0) + MISLED_OVER_S)
    assert later.misled == pytest.approx(math.exp(-1.0))


def test_a_new_tool_after_an_alarm_is_not_misled() -> None:
    assert taken(Evidence(at_s=0.0), 0.0, 0.0, 0.0, HEALTHY_PCT).misled == 0.0


def test_a_cut_between_both_takes_back_a_part() -> None:
    one = taken(Evidence(at_s=0.0), 0.0, 0.0, 0.0, healthy_pct=3.0)
    less = taken(one, 2.0, healthy_pct=3.0)
    assert 0.0 < less.seconds < one.seconds
