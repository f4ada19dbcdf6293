"""The alarms of the simulated control as conditions of its OPC UA server: one event for each that comes, changes or goes.

They are of the type CncAlarmType (OPC 40502, 6.10), from the object `Sinumerik` and from the Server object, as manuals of
SINUMERIK have it; a message is a CncMessageType. ConditionRefresh repeats what is retained, branches too.
"""

import uuid
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

from asyncua import ua
from asyncua.common.methods import uamethod
from asyncua.common.node import Node
from asyncua.server.event_generator import EventGenerator
from asyncua.server.server import Server
from asyncua.ua.object_ids import ObjectIds

from cnctwin.standins.opcua_server.shown import CNC
from cnctwin.standins.simulated_control.state import ControlState

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


def alarms_of(state: ControlState) -> tuple[ShownAlarm, ...]:
    """Return what a PLC would say of this moment of the simulated day: between two parts the door is open."""
    if state.exec_state == "ACTIVE" or state.alarm is not None:
        return ()
    return (ShownAlarm("700016", "Safety door open", 500, acknowledged=False),)


class Alarms:
    """The conditions of one server. Create it after the server's nodes, before it starts; `now` is the control's calendar.

    notifiers: the nodes that send each event; the Server object has those of all others (OPC 10000-3, 7.13)
    """

    def __init__(self, server: Server, notifiers: Iterable[Node], now: Callable[[], datetime]) -> None:
        self._server, self._notifiers, self._now = server, tuple(notifiers), now
        self._types: dict[str, ua.NodeId] = {}
        self._index = 0
        self._shown: dict[tuple[str, int, int], ShownAlarm] = {}
        self._retained: dict[tuple[str, int, int], Any] = {}

    async def prepare(self) -> None:
        """Make the types of events and the method that repeats those of retained conditions."""
        self._index = await self._server.register_namespace(CNC)
        for name, base, properties in (
            ("CncAlarmType", ObjectIds.DiscreteAlarmType, [("AlarmIdentifier", ua.VariantType.String)]),
            ("CncMessageType", ObjectIds.BaseEventType, []),
        ):
            kind = await self._server.create_custom_event_type(self._index, name, base, properties)
            self._types[name] = kind.nodeid
        for node in self._notifiers:
            await node.set_event_notifier([ua.EventNotifier.SubscribeToEvents])
        method = ua.NodeId(ua.Int32(ObjectIds.ConditionType_ConditionRefresh))
        self._server.iserver.isession.add_method_callback(method, uamethod(self._refresh))

    async def show(self, alarms: Iterable[ShownAlarm]) -> None:
        """Tell what is other than before."""
        wanted = {alarm.identity: alarm for alarm in alarms}
        for identity in [one for one in self._shown if one not in wanted]:
            gone = replace(self._shown.pop(identity), active=False, acknowledged=True)
            self._retained.pop(identity)
            await self._send(await self._condition(gone, retain=False))
        for identity, alarm in wanted.items():
            if self._shown.get(identity) != alarm:
                self._shown[identity] = alarm
                self._retained[identity] = await self._condition(alarm, retain=True)
                await self._send(self._retained[identity])

    async def say(self, text: str) -> None:
        """Send a message that nothing lasts of."""
        await self._send(await self._event(self._types["CncMessageType"], text))

    async def warn(self, kind: int) -> None:
        """Send an event of the server itself, by the number of its type: that a refresh is required, that a queue ran over."""
        await self._send(await self._standard(kind))

    async def _refresh(self, _parent: Any, subscription: int) -> None:
        for event in (
            await self._standard(ObjectIds.RefreshStartEventType),
            *self._retained.values(),
            await self._standard(ObjectIds.RefreshEndEventType),
        ):
            await self._send(event, subscription)

    async def _send(self, event: Any, subscription: int | None = None) -> None:
        """Send an event to all who listen at one of the notifiers, or to one subscription."""
        service = self._server.iserver.subscription_service
        for node in self._notifiers:
            sent = copy(event)
            sent.emitting_node = node.nodeid
            for number, one in list(service.subscriptions.items()):
                if subscription in (None, number):
                    await one.monitored_item_srv.trigger_event(sent)

    async def _standard(self, number: int) -> Any:
        return await self._event(ua.NodeId(ua.Int32(number)), "")

    async def _event(self, kind: ua.NodeId, text: str) -> Any:
        generator = EventGenerator(self._server.iserver.isession)
        await generator.init(kind, self._notifiers[0], add_generates_event=False)
        event = generator.event
        event.EventId = uuid.uuid4().bytes
        event.Time = event.ReceiveTime = self._now()
        event.Message = ua.LocalizedText(text)
        event.Severity = 1
        return event

    async def _condition(self, alarm: ShownAlarm, *, retain: bool) -> Any:
        event = await self._event(self._types["CncAlarmType"], alarm.text)
        event.NodeId = ua.NodeId(ua.String(f"{alarm.code}.{alarm.number}"), ua.Int16(self._index))
        event.BranchId = ua.NodeId(ua.Int32(alarm.branch), ua.Int16(self._index)) if alarm.branch else ua.NodeId()
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
        return event
