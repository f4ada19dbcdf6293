"""The health of a processor: the node metrics of its edge node."""

from processors.running.ledger import Ledger
from sparkplug.datatype import DataType
from sparkplug.metric import MetricSpec

HEALTH = (
    MetricSpec("health/machines", DataType.INT64, properties={"meaning": "machines online"}),
    MetricSpec(
        "health/lag_s", DataType.DOUBLE, unit="s", properties={"meaning": "how late messages are folded (running/lag.py)"}
    ),
    MetricSpec("health/published_lag_s", DataType.DOUBLE, unit="s", properties={"meaning": "how late results are handed on"}),
    MetricSpec("health/busy_pct", DataType.DOUBLE, unit="%", properties={"meaning": "CPU time of the process; 100 is a core"}),
    MetricSpec("health/process", DataType.STRING, properties={"meaning": "same text: processors that share a process"}),
    MetricSpec("health/processors", DataType.INT64, properties={"meaning": "processors that share this process"}),
    MetricSpec("health/queue_depth", DataType.INT64, properties={"meaning": "messages behind the network thread"}),
    MetricSpec("health/holes", DataType.INT64, properties={"meaning": "times that messages are missing, or event time jumped"}),
    MetricSpec("health/late", DataType.INT64, properties={"meaning": "messages behind the machine's clock, folded all the same"}),
    MetricSpec("health/ticks", DataType.INT64, properties={"meaning": "ticks of event time"}),
    MetricSpec("health/dead_letters", DataType.INT64, properties={"meaning": "samples that the fold could not take"}),
    MetricSpec("health/ignored", DataType.INT64, properties={"meaning": "messages of nodes that this processor does not read"}),
    MetricSpec("health/snapshot_age_s", DataType.DOUBLE, unit="s", properties={"meaning": "age of the oldest unsaved state"}),
    MetricSpec("health/snapshots_rejected", DataType.INT64, properties={"meaning": "snapshots that could not be restored"}),
    MetricSpec("health/quarantined", DataType.INT64, properties={"meaning": "devices and nodes of which something is refused"}),
    MetricSpec("health/quarantine", DataType.STRING, properties={"meaning": "the first of them as JSON (running/quarantine.py)"}),
    MetricSpec("health/reconnects", DataType.INT64, properties={"meaning": "connections made again"}),
    MetricSpec("health/overload", DataType.INT64, properties={"meaning": "messages passed over: more came than could be folded"}),
    MetricSpec("health/overloaded_by", DataType.STRING, properties={"meaning": "node with most of them lately; empty: none"}),
    MetricSpec("health/faults", DataType.INT64, properties={"meaning": "faults in this processor that were contained"}),
    MetricSpec("health/fault", DataType.STRING, properties={"meaning": "the last of them, in one line; empty: none"}),
    MetricSpec("health/restarts", DataType.INT64, properties={"meaning": "times that a fault has restarted this processor"}),
)

STORE = (
    MetricSpec("health/store_samples", DataType.INT64, properties={"meaning": "samples that were stored since the start"}),
    MetricSpec("health/store_repeated", DataType.INT64, properties={"meaning": "samples that the store had already"}),
    MetricSpec("health/store_refused", DataType.INT64, properties={"meaning": "samples that the store cannot keep"}),
    MetricSpec("health/store_dropped", DataType.INT64, properties={"meaning": "messages for which there was no room to wait"}),
    MetricSpec("health/store_waiting", DataType.INT64, properties={"meaning": "samples that wait to be written"}),
    MetricSpec("health/store_behind_s", DataType.DOUBLE, unit="s", properties={"meaning": "for how long samples have waited"}),
    MetricSpec("health/store_bytes", DataType.INT64, unit="bytes", properties={"meaning": "on the disk"}),
    MetricSpec("health/store_days_left", DataType.DOUBLE, unit="d", properties={"meaning": "that the disk lasts at this rate"}),
    MetricSpec("health/store_pins", DataType.INT64, properties={"meaning": "stretches that no sweep may take"}),
    MetricSpec("health/sequence_holes", DataType.INT64, properties={"meaning": "stretches of rows of edges that stay missing"}),
    MetricSpec("health/sequence_hole", DataType.STRING, properties={"meaning": "the newest of them; empty: none"}),
    MetricSpec("health/store_trouble", DataType.STRING, properties={"meaning": "what is wrong with the store; empty: nothing"}),
)

ON_LOG = (
    MetricSpec("health/runners", DataType.INT64, properties={"meaning": "runners that report"}),
    MetricSpec("health/runners_silent", DataType.INT64, properties={"meaning": "runners that ended without a word, for a day"}),
    MetricSpec("health/records", DataType.INT64, properties={"meaning": "records that the runners have taken from the log"}),
    MetricSpec("health/partitions", DataType.INT64, properties={"meaning": "partitions that they fold"}),
    MetricSpec("health/lag_records", DataType.INT64, properties={"meaning": "records that wait in the log"}),
    MetricSpec("health/transactions", DataType.INT64, properties={"meaning": "transactions that were committed"}),
    MetricSpec(
        "health/transactions_aborted",
        DataType.INT64,
        properties={"meaning": "transactions that came to nothing, and were repeated"},
    ),
    MetricSpec("health/rebalances", DataType.INT64, properties={"meaning": "times that partitions came or went"}),
    MetricSpec("health/restored_s", DataType.DOUBLE, unit="s", properties={"meaning": "the longest of the last restorations"}),
    MetricSpec("health/lost_by_retention", DataType.INT64, properties={"meaning": "records that were gone before their turn"}),
    MetricSpec("health/repeated", DataType.INT64, properties={"meaning": "records that were there already, and dropped"}),
    MetricSpec("health/bridges", DataType.INT64, properties={"meaning": "bridges that report"}),
    MetricSpec("health/bridges_silent", DataType.INT64, properties={"meaning": "bridges that ended without a word, for a day"}),
    MetricSpec("health/silent", DataType.STRING, properties={"meaning": "the silent bridges and runners; empty: none"}),
    MetricSpec("health/bridge_events", DataType.INT64, properties={"meaning": "events that the bridges have taken in"}),
    MetricSpec("health/bridge_delivered", DataType.INT64, properties={"meaning": "records that the cluster has acknowledged"}),
    MetricSpec("health/bridge_waiting", DataType.INT64, properties={"meaning": "records that it has not"}),
    MetricSpec("health/bridge_dropped", DataType.INT64, properties={"meaning": "records that found no room"}),
    MetricSpec(
        "health/bridge_busy_pct",
        DataType.DOUBLE,
        unit="%",
        properties={"meaning": "CPU time of the busiest bridge; 100 is a core"},
    ),
)


def node_metrics(*, records: bool = False, on_log: bool = False) -> tuple[MetricSpec, ...]:
    """All metrics of the node: its ledger, in messages of devices, its health, that of the store where it keeps one, and that of
    runners and bridge where it is folded on a log."""
    ledger = (MetricSpec(name, DataType.INT64, unit="messages") for name in Ledger().metrics())
    return (*ledger, *HEALTH, *(STORE if records else ()), *(ON_LOG if on_log else ()))
