"""The lag of processors, as their nodes report it; the one judgement that doctor, page and interface share."""

from collections.abc import Iterable, Mapping

from processors.lag_report import BEHIND_S, LagReport, by_process
from sparkplug.values import Value
from twin.vocabulary.nodes import TWIN_NODE_PREFIX, is_twin_node

_PREFIX = "health/"


def lag_reports(nodes: Iterable[tuple[str, Mapping[str, Value]]]) -> list[LagReport]:
    """Return one report for each process, the furthest behind first, from the own metrics of the nodes that are online."""
    return by_process(report for node, values in nodes if is_twin_node(node) and (report := _report(node, values)) is not None)


def behind(reports: Iterable[LagReport]) -> str | None:
    """Return the sentences on the processes that are behind; None where none is."""
    return "; ".join(report.sentence for report in reports if report.lag_s >= BEHIND_S) or None


def _report(node: str, values: Mapping[str, Value]) -> LagReport | None:
    """Return what a processor's node reports; None for a node that is no processor, has not reported yet, or has no runner."""
    if values.get(f"{_PREFIX}runners") == 0:
        return None
    lags_s = [_amount(values.get(f"{_PREFIX}{name}")) for name in ("lag_s", "published_lag_s")]
    known_s = [lag_s for lag_s in lags_s if lag_s is not None]
    if not known_s:
        return None
    process = values.get(f"{_PREFIX}process")
    runners, partitions, waiting = (
        round(_amount(values.get(f"{_PREFIX}{name}")) or 0.0) for name in ("runners", "partitions", "lag_records")
    )
    return LagReport(
        processors=(node.removeprefix(TWIN_NODE_PREFIX),),
        process=process if isinstance(process, str) and process else node,
        at_ms=0,
        lag_s=max(known_s),
        machines=round(_amount(values.get(f"{_PREFIX}machines")) or 0.0),
        busy_pct=_amount(values.get(f"{_PREFIX}busy_pct")) or 0.0,
        runners=runners,
        partitions=partitions,
        waiting=waiting,
    )


def _amount(value: Value) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and 0.0 <= value < float("inf") else None  # type: ignore[operator,arg-type]
