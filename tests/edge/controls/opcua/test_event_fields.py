"""The values of an event's fields become an event, whatever of them a server has."""

from datetime import UTC, datetime
from typing import Any

import pytest

pytest.importorskip("asyncua")

from asyncua import ua
from asyncua.ua.attribute_ids import AttributeIds

from edge.controls.opcua.event import Event, Kind
from edge.controls.opcua.event_fields import CNC, MACHINE_TOOL, EventType, as_fact, fields_for

CNC_ALARM, ALERT, NOTE = (ua.NodeId(ua.Int32(number), ua.Int16(index)) for number, index in ((1006, 2), (10, 3), (11, 3)))
TYPES = {
    kind.node.to_string(): kind
    for kind in (
        EventType(CNC_ALARM, "CncAlarmType", CNC, True),
        EventType(ALERT, "AlertType", MACHINE_TOOL, True),
        EventType(NOTE, "NotificationEventType", MACHINE_TOOL, False),
    )
}
NAMESPACES = ["http://opcfoundation.org/UA/", "urn:server", CNC, MACHINE_TOOL]
CONDITION = ua.NodeId(ua.String("25201.1"), ua.Int16(2))


def read(**told: Any) -> Event:
    """The event of these values, the others null; "Id" stands for the node of the condition."""
    names = fields_for(TYPES, NAMESPACES).names
    values = {name.replace("_", "/") if name != "Id" else "": value for name, value in told.items()}
    assert values.keys() <= set(names)
    event = Event.read(as_fact(names, [ua.Variant(values.get(name)) for name in names], TYPES))
    assert event is not None
    return event


def test_a_server_is_asked_for_the_standards_fields_and_for_the_numbers_of_the_models_that_it_has() -> None:
    fields = fields_for(TYPES, NAMESPACES)
    paths = ["/".join(f"{name.NamespaceIndex}:{name.Name}" for name in one.BrowsePath) for one in fields.clauses]
    assert {"0:Message", "0:AckedState/0:Id", "0:ActiveState/0:TransitionTime"} < set(paths)
    assert paths[-3:] == ["2:AlarmIdentifier", "3:ErrorCode", "3:Identifier"]
    assert fields.clauses[-3].TypeDefinitionId == CNC_ALARM
    (condition,) = (one for one, path in zip(fields.clauses, paths, strict=True) if not path)
    assert condition.AttributeId == AttributeIds.NodeId
    assert condition.TypeDefinitionId == ua.NodeId(ua.Int32(2782))
    without = fields_for({}, NAMESPACES[:2])
    assert "AlarmIdentifier" not in without.names
    assert "Retain" not in fields_for(TYPES, NAMESPACES, simple=True).names


def test_an_alarm_of_40502_has_its_number_text_severity_and_states() -> None:
    event = read(
        EventType=CNC_ALARM, Id=CONDITION, SourceName="NCK", ConditionName="SystemCondition", Retain=True, Severity=1000,
        Message=ua.LocalizedText("Axis X drive fault"), AlarmIdentifier="25201", ActiveState_Id=True, AckedState_Id=False,
        ActiveState_TransitionTime=datetime(1970, 1, 1, 0, 0, 7, tzinfo=UTC),
    )  # fmt: skip
    assert event == Event(
        Kind.CONDITION, "CncAlarmType", "ns=2;s=25201.1", "", "NCK", "SystemCondition", "25201", "Axis X drive fault", 1000,
        retain=True, active=True, acknowledged=False, since_ms=7_000,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("word", "state"), [("True", True), ("False", False), ("Acknowledged", True), ("quittiert", None), ("", None)]
)
def test_a_state_may_come_as_a_word_alone_as_a_sinumerik_gives_it(word: str, state: bool | None) -> None:
    assert read(EventType=CNC_ALARM, Id=CONDITION, AckedState=ua.LocalizedText(word)).acknowledged is state


@pytest.mark.parametrize(
    ("told", "kind", "code"),
    [
        ({"EventType": ALERT, "Retain": True, "ErrorCode": "E7"}, Kind.CONDITION, "E7"),
        ({"EventType": NOTE, "Identifier": "M12"}, Kind.MESSAGE, "M12"),
        ({"EventType": ua.NodeId(ua.Int32(2041))}, Kind.MESSAGE, ""),
        ({"EventType": ua.NodeId(ua.Int32(2052))}, Kind.SYSTEM, ""),  # AuditEventType
        ({"EventType": ua.NodeId(ua.Int32(2787))}, Kind.REFRESH_START, ""),
        ({"EventType": ua.NodeId(ua.Int32(2788))}, Kind.REFRESH_END, ""),
        ({"EventType": ua.NodeId(ua.Int32(2789))}, Kind.REFRESH_REQUIRED, ""),
        ({"EventType": ua.NodeId(ua.Int32(3035))}, Kind.OVERFLOW, ""),
        ({"EventType": ua.NodeId(ua.Int32(99), ua.Int16(7)), "Retain": False}, Kind.CONDITION, ""),  # a type that is not known
        ({}, Kind.MESSAGE, ""),
    ],
)
def test_the_kind_is_that_of_its_type_or_of_the_fields_that_it_has(told: dict[str, Any], kind: Kind, code: str) -> None:
    event = read(**told)
    assert (event.kind, event.code) == (kind, code)


def test_a_condition_without_a_node_is_known_by_its_source_name_and_number() -> None:
    first = read(EventType=ALERT, Retain=True, SourceName="PLC", ConditionName="Low", ErrorCode="E7")
    assert first.condition == "PLC/Low/E7"


def test_values_of_other_types_than_they_should_be_are_left_out() -> None:
    event = read(EventType="none", Id=5, Severity="high", Retain="yes", Message=7.5, ActiveState_Id=1, SourceName=None)
    assert event == Event(Kind.MESSAGE)
    assert Event.read(as_fact(("Time",), (), TYPES)) == Event(Kind.MESSAGE)


@pytest.mark.parametrize(("stamps", "at_ms"), [("source", 1_000), ("server", 2_000)])
def test_the_time_is_that_of_the_event_or_that_of_the_server_as_configured(stamps: str, at_ms: int) -> None:
    values = ua.Variant(datetime(1970, 1, 1, 0, 0, 1, tzinfo=UTC)), ua.Variant(datetime(1970, 1, 1, 0, 0, 2, tzinfo=UTC))
    assert as_fact(("Time", "ReceiveTime"), values, TYPES, stamps).t_ms == at_ms
    assert as_fact(("Time",), values[:1], TYPES, "server").t_ms == 1_000
    assert as_fact((), (), TYPES).t_ms is None
