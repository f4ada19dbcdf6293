"""What a part that has ended without an alarm teaches; a part that alarmed teaches nothing."""

from twin.anomaly.parts.judging import Judged
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.record import CutRecord


def learned(model: PartsModel, own: Own, judged: Judged, is_alarm: bool) -> tuple[Own, CutRecord | None]:
    """Return the state once the alarm is known, and the record of an operation that has ended at this tick."""
    return own, None
