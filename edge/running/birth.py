"""The birth certificate of a machine: its signals with unit, limits and where they come from."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from edge.clock import offset as clock
from edge.sample import EdgeSample, Offer
from edge.tool_change import CUE
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec
from twin.vocabulary.signals import DERIVED, Kind

DATATYPES = {Kind.NUMBER: DataType.DOUBLE, Kind.INTEGER: DataType.INT64, Kind.TEXT: DataType.STRING, Kind.FLAG: DataType.BOOLEAN}


def device_metrics(offers: Iterable[Offer], last: Mapping[str, EdgeSample], now_ms: int) -> list[MetricSpec]:
    """Return the metrics of the machine, with the values that are known already.

    A value that is not known yet was read before now, with the others that follow the birth: its null is as old as the newest
    value that is known, so that no store takes it for later than the value.
    """
    unknown_ms = min(now_ms, max((sample.timestamp_ms for sample in last.values()), default=now_ms))
    by_name = {offer.signal: offer for offer in offers}
    by_name |= {name: Offer(name, "edge") for name in ("tool_number", *DERIVED, *clock.SIGNALS) if name not in by_name}
    return [_metric(offer, last.get(name), unknown_ms) for name, offer in by_name.items() if name != CUE]


def _metric(offer: Offer, last: EdgeSample | None, unknown_ms: int) -> MetricSpec:
    known = offer.declared
    properties = {"source": offer.source} | ({"nativeUnit": offer.native_unit} if offer.native_unit else {})
    spec = MetricSpec(offer.signal, DATATYPES[known.kind], known.unit or None, known.low, known.high, properties)
    if last is None:
        return replace(spec, timestamp_ms=unknown_ms)
    return replace(spec, value=last.value, timestamp_ms=last.timestamp_ms, quality=last.quality, reason=last.reason)
