"""The newest judged night of each machine as Prometheus metrics; of several axes or programs the one that is worst."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from prometheus_client.core import GaugeMetricFamily, Metric


class _Figure(NamedTuple):
    """Sorted by how bad it is."""

    is_over: bool
    badness: float
    value: float
    budget: float | None


def validation_metrics(told: Iterable[Mapping[str, Any]]) -> Iterator[Metric]:
    """Yield the metrics of `/validation/{machine}`'s answer for each machine that was judged."""
    labels = ["machine", "quantity", "measure"]
    value = GaugeMetricFamily("twin_validation", "figure of the newest night that was judged", labels=labels)
    budget = GaugeMetricFamily("twin_validation_budget", "what the figure may be", labels=labels)
    over = GaugeMetricFamily("twin_validation_nights_over_budget", "in a row, of the worst figure", labels=["machine"])
    at = GaugeMetricFamily("twin_validation_last_run_timestamp_seconds", "when the newest night was judged", labels=["machine"])
    for one in told:
        machine = str(one["machine"])
        over.add_metric([machine], max(one["over_in_a_row"].values(), default=0))
        at.add_metric([machine], one["t"] / 1000.0)
        for (quantity, measure), figure in _worst(one["figures"]).items():
            value.add_metric([machine, quantity, measure], figure.value)
            if figure.budget is not None:
                budget.add_metric([machine, quantity, measure], figure.budget)
    yield from (value, budget, over, at)


def _worst(figures: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], _Figure]:
    found: dict[tuple[str, str], _Figure] = {}
    for one in figures:
        value, budget = one.get("value"), one.get("budget")
        if not isinstance(value, int | float):
            continue
        key = (str(one.get("quantity")), str(one.get("measure")))
        badness = -value if key[1] == "r" else value  # a correlation is the worse the less it is
        limit = float(budget) if isinstance(budget, int | float) else None
        figure = _Figure(one.get("verdict") == "over", badness, float(value), limit)
        found[key] = max(found.get(key, figure), figure, key=lambda figure: figure[:2])
    return found
