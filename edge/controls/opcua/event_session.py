"""The events of a server: which types it has, a monitored item for them, and the request to repeat the alarms that are there.

Nothing is ever acknowledged, confirmed or commented. The one method that is called, ConditionRefresh, changes nothing at the
server: it sends the state of each retained condition once more, to this subscription alone.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from asyncua import ua
from asyncua.client.client import Client
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds
from asyncua.ua.uaerrors import UaStatusCodeError

from edge.controls.opcua.config import AUTO, NONE, Config
from edge.controls.opcua.event import EVENTS, REFRESH, Event, Kind
from edge.controls.opcua.event_fields import EventType, Fields, as_fact, fields_for
from edge.controls.opcua.library import CONDITION_REFRESH, CONDITION_TYPE
from edge.controls.opcua.plain import status_name
from edge.controls.opcua.point import maps, node_of
from edge.controls.opcua.resolve import name_of, node_id
from edge.sweep import Fact

HANDLE = 2**31 - 1  # above those of values
QUEUE_SIZE = 1_000
TYPES_MAX = 2_000
DEPTH_MAX = 12
REFRESH_S_MAX, REFRESH_APART_S_MIN = 10.0, 10.0
AT_ONCE = 100
NO_FIELDS = "not asked for, since the server refuses the fields of conditions"
_BASE, _CONDITION = ObjectIds.BaseEventType, ObjectIds.ConditionType
_SERVER = "i=2253"
_OF_FILTER = {
    "BadEventFilterInvalid",
    "BadMonitoredItemFilterInvalid",
    "BadMonitoredItemFilterUnsupported",
    "BadFilterNotAllowed",
    "BadFilterOperandInvalid",
}


class Listening(NamedTuple):
    """A subscription to events: its source as a configuration names it, or why there is none; its fields and types.

    is_simple: the server gives those fields alone that every event has, so that nothing is known of conditions
    """

    source: str
    fault: str
    fields: Fields
    types: Mapping[str, EventType]
    stamps: str
    is_simple: bool = False

    def told(self, values: Sequence[ua.Variant]) -> Fact:
        """Return one event as a fact."""
        return as_fact(self.fields.names, values, self.types, self.stamps)


class EventWatch:
    """The events of one session, and when to have the alarms repeated: on joining, after a loss, and where the server asks."""

    def __init__(self, client: Client, subscription: int, listening: Listening, clock: Callable[[], float]) -> None:
        self._client, self._subscription, self._listening, self._clock = client, subscription, listening, clock
        self._is_due, self._is_waiting, self._asked_s = bool(listening.source), False, -REFRESH_APART_S_MIN

    @property
    def about(self) -> Fact:
        """Return where the events come from, or why there are none."""
        return Fact(EVENTS, self._listening.source or None, self._listening.fault)

    @property
    def is_waiting(self) -> bool:
        """Return True while a refresh goes on."""
        return self._is_waiting

    def facts(self, parts: Sequence[object]) -> list[Fact]:
        """Return each event of a notification as a fact."""
        told = [self._listening.told(values) for values in events_in(parts)]
        kinds = {Event.kind_of(fact) for fact in told}
        self._is_due |= bool(kinds & {Kind.REFRESH_REQUIRED, Kind.OVERFLOW})
        self._is_waiting &= Kind.REFRESH_END not in kinds
        return told

    def missed(self) -> None:
        """Something of what was published did not arrive, perhaps an event."""
        self._is_due = bool(self._listening.source)

    async def tick(self) -> Fact | None:
        """Ask for the alarms where that is due; the fact that they are not told, where that turns out."""
        now_s = self._clock()
        if self._is_due and now_s - self._asked_s >= REFRESH_APART_S_MIN:
            self._is_due, self._is_waiting, self._asked_s = False, True, now_s
            is_simple = self._listening.is_simple
            fault = refresh_fault(NO_FIELDS) if is_simple else await refresh(self._client, self._subscription)
            self._is_waiting &= fault is None
            return fault
        if self._is_waiting and now_s - self._asked_s > REFRESH_S_MAX:
            self._is_waiting = False
            return refresh_fault(f"no end of it within {REFRESH_S_MAX:g} s")
        return None


async def listen(config: Config, client: Client, subscription: int) -> Listening | None:
    """Add the events of the first source that gives any to this subscription; None where the configuration wants none."""
    if config.source.events == NONE:
        return None
    namespaces = await client.get_namespace_array()
    types, faults = await types_of(client, namespaces), list[str]()
    for source in _sources(config):
        node = node_id(node_of(source), namespaces)
        if node is None:
            faults.append(f"{source}: the server has no such namespace")
            continue
        for simple in (False, True):
            fields = fields_for(types, namespaces, simple=simple)
            status = await _monitor(client, subscription, node, fields)
            if status.is_good():
                return Listening(name_of(node, namespaces), "", fields, types, config.source.timestamps, simple)
            if status_name(status) not in _OF_FILTER:
                break
        faults.append(f"{source}: {status_name(status)}")
    fault = f"the server offers no events ({', '.join(faults)})"
    return Listening("", fault, Fields([], ()), types, config.source.timestamps)


def _sources(config: Config) -> tuple[str, ...]:
    """Return the nodes to ask, in turn: the one that is configured; else that of the map, then the Server object."""
    if config.source.events != AUTO:
        return (config.source.events,)
    known = maps().get(config.source.map)
    return (*((known.events,) if known is not None and known.events else ()), _SERVER)


async def _monitor(client: Client, subscription: int, node: ua.NodeId, fields: Fields) -> ua.StatusCode:
    item = ua.MonitoredItemCreateRequest()
    item.ItemToMonitor = ua.ReadValueId(NodeId=node, AttributeId=AttributeIds.EventNotifier)
    item.MonitoringMode = ua.MonitoringMode.Reporting
    item.RequestedParameters = ua.MonitoringParameters(
        ClientHandle=ua.UInt32(HANDLE),
        SamplingInterval=0.0,
        QueueSize=ua.UInt32(QUEUE_SIZE),
        DiscardOldest=True,
        Filter=ua.EventFilter(SelectClauses=fields.clauses),
    )
    request = ua.CreateMonitoredItemsParameters()
    request.SubscriptionId = ua.UInt32(subscription)
    request.ItemsToCreate = [item]
    request.TimestampsToReturn = ua.TimestampsToReturn.Both
    status: ua.StatusCode = (await client.uaclient.session.create_monitored_items(request))[0].StatusCode
    return status


async def refresh(client: Client, subscription: int) -> Fact | None:
    """Have the alarms repeated that are there; None where the server does so, else the fact that says why it does not."""
    call = ua.CallMethodRequest()
    call.ObjectId, call.MethodId = ua.NodeId(ua.Int32(CONDITION_TYPE)), ua.NodeId(ua.Int32(CONDITION_REFRESH))
    call.InputArguments = [ua.Variant(subscription, ua.VariantType.UInt32)]
    try:
        status = (await client.uaclient.session.call([call]))[0].StatusCode
    except UaStatusCodeError as error:
        status = ua.StatusCode(ua.UInt32(error.code))
    return None if status.is_good() else refresh_fault(status_name(status))


def refresh_fault(why: str) -> Fact:
    """Return the fact that the server did not tell its alarms."""
    return Fact(REFRESH, fault=f"the server does not tell which alarms were there already (ConditionRefresh: {why})")


async def types_of(client: Client, namespaces: Sequence[str]) -> dict[str, EventType]:
    """Return the types of events below BaseEventType, by their nodes as text, bounded in number and depth."""
    root = ua.NodeId(ua.Int32(_BASE))
    found = {root.to_string(): EventType(root, "BaseEventType", namespaces[0], False)}
    level = [root]
    for _ in range(DEPTH_MAX):
        below: list[ua.NodeId] = []
        for begin in range(0, len(level), AT_ONCE):
            some = level[begin : begin + AT_ONCE]
            wishes = [_subtypes(node) for node in some]
            results = await client.uaclient.session.browse(ua.BrowseParameters(NodesToBrowse=wishes))
            for parent, result in zip(some, results, strict=True):
                is_condition = found[parent.to_string()].is_condition
                for one in result.References or ():
                    node = ua.NodeId(one.NodeId.Identifier, one.NodeId.NamespaceIndex)
                    key, index = node.to_string(), int(one.BrowseName.NamespaceIndex)
                    if key in found or len(found) >= TYPES_MAX:
                        continue
                    namespace = namespaces[index] if index < len(namespaces) else ""
                    is_one = is_condition or (index == 0 and node.Identifier == _CONDITION)
                    found[key] = EventType(node, str(one.BrowseName.Name or ""), namespace, is_one)
                    below.append(node)
        level = below
        if not level:
            break
    return found


def _subtypes(node: ua.NodeId) -> ua.BrowseDescription:
    return ua.BrowseDescription(
        NodeId=node,
        BrowseDirection=ua.BrowseDirection.Forward,
        ReferenceTypeId=ua.NodeId(ua.Int32(ObjectIds.HasSubtype)),
        IncludeSubtypes=True,
        NodeClassMask=ua.UInt32(ua.NodeClass.ObjectType),
        ResultMask=ua.UInt32(ua.BrowseResultMask.All),
    )


def events_in(parts: Sequence[object]) -> list[Sequence[ua.Variant]]:
    """Return the fields of each event in a notification."""
    lists = (part.Events for part in parts if isinstance(part, ua.EventNotificationList))
    return [event.EventFields for events in lists for event in events or ()]
