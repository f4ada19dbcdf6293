"""The alarms of the simulated control as conditions of its OPC UA server: one event for each that comes, changes or goes.

They are of the type CncAlarmType (OPC 40502, 6.10), from the object `Sinumerik` or from the Server object, as manuals of
SINUMERIK have it; a message is a CncMessageType. ConditionRefresh is the library's own.
"""

import uuid
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

from asyncua import ua
from asyncua.common.node import Node
from asyncua.server.event_generator import EventGenerator
from asyncua.server.server import Server
from asyncua.ua.object_ids import ObjectIds

from cnctwin.standins.opcua_server.shown import CNC

SEVERITY = 1000  # that of an alarm which stops the machine; a warning has 500, information 1


@dataclass(frozen=True, slots=True)
class ShownAlarm:
    """One alarm as the control shows it; one that is gone but not acknowledged is shown as not active.

    number: tells apart alarms of one code; branch: an earlier state that still waits to be acknowledged
    """

    code: str
    text: str
    severity: int = SEVERITY
    active: bool = True
    acknowledged: bool = True
    number: int = 1
    branch: int = 0

    @property
    def identity(self) -> tuple[str, int, int]:
        """Return what stays the same while the alarm changes."""
        return self.code, self.number, self.branch


class _Generator(EventGenerator):
    """Stamps its events with the control's own time."""

    now: Callable[[], datetime]

    async def trigger(
        self, time_attr: datetime | None = None, message: str | None = None, subscription_id: int | None = None
    ) -> None:
        """Send the event."""
        await super().trigger(self.now() if time_attr is None else time_attr, message, subscription_id)


class Alarms:
    """The conditions of one server. Create it after the server's nodes, before it starts; `now` is the control's calendar."""

    def __init__(self, server: Server, notifier: Node, now: Callable[[], datetime]) -> None:
        self._server, self._notifier, self._now = server, notifier, now
        self._types: dict[str, ua.NodeId] = {}
        self._index = 0
        self._shown: dict[tuple[str, int, int], ShownAlarm] = {}

    async def prepare(self) -> None:
        """Make the types of events, and let a refresh begin and end where its events are."""
        self._index = await self._server.register_namespace(CNC)
        for name, base, properties in (
            ("CncAlarmType", ObjectIds.DiscreteAlarmType, [("AlarmIdentifier", ua.VariantType.String)]),
            ("CncMessageType", ObjectIds.BaseEventType, []),
        ):
            kind = await self._server.create_custom_event_type(self._index, name, base, properties)
            self._types[name] = kind.nodeid
        events = self._server.iserver.subscription_service.standard_events
        for number in (ObjectIds.RefreshStartEventType, ObjectIds.RefreshEndEventType):
            events[number] = await self._generator(ua.NodeId(ua.Int32(number)))

    async def _generator(self, kind: ua.NodeId) -> EventGenerator:
        generator = _Generator(self._server.iserver.isession)
        generator.now = self._now
        await generator.init(kind, self._notifier, add_generates_event=False)
        return generator

    async def show(self, alarms: Iterable[ShownAlarm]) -> None:
        """Tell what is other than before."""
        wanted = {alarm.identity: alarm for alarm in alarms}
        for identity in [one for one in self._shown if one not in wanted]:
            gone = replace(self._shown.pop(identity), active=False, acknowledged=True)
            await self._tell(gone, retain=False)
        for identity, alarm in wanted.items():
            if self._shown.get(identity) != alarm:
                self._shown[identity] = alarm
                await self._tell(alarm, retain=True)

    async def say(self, text: str) -> None:
        """Send a message that nothing lasts of."""
        generator = await self._generator(self._types["CncMessageType"])
        generator.event.Severity = 1
        await generator.trigger(message=text)

    async def require_refresh(self) -> None:
        """Say that what was told of alarms may be wrong by now."""
        generator = await self._generator(ua.NodeId(ua.Int32(ObjectIds.RefreshRequiredEventType)))
        await generator.trigger(message="Refresh required")

    async def _tell(self, alarm: ShownAlarm, *, retain: bool) -> None:
        generator = await self._generator(self._types["CncAlarmType"])
        event: Any = generator.event
        event.NodeId = ua.NodeId(ua.String(f"{alarm.code}.{alarm.number}"), ua.Int16(self._index))
        event.BranchId = ua.NodeId(ua.String(str(uuid.UUID(int=alarm.branch))), ua.Int16(1)) if alarm.branch else ua.NodeId()
        event.ConditionName = "SystemCondition"
        event.SourceName = "NCK"
        event.AlarmIdentifier = alarm.code
        event.Severity = alarm.severity
        event.Retain = retain
        for name, flag, words in (
            ("EnabledState", True, ("Enabled", "Disabled")),
            ("ActiveState", alarm.active, ("Active", "Inactive")),
            ("AckedState", alarm.acknowledged, ("Acknowledged", "Unacknowledged")),
        ):
            setattr(event, f"{name}/Id", flag)
            setattr(event, name, ua.LocalizedText(words[0] if flag else words[1]))
        await generator.trigger(message=alarm.text)
