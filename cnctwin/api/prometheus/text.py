"""The plant as Prometheus metrics. Each scrape is read from the live plant again; nothing is counted here."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from cnctwin.api.fleet import newest_ms
from cnctwin.api.live.plant import NodeView
from cnctwin.api.prometheus.validation import validation_metrics
from cnctwin.api.sources import Sources
from cnctwin.memory.store.contract import Status
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals
from twin.vocabulary.node_ledger import DROPPED_PREFIX, LEDGER_PREFIX
from twin.vocabulary.nodes import is_twin_node

PHASES = ("pending", "firing", "acknowledged", "resolved")
NODE_GAUGES = {
    "twin_processor_lag_seconds": ("health/lag_s", "how late messages are folded; of an edge, how old they are when taken"),
    "twin_processor_published_lag_seconds": ("health/published_lag_s", "how late results are handed to the broker"),
    "twin_processor_busy_percent": ("health/busy_pct", "CPU time of the processor's process; 100 is a core"),
    "twin_processor_lag_events": ("health/queue_depth", "messages behind the network thread"),
    "twin_processor_queue_depth": ("health/queue_depth", "messages behind the network thread"),
    "twin_state_checkpoint_age_seconds": ("health/snapshot_age_s", "age of the oldest unsaved state"),
    "twin_buffer_oldest_age_seconds": (
        "health/store_age_s",
        "age of the oldest row that no broker, or no historian, has confirmed",
    ),
    "twin_buffer_rows": ("health/store_rows", "rows that no broker, or no historian, has confirmed"),
    "twin_buffer_bytes": ("health/store_bytes", "size of the edge's ring"),
    "twin_kafka_runners": ("health/runners", "runners of a processor that report"),
    "twin_kafka_runners_silent": ("health/runners_silent", "runners of it that ended without a word"),
    "twin_kafka_partitions": ("health/partitions", "partitions that they fold"),
    "twin_kafka_lag_records": ("health/lag_records", "records that wait in the log"),
    "twin_kafka_restore_seconds": ("health/restored_s", "the longest of the last restorations of a runner"),
    "twin_kafka_bridges": ("health/bridges", "bridges that report; each node says the same"),
    "twin_kafka_bridges_silent": ("health/bridges_silent", "bridges that ended without a word; each node says the same"),
    "twin_kafka_bridge_waiting": ("health/bridge_waiting", "records that the cluster has not acknowledged, of all bridges"),
    "twin_kafka_bridge_busy_percent": ("health/bridge_busy_pct", "CPU time of the busiest bridge; 100 is a core"),
    "twin_control_online": ("health/control_online", "whether the edge has its control"),
}
NODE_COUNTERS = {
    "twin_late": ("health/late", "messages behind the machine's clock"),
    "twin_dead_letters": ("health/dead_letters", "samples that a fold could not take"),
    "twin_reconnects": ("health/reconnects", "connections made again"),
    "twin_replayed": ("health/store_history_rows", "rows sent as history"),
    "twin_kafka_records": ("health/records", "records that runners have taken from the log"),
    "twin_kafka_transactions": ("health/transactions", "transactions that runners have committed"),
    "twin_kafka_transactions_aborted": ("health/transactions_aborted", "transactions that came to nothing, and were repeated"),
    "twin_kafka_rebalances": ("health/rebalances", "times that partitions came or went"),
    "twin_kafka_lost_by_retention": ("health/lost_by_retention", "records that were deleted before they were folded"),
    "twin_kafka_repeated": ("health/repeated", "records that came twice, and were left out"),
    "twin_kafka_bridge_events": ("health/bridge_events", "events that the bridges have taken in"),
    "twin_kafka_bridge_delivered": ("health/bridge_delivered", "records that the cluster has acknowledged, of all bridges"),
    "twin_kafka_bridge_dropped": ("health/bridge_dropped", "records that found no room, of all bridges"),
    "twin_evicted": ("health/store_evicted_rows", "rows lost to a limit of the edge's ring"),
}
MACHINE_GAUGES = {
    "twin_clock_offset_seconds": ("clock_offset_s", "controller clock minus edge clock"),
    "twin_gate_active": (twin_signals.TOOL_CHANGE_GATE, "1 while a tool change and its tail gate the score"),
    "twin_raw_score": (twin_signals.RAW_SCORE, "anomaly score before gates"),
    "twin_adjusted_score": (twin_signals.ADJUSTED_SCORE, "anomaly score that alarms are made of"),
    "twin_spindle_temp_residual_kelvin": (twin_signals.SPINDLE_TEMP_RESIDUAL_K, "measured minus modelled"),
    "twin_gap_growing": (twin_signals.GAP_GROWING, "1 where the gap of some signal grows"),
}


class Served(NamedTuple):
    """The figures of this server's own readers."""

    streams: int
    streams_dropped: int
    subscriptions: int
    updates_dropped: int


class PlantCollector(Collector):
    """All metrics of one scrape."""

    def __init__(self, sources: Sources, status: Status | None, served: Served, now_ms: int) -> None:
        self._sources, self._status, self._served, self._now_ms = sources, status, served, now_ms

    def collect(self) -> Iterator[Metric]:
        """The families, in groups: machines, nodes, alerts, store, this server."""
        live = self._sources.live
        online = {item["machine"]: bool(item["online"]) for item in live.fleet()}
        yield from _machines({name: (is_on, live.readings(name)) for name, is_on in online.items()}, self._now_ms)
        yield from _nodes(live.nodes())
        yield from _alerts(live.alerts())
        yield from validation_metrics([told for name in online if (told := self._sources.nights.of(name))["t"] is not None])
        yield from self._store()
        yield from self._server()

    def _store(self) -> Iterator[Metric]:
        store, status = self._sources.store, self._status
        if not store.configured:
            return
        yield GaugeMetricFamily(
            "twin_store_up", "whether the store answers without trouble", float(bool(status) and not _trouble(status))
        )
        if status is None:
            return
        yield CounterMetricFamily("twin_store_samples", "samples in the store", status.samples)
        yield CounterMetricFamily("twin_store_rows", "samples in the store", status.samples)
        yield GaugeMetricFamily("twin_store_bytes", "bytes on the disk", status.bytes)
        yield GaugeMetricFamily("twin_store_waiting", "samples that wait to be written", status.waiting)
        if status.days_left is not None:
            yield GaugeMetricFamily("twin_store_days_left", "how long the disk lasts at the present rate", status.days_left)
        if status.newest_ms is not None:
            age_s = max(self._now_ms - status.newest_ms, 0) / 1000.0
            yield GaugeMetricFamily("twin_store_age_seconds", "age of the newest sample", age_s)

    def _server(self) -> Iterator[Metric]:
        viewer, counts = self._sources.viewer, self._sources.live.counts
        served = self._served
        yield GaugeMetricFamily("twin_page_streams", "open streams", served.streams)
        yield CounterMetricFamily(
            "twin_page_streams_dropped", "streams let go because they did not keep up", served.streams_dropped
        )
        yield GaugeMetricFamily("twin_i3x_subscriptions", "subscriptions over i3X", served.subscriptions)
        yield CounterMetricFamily("twin_i3x_updates_dropped", "updates that no client came for in time", served.updates_dropped)
        yield CounterMetricFamily("twin_page_messages", "messages of machines that this server has heard", counts["messages"])
        refused = CounterMetricFamily("twin_page_refused", "what this server could not take over", labels=["what"])
        for what in ("readings", "documents"):
            refused.add_metric([what], counts[f"{what}_refused"])
        refused.add_metric(["messages"], counts["failures"])
        yield refused
        latency = CounterMetricFamily("twin_page_latency_seconds_sum", "sum of event time to arrival, over twin_page_messages")
        latency.add_metric([], counts["latency_ms"] / 1000.0)
        yield latency
        models = self._sources.models
        missing = GaugeMetricFamily("twin_model_missing", "1 where a model is configured and not there", labels=["model"])
        missing.add_metric(["residual"], float(models.folder is not None and not models.current()[0]))
        yield missing
        versions = GaugeMetricFamily(
            "twin_model_version_info", "the model of each machine", labels=["model", "machine", "version"]
        )
        for machine, model in models.current()[0].items():
            versions.add_metric(["residual", machine, model.version], 1.0)
        yield versions
        if viewer is None:
            return
        told = viewer.counts()
        yield GaugeMetricFamily("twin_broker_up", "whether this server has its broker", float(viewer.online))
        yield CounterMetricFamily("twin_rebirth_requests", "births asked for by this server", told.get("rebirths_requested", 0))
        yield CounterMetricFamily("twin_malformed", "messages that could not be read", told.get("malformed", 0))
        yield CounterMetricFamily("twin_page_dropped", "messages that came too fast for this server", told["dropped"])


def text(collector: PlantCollector) -> bytes:
    """The scrape as text."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    return generate_latest(registry)


def _machines(machines: Mapping[str, tuple[bool, Mapping[str, Reading]]], now_ms: int) -> Iterator[Metric]:
    age = GaugeMetricFamily("twin_source_age_seconds", "event time of the newest measured value to now", labels=["machine"])
    online = GaugeMetricFamily("twin_source_online", "whether the machine's control is connected", labels=["machine"])
    gap = GaugeMetricFamily("twin_gap", "standing gap, rms over its floor", labels=["machine", "signal"])
    for machine, (is_online, readings) in machines.items():
        at_ms = newest_ms(one for name, one in readings.items() if not name.startswith(twin_signals.TWIN_PREFIX))
        online.add_metric([machine], float(is_online))
        if at_ms is not None:
            age.add_metric([machine], max(now_ms - at_ms, 0) / 1000.0)
        for name, reading in readings.items():
            if twin_signals.is_gap(name) and (value := _number(reading)) is not None:
                gap.add_metric([machine, name.removeprefix(twin_signals.GAP_PREFIX)], value)
    yield from (age, online, gap)
    for title, (name, meaning) in MACHINE_GAUGES.items():
        family = GaugeMetricFamily(title, meaning, labels=["machine"])
        for machine, (_, readings) in machines.items():
            if (value := _number(readings.get(name))) is not None:
                family.add_metric([machine], value)
        yield family


def _nodes(nodes: Iterable[NodeView]) -> Iterator[Metric]:
    told = list(nodes)
    online = GaugeMetricFamily("twin_node_online", "whether an edge node or processor is born", labels=["node"])
    ledger = {
        name: CounterMetricFamily(f"twin_{name}", f"messages {name}, by the node's ledger", labels=["node"])
        for name in ("received", "emitted")
    }
    depth = GaugeMetricFamily("twin_buffer_depth", "what a node holds, by its ledger", labels=["node"])
    difference = GaugeMetricFamily(
        "twin_ledger_difference", "received - emitted - dropped - buffered; 0 where it balances", labels=["node"]
    )
    dropped = CounterMetricFamily("twin_dropped", "what led to nothing, by reason", labels=["node", "reason"])
    holes = CounterMetricFamily("twin_seq_gaps", "times that messages were missing", labels=["layer", "node"])
    for node, is_online, values in told:
        online.add_metric([node], float(is_online))
        if (gaps := _count(values.get("health/holes"))) is not None:
            holes.add_metric(["sparkplug" if is_twin_node(node) else "control", node], gaps)
        sums = {name: _count(values.get(f"{LEDGER_PREFIX}{name}")) for name in ("received", "emitted", "buffered", "dropped")}
        if sums["received"] is None:
            continue
        for name, family in ledger.items():
            family.add_metric([node], sums[name] or 0.0)
        depth.add_metric([node], sums["buffered"] or 0.0)
        difference.add_metric([node], sums["received"] - sum(sums[name] or 0.0 for name in ("emitted", "buffered", "dropped")))
        for name, value in values.items():
            if name.startswith(DROPPED_PREFIX) and (count := _count(value)) is not None:
                dropped.add_metric([node, name.removeprefix(DROPPED_PREFIX)], count)
    yield from (online, *ledger.values(), depth, difference, dropped, holes)
    yield from _by_table(told, NODE_GAUGES, GaugeMetricFamily)
    yield from _by_table(told, NODE_COUNTERS, CounterMetricFamily)


def _by_table(nodes: Iterable[NodeView], table: Mapping[str, tuple[str, str]], kind: Any) -> Iterator[Metric]:
    for title, (name, meaning) in table.items():
        family = kind(title, meaning, labels=["node"])
        for node, _, values in nodes:
            if (value := _count(values.get(name))) is not None:
                family.add_metric([node], value)
        yield family


def _alerts(state: Mapping[str, Any] | None) -> Iterator[Metric]:
    if state is None:
        return
    phases = [alert.get("phase") for alert in state.get("alerts", ()) if isinstance(alert, dict)]
    for title in ("twin_alerts", "twin_alerts_total"):
        family = GaugeMetricFamily(title, "alerts by their state", labels=["state"])
        for phase in PHASES:
            family.add_metric([phase], phases.count(phase))
        yield family


def _number(reading: Reading | None) -> float | None:
    if reading is None or reading.quality is not Quality.GOOD:
        return None
    return _count(reading.value)


def _count(value: object) -> float | None:
    return float(value) if isinstance(value, bool | int | float) else None


def _trouble(status: Status | None) -> bool:
    return status is None or bool(status.trouble)
