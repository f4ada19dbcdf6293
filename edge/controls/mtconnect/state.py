"""The position of the MTConnect edge: what was taken, and which document comes next."""

from dataclasses import dataclass, field
from enum import StrEnum

from edge.controls.mtconnect.alarm import Alarm
from edge.controls.mtconnect.asset_watch import AssetWatch
from edge.controls.mtconnect.mapping import ChosenItem
from edge.reading import Target


class Phase(StrEnum):
    """The document that is asked for next."""

    PROBE = "probe"
    CURRENT = "current"
    SAMPLE = "sample"
    ASSET = "asset"  # the tool in the spindle; then sampling goes on where it was


@dataclass(frozen=True, slots=True)
class Cursor:
    """The parser's position. `hole` is why a baseline is needed, "" where none is; `attempt` counts refused frames in a row.

    chosen: what [variables] and [plc] read; tool_signals: what the asset of the tool in the spindle feeds
    alarm_signals: those of `alarm` and `alarms` that are published
    left_instance, left_sequence: the place that was given up for another instance, as long as nothing of that one was taken
    """

    phase: Phase = Phase.PROBE
    instance_id: str = ""
    next_sequence: int = 0
    buffer_size: int = 0
    device_name: str = ""
    device_uuid: str = ""
    targets: tuple[Target, ...] = ()
    availability_id: str = ""
    conditions: int = 0
    alarms: tuple[Alarm, ...] = ()
    alarm_signals: tuple[str, ...] = ()
    chosen: tuple[ChosenItem, ...] = ()
    tool_signals: tuple[str, ...] = ()
    asset: AssetWatch = field(default_factory=AssetWatch)
    hole: str = ""
    attempt: int = 0
    left_instance: str = ""
    left_sequence: int = 0
