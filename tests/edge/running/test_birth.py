"""The birth certificate of a machine: what it says of signals whose values are not known yet."""

import pytest

from edge.running.birth import device_metrics
from edge.sample import EdgeSample, Offer
from sparkplug.metric import MetricSpec

NOW_MS = 2_000


def born(*known: EdgeSample) -> dict[str, MetricSpec]:
    offers = (Offer("spindle_rpm", "there"), Offer("alarm", "there"))
    return {spec.name: spec for spec in device_metrics(offers, {sample.signal: sample for sample in known}, NOW_MS)}


@pytest.mark.parametrize(("first_ms", "unknown_ms"), [(1_900, 1_900), (NOW_MS + 3_600_000, NOW_MS)])
def test_a_null_that_is_not_known_yet_is_no_later_than_the_value_that_follows(first_ms: int, unknown_ms: int) -> None:
    metrics = born(EdgeSample("spindle_rpm", 800.0, first_ms))
    assert metrics["spindle_rpm"].timestamp_ms == first_ms
    assert metrics["alarm"].first(NOW_MS + 91).timestamp_ms == unknown_ms
    assert metrics["alarm"].first(NOW_MS + 91).reason == "not known yet"


def test_where_nothing_is_known_a_null_is_of_now() -> None:
    assert {spec.timestamp_ms for spec in born().values()} == {NOW_MS}
