"""The dashboard of the folds on Kafka: who folds, how far behind, and what was lost on the way.

Each processor's node says the same of the bridges, so their panels take the largest. Runners of several processors say the same
of each: their lines lie on each other.
"""

from dashboard_source import words
from dashboard_source.board import Board, Limit, Metric, Panel
from dashboard_source.service_boards import figure, lines, rate, rising

PER_S = "suffix: /s"


def _largest_rate(name: str) -> str:
    return f"max(rate({name}[$__rate_interval]))"


FIGURES = (
    figure(
        "Runners, fewest",
        "Of the processor that has fewest; 0: nobody folds it.",
        "min(twin_kafka_runners)",
        limits=(Limit(None, words.RED), Limit(1.0, words.GREEN)),
    ),
    figure(
        "Silent",
        "Bridges and runners that ended without a word; `cnctwin doctor` names them.",
        "max(twin_kafka_bridges_silent) + max(twin_kafka_runners_silent)",
    ),
    figure(
        "Lag",
        "Of the processor that is last.",
        "max(twin_processor_lag_seconds and on (node) twin_kafka_runners)",
        limits=rising(5.0, 10.0),
        unit="s",
    ),
    figure(
        "Records wait at bridges",
        "That the cluster has not acknowledged; there is room for 1,000,000.",
        "max(twin_kafka_bridge_waiting)",
        limits=rising(10_000.0, 500_000.0),
    ),
    figure("Dropped in an hour", "Records that found no room at a bridge.", "max(increase(twin_kafka_bridge_dropped_total[1h]))"),
    figure(
        "Lost in an hour",
        "Records that were deleted before they were folded: retention_hours is too short.",
        "max(increase(twin_kafka_lost_by_retention_total[1h]))",
    ),
)
LINES = (
    lines("Lag: records", "Records that wait in the log, by processor.", "twin_kafka_lag_records", "{{node}}"),
    lines(
        "Lag: time",
        "Age of the records that are folded now, in the partition that is last.",
        "twin_processor_lag_seconds and on (node) twin_kafka_runners",
        "{{node}}",
        unit="s",
    ),
    lines("Records", "Taken from the log by the runners.", rate("twin_kafka_records_total", "node"), "{{node}}", unit=PER_S),
    lines("Transactions", "Committed.", rate("twin_kafka_transactions_total", "node"), "{{node}}", unit=PER_S),
    lines(
        "Transactions aborted",
        "In a minute. Each is folded again from the last saved state.",
        "sum by (node) (increase(twin_kafka_transactions_aborted_total[1m]))",
        "{{node}}",
    ),
    lines(
        "Rebalances",
        "Times in a minute that partitions came to a runner or went.",
        "sum by (node) (increase(twin_kafka_rebalances_total[1m]))",
        "{{node}}",
    ),
    lines("Runners", "That report.", "twin_kafka_runners", "{{node}}"),
    lines("Partitions", "That they fold; fewer for long: nobody has the rest.", "twin_kafka_partitions", "{{node}}"),
    lines(
        "Restoration",
        "The longest of the last ones: how long a runner reads states before it folds.",
        "twin_kafka_restore_seconds",
        "{{node}}",
        unit="s",
    ),
    Panel(
        title="Bridges: records",
        says="Events of machines that came in; records that the cluster has acknowledged.",
        series=(
            Metric(expression=_largest_rate("twin_kafka_bridge_events_total"), legend="events in"),
            Metric(expression=_largest_rate("twin_kafka_bridge_delivered_total"), legend="delivered"),
        ),
        unit=PER_S,
        width=8,
    ),
    lines("Bridges: waiting", "Records that the cluster has not acknowledged.", "max(twin_kafka_bridge_waiting)", "waiting"),
    lines(
        "Bridges: dropped",
        "Records that found no room; a hole is reported to the folds.",
        _largest_rate("twin_kafka_bridge_dropped_total"),
        "dropped",
        unit=PER_S,
    ),
    Panel(
        title="Busy",
        says="CPU time of the busiest runner of each processor, and of the busiest bridge; 100 % is a core.",
        series=(
            Metric(expression="twin_processor_busy_percent and on (node) twin_kafka_runners", legend="{{node}}"),
            Metric(expression="max(twin_kafka_bridge_busy_percent)", legend="bridge"),
        ),
        unit="percent",
        width=8,
    ),
    lines(
        "Came twice",
        "Records that were there already, and were left out. As many as come in: two bridges read the same nodes.",
        rate("twin_kafka_repeated_total", "node"),
        "{{node}}",
        unit=PER_S,
    ),
    lines(
        "Folded",
        "Messages of devices, by the ledger of each processor.",
        "sum by (node) (rate(twin_emitted_total[$__rate_interval]) and on (node) twin_kafka_runners)",
        "{{node}}",
        unit=PER_S,
    ),
)
KAFKA = Board(
    uid="cnctwin-kafka",
    title="Kafka",
    says="The folds on Kafka: who folds, how far behind, what was lost on the way.",
    chooses_machine=False,
    last="now-3h",
    refresh="10s",
    from_metrics=True,
    panels=(*FIGURES, *LINES),
)

BOARDS = (KAFKA,)
