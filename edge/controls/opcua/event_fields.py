"""The fields of an event: which ones a server is asked for, and the event that its answer stands for.

Fields are asked for by the type that declares them and the path from there (OPC 10000-4, 7.7.4.5); the ConditionId is the node of
the condition itself, an empty path. The number of an alarm is a field of the companion models. A server gives null for what an
event does not have.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from asyncua import ua
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds

from edge.controls.opcua.event import TEXT_LENGTH_MAX, Event, Kind
from edge.controls.opcua.plain import stamp_ms
from edge.sweep import Fact

CNC, MACHINE_TOOL = "http://opcfoundation.org/UA/CNC", "http://opcfoundation.org/UA/MachineTool/"
_BASE, _CONDITION = ObjectIds.BaseEventType, ObjectIds.ConditionType
_ACKNOWLEDGEABLE, _ALARM = ObjectIds.AcknowledgeableConditionType, ObjectIds.AlarmConditionType
_CONDITION_ID = ""
_SIMPLE = dict.fromkeys(("EventType", "SourceName", "Time", "ReceiveTime", "Message", "Severity"), _BASE)
_STANDARD = _SIMPLE | {
    "ConditionName": _CONDITION,
    "BranchId": _CONDITION,
    "Retain": _CONDITION,
    "EnabledState/Id": _CONDITION,
    "AckedState/Id": _ACKNOWLEDGEABLE,
    "AckedState": _ACKNOWLEDGEABLE,
    "ActiveState/Id": _ALARM,
    "ActiveState": _ALARM,
    "ActiveState/TransitionTime": _ALARM,
    _CONDITION_ID: _CONDITION,
}
# The number of an alarm or message: OPC 40502, 6.10; OPC 40501-1, 9.1 and 9.3.
_CODES = (
    ("CncAlarmType", CNC, "AlarmIdentifier"),
    ("AlertType", MACHINE_TOOL, "ErrorCode"),
    ("NotificationEventType", MACHINE_TOOL, "Identifier"),
)
_KINDS = {
    ObjectIds.RefreshStartEventType: Kind.REFRESH_START,
    ObjectIds.RefreshEndEventType: Kind.REFRESH_END,
    ObjectIds.RefreshRequiredEventType: Kind.REFRESH_REQUIRED,
    ObjectIds.EventQueueOverflowEventType: Kind.OVERFLOW,
}
_WORDS = {"true": True, "active": True, "acknowledged": True, "false": False, "inactive": False, "unacknowledged": False}


class EventType(NamedTuple):
    """A type of events: its node as text, its name and namespace, and whether it is derived from ConditionType."""

    node: ua.NodeId
    name: str
    namespace: str
    is_condition: bool


class Fields(NamedTuple):
    """A selection: the clauses to send, and the name of each, in the order in which the values come."""

    clauses: list[ua.SimpleAttributeOperand]
    names: tuple[str, ...]


def fields_for(types: Mapping[str, EventType], namespaces: Sequence[str], *, simple: bool = False) -> Fields:
    """Return the fields to ask this server for; `simple`: those alone that every event has."""
    wanted = _SIMPLE if simple else _STANDARD
    found = [(name, _clause(ua.NodeId(ua.Int32(kind)), name, 0)) for name, kind in wanted.items()]
    by_name = {(one.namespace, one.name): one.node for one in types.values()}
    for kind, namespace, field in () if simple else _CODES:
        if (namespace, kind) in by_name:
            found.append((field, _clause(by_name[namespace, kind], field, namespaces.index(namespace))))
    return Fields([clause for _, clause in found], tuple(name for name, _ in found))


def _clause(kind: ua.NodeId, path: str, index: int) -> ua.SimpleAttributeOperand:
    return ua.SimpleAttributeOperand(
        TypeDefinitionId=kind,
        BrowsePath=[ua.QualifiedName(step, ua.UInt16(index)) for step in path.split("/") if step],
        AttributeId=ua.IntegerId(AttributeIds.Value if path else AttributeIds.NodeId),
    )


def as_fact(names: Sequence[str], values: Sequence[ua.Variant], types: Mapping[str, EventType], stamps: str = "source") -> Fact:
    """Return the event of these values as a fact. `stamps`: source, the time of the event, or server, when that had it."""
    told = {name: getattr(value, "Value", None) for name, value in zip(names, values, strict=False)}
    first, second = stamp_ms(told.get("Time")), stamp_ms(told.get("ReceiveTime"))
    if stamps == "server":
        first, second = second, first
    return _event(told, types).fact(second if first is None else first)


def _event(told: Mapping[str, object], types: Mapping[str, EventType]) -> Event:
    kind_node, condition = told.get("EventType"), _node(told.get(_CONDITION_ID))
    known = types.get(_node(kind_node))
    retain = _flag(told.get("Retain"))
    name = _text(told.get("ConditionName"))
    code = next((text for _, _, field in _CODES if (text := _text(told.get(field)))), "")
    source = _text(told.get("SourceName"))
    severity = told.get("Severity")
    kind = _kind(kind_node, known, bool(condition) or retain is not None)
    return Event(
        kind=kind,
        type_name=known.name if known else _node(kind_node),
        condition=(condition or "/".join(filter(None, (source, name, code)))) if kind is Kind.CONDITION else "",
        branch=_node(told.get("BranchId")),
        source=source,
        name=name,
        code=code,
        text=_text(told.get("Message")),
        severity=int(severity) if isinstance(severity, int) and not isinstance(severity, bool) else None,
        retain=retain,
        enabled=_flag(told.get("EnabledState/Id")),
        active=_state(told, "ActiveState"),
        acknowledged=_state(told, "AckedState"),
        since_ms=stamp_ms(told.get("ActiveState/TransitionTime")),
    )


def _kind(node: object, known: EventType | None, is_condition: bool) -> Kind:
    """Return the kind of an event. A type of the standard other than the base type is the server's talk of itself."""
    number = node.Identifier if isinstance(node, ua.NodeId) and node.NamespaceIndex == 0 else None
    if isinstance(number, int) and number in _KINDS:
        return _KINDS[number]
    if is_condition or (known is not None and known.is_condition):
        return Kind.CONDITION
    return Kind.MESSAGE if number in (None, _BASE) else Kind.SYSTEM


def _state(told: Mapping[str, object], name: str) -> bool | None:
    """Return a state with two values; SINUMERIK gives the words True and False where the standard has a flag beside the word."""
    flag = _flag(told.get(f"{name}/Id"))
    return _WORDS.get(_text(told.get(name)).lower()) if flag is None else flag


def _flag(value: object) -> bool | None:
    return value if isinstance(value, bool) else None


def _node(value: object) -> str:
    return value.to_string() if isinstance(value, ua.NodeId) and not value.is_null() else ""


def _text(value: object) -> str:
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    return str(value)[:TEXT_LENGTH_MAX] if isinstance(value, str | int) and not isinstance(value, bool) else ""
