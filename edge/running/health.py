"""The health of the edge itself: lag, holes, reconnects, refused frames, published as metrics of the edge node."""

from collections.abc import Iterable, Mapping

from edge.sample import Gap, SampleSet
from sparkplug.datatype import DataType
from sparkplug.metric import Change, MetricSpec

HEALTH = (
    MetricSpec("health/lag_s", DataType.DOUBLE, "s"),  # edge clock minus the time of the newest observation taken
    MetricSpec("health/backlog", DataType.INT64, "observations", value=0),
    MetricSpec("health/holes", DataType.INT64, value=0),
    MetricSpec("health/lost_observations", DataType.INT64, "observations", value=0),
    MetricSpec("health/last_hole", DataType.STRING, value=""),
    MetricSpec("health/reconnects", DataType.INT64, value=0),
    MetricSpec("health/refused_frames", DataType.INT64, value=0),
    MetricSpec("health/instance_id", DataType.STRING, value=""),
    MetricSpec("health/last_error", DataType.STRING, value=""),
    MetricSpec("health/control_online", DataType.BOOLEAN, value=False),
    MetricSpec("health/broker_reconnects", DataType.INT64, value=0),
    # They count as emitted, and went down with a connection to the broker before they were on the wire; a birth followed.
    MetricSpec("health/unsent_messages", DataType.INT64, "messages", value=0),
    MetricSpec("health/store_rows", DataType.INT64, "rows", value=0),  # that no broker, or no historian, has confirmed yet
    MetricSpec("health/store_waiting_rows", DataType.INT64, "rows", value=0),  # of these: not sent, they follow as history
    MetricSpec("health/store_bytes", DataType.INT64, "B", value=0),
    MetricSpec("health/store_age_s", DataType.DOUBLE, "s", value=0.0),  # of the oldest row
    MetricSpec("health/store_history_rows", DataType.INT64, "rows", value=0),  # sent as history since the edge began
    MetricSpec("health/store_evicted_rows", DataType.INT64, "rows", value=0),  # lost to a limit since the edge began
    MetricSpec("health/awaited_rows", DataType.INT64, "rows", value=0),  # that the broker has, and a historian has not confirmed
    MetricSpec("health/awaited_s", DataType.DOUBLE, "s", value=0.0),  # since the last receipt, while rows wait for one
    MetricSpec("health/history", DataType.STRING, value=""),  # who keeps history, or that nothing does
    MetricSpec("health/store_evicted", DataType.STRING, value=""),  # the rows among which some were lost to a limit, and why
    MetricSpec("health/store_error", DataType.STRING, value=""),
    MetricSpec("health/restarts", DataType.INT64, value=0),  # of this edge in its gateway, after it had ended by itself
    MetricSpec("health/ledger_difference", DataType.INT64, "observations", value=0),
)


class Health:
    """The present values. What happened is counted; what is, is set."""

    def __init__(self) -> None:
        self.holes = 0
        self.lost_observations = 0
        self.refused_frames = 0
        self.last_hole = ""
        self.last_error = ""
        self.instance_id = ""
        self.backlog = 0
        self.lag_s: float | None = None

    def note(self, frame: SampleSet, now_s: float) -> None:
        """Note what one frame says of the edge's own state."""
        if frame.error is not None:
            self.refused_frames += 1
            self.last_error = frame.error
        else:
            self.backlog = frame.backlog
        self.holes_in(frame.gaps)
        if frame.instance is not None:
            self.instance_id = frame.instance
        if frame.newest_ms is not None:
            self.lag_s = now_s - frame.newest_ms / 1000

    def holes_in(self, gaps: Iterable[Gap]) -> None:
        """Count what nobody can get any more."""
        for gap in gaps:
            self.holes += 1
            self.lost_observations += gap.lost
            self.last_hole = f"{gap.reason}: {gap.first_sequence} to {gap.last_sequence}, at most {gap.lost} lost"

    def changes(self, now_ms: int, outside: Mapping[str, int | float | str | bool]) -> list[Change]:
        """All of it; `outside` holds what the loop knows: queue depth, connections, whether the control is there."""
        values: dict[str, int | float | str | bool | None] = {
            "health/lag_s": self.lag_s,
            "health/backlog": self.backlog,
            "health/holes": self.holes,
            "health/lost_observations": self.lost_observations,
            "health/last_hole": self.last_hole,
            "health/refused_frames": self.refused_frames,
            "health/instance_id": self.instance_id,
            "health/last_error": self.last_error,
            **outside,
        }
        return [Change(name, value, now_ms) for name, value in values.items() if value is not None]
