"""The chart of a growing gap: it keeps its promise of false alarms, and what it learns is what there is."""

import math
from random import Random

import pytest

from processors.gap.growth import BLOCKS_MIN, Baseline, Chart, Rule, charted, correlation, learned, rule_of, threshold


def series(random: Random, blocks: int, correlation: float) -> list[float]:
    """An AR(1) process of variance 1."""
    figures = [random.gauss(0.0, 1.0)]
    for _ in range(blocks - 1):
        figures.append(correlation * figures[-1] + math.sqrt(1.0 - correlation**2) * random.gauss(0.0, 1.0))
    return figures


def baseline_of(figures: list[float]) -> Baseline:
    baseline = Baseline()
    for number, figure in enumerate(figures):
        baseline = learned(baseline, figure, figures[number - 1] if number else None)
    return baseline


def alarms(baseline: Baseline, rule: Rule, figures: list[float]) -> int:
    """Return the alarms of both sides of the chart, which begins again after each."""
    chart, count = Chart(), 0
    for figure in figures:
        chart = charted(chart, rule, baseline, figure, 0.0)
        if chart.grows:
            chart, count = Chart(), count + 1
    return count


@pytest.mark.parametrize("correlation_of_blocks", [0.0, 0.5, 0.8])
def test_false_alarms_are_no_more_than_stated(correlation_of_blocks: float) -> None:
    """One in 2,000 blocks of a side is asked for; 30 machines with a baseline of 320 blocks each, and 4,000 blocks to judge."""
    random = Random(11)
    count = 0
    for _ in range(30):
        figures = series(random, 4320, correlation_of_blocks)
        baseline = baseline_of(figures[:320])
        rule = rule_of(baseline, 0.5, 2000.0)
        assert rule is not None
        count += alarms(baseline, rule, figures[320:])
    assert count <= 30 * 2 * 4000 / 2000


def test_the_threshold_of_a_chart_that_knows_its_baseline_keeps_what_it_promises() -> None:
    """And is not so far above it that nothing would ever be seen: between 1 and 6 times the promised length."""
    random = Random(7)
    baseline = Baseline(blocks=10**9)
    rule = Rule(sigma=1.0, widening=1.0, allowance=0.5, threshold=threshold(0.5, 500.0))
    figures = series(random, 300_000, 0.0)
    run = 2 * len(figures) / alarms(baseline, rule, figures)
    assert 500.0 < run < 6 * 500.0


def test_a_baseline_knows_mean_scatter_and_correlation() -> None:
    figures = [5.0 + figure for figure in series(Random(2), 5000, 0.6)]
    baseline = baseline_of(figures)
    assert baseline.mean == pytest.approx(5.0, abs=0.1)
    assert baseline.m2 / baseline.blocks == pytest.approx(1.0, abs=0.1)
    assert 0.6 < correlation(baseline) < 0.67
    assert rule_of(baseline._replace(blocks=BLOCKS_MIN - 1), 0.5, 1000.0) is None


def test_one_stray_block_is_no_alarm() -> None:
    baseline = baseline_of(series(Random(3), 200, 0.0))
    rule = rule_of(baseline, 0.5, 1000.0)
    assert rule is not None
    assert charted(Chart(), rule, baseline, 1e9, 0.0).grows == 0
