"""Template definitions, instances and parameters (6.4.14 and 6.4.15)."""

from dataclasses import replace
from typing import Any

import pytest

from sparkplug.codec import decode, encode, parse
from sparkplug.datatype import DataType
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.errors import PayloadError, SparkplugError
from sparkplug.metric import MetricSpec
from sparkplug.schema import PayloadMessage
from sparkplug.topics import Verb
from sparkplug.values import DataSet, Metric, Parameter, Payload, Template
from tests.sparkplug.conformance.life import AXIS, EPOCH_MS, NODE, X_AXIS, EdgeLife, HostLife, change

BASIC = [DataType(code) for code in range(DataType.INT8, DataType.TEXT + 1)]
SCALAR_FIELDS = {"int_value", "long_value", "float_value", "double_value", "boolean_value", "string_value"}
VALUES: dict[DataType, Any] = {
    DataType.FLOAT: 0.5,
    DataType.DOUBLE: 0.5,
    DataType.BOOLEAN: True,
    DataType.STRING: "Ü",
    DataType.TEXT: "Ü",
}
_TEMPLATE = PayloadMessage.DESCRIPTOR.fields_by_name["metrics"].message_type.fields_by_name["template_value"].message_type
_PARAMETER = _TEMPLATE.fields_by_name["parameters"].message_type


def _definitions(life: EdgeLife) -> list[Any]:
    return [sent.metric("Axis").template_value for sent in life.of(Verb.NBIRTH)]


def _instances(life: EdgeLife) -> list[Any]:
    births = [sent for sent in life.of(Verb.DBIRTH) if sent.topic.device == "okuma"]
    return [sent.metric("x_axis").template_value for sent in births]


def _on_the_wire(template: Template) -> Any:
    """The protobuf template inside an encoded metric."""
    data = encode(Payload(EPOCH_MS, (Metric("x", template, DataType.TEMPLATE, EPOCH_MS),)))
    return parse(data).metrics[0].template_value


def _node(instance: Template | None, definition: Template = AXIS) -> EdgeLife:
    """An edge node with one definition and one metric that is an instance of it."""
    session = EdgeNodeSession(NODE, now_ms=EPOCH_MS, templates={"Axis": definition})
    session.declare_device("okuma", [MetricSpec("x_axis", DataType.TEMPLATE, value=instance)], EPOCH_MS)
    return EdgeLife(session)


@pytest.mark.tck(
    "tck-id-payloads-template-definition-is-definition",
    "tck-id-payloads-template-is-definition-definition",
    "tck-id-payloads-template-is-definition",
)
def test_a_definition_says_that_it_is_one(life: EdgeLife) -> None:
    assert len(_definitions(life)) >= 4
    for template in _definitions(life):
        assert template.HasField("is_definition")
        assert template.is_definition is True


@pytest.mark.tck(
    "tck-id-payloads-template-instance-is-definition",
    "tck-id-payloads-template-is-definition-instance",
    "tck-id-payloads-template-is-definition",
)
def test_an_instance_says_that_it_is_no_definition(life: EdgeLife) -> None:
    assert len(_instances(life)) >= 4
    for template in _instances(life):
        assert template.HasField("is_definition")
        assert template.is_definition is False


@pytest.mark.tck("tck-id-payloads-template-definition-ref", "tck-id-payloads-template-ref-definition")
def test_a_definition_refers_to_no_template(life: EdgeLife) -> None:
    assert not any(template.HasField("template_ref") for template in _definitions(life))
    with pytest.raises(PayloadError):
        replace(AXIS, ref="Axis")


@pytest.mark.tck("tck-id-payloads-template-instance-ref", "tck-id-payloads-template-ref-instance")
def test_an_instance_refers_to_its_definition_by_name(life: EdgeLife) -> None:
    assert {template.template_ref for template in _instances(life)} == {"Axis"}
    assert life.of(Verb.NBIRTH)[0].metric("Axis").template_value.is_definition
    for missing in (None, ""):
        with pytest.raises(PayloadError):
            replace(X_AXIS, ref=missing)


@pytest.mark.tck("tck-id-payloads-template-definition-nbirth-only")
def test_definitions_stand_in_nbirths_only(life: EdgeLife, edge: EdgeLife) -> None:
    for sent in life.sent:
        definitions = [metric.name for metric in sent.payload.metrics if metric.template_value.is_definition]
        assert definitions == (["Axis"] if sent.verb is Verb.NBIRTH else [])
    with pytest.raises(PayloadError):
        edge.declare("third", (MetricSpec("axis", DataType.TEMPLATE, value=AXIS),))


@pytest.mark.tck("tck-id-payloads-template-definition-nbirth-only")
def test_a_definition_is_not_sent_as_data(edge: EdgeLife) -> None:
    with pytest.raises(PayloadError):
        edge.publish("okuma", change("x_axis", AXIS, edge.now_ms))


@pytest.mark.tck("tck-id-payloads-template-definition-nbirth")
def test_the_definition_of_every_instance_stands_in_the_nbirth_before(life: EdgeLife) -> None:
    defined: set[str] = set()
    for sent in life.of(Verb.NBIRTH, Verb.DBIRTH):
        templates = [metric for metric in sent.payload.metrics if metric.HasField("template_value")]
        if sent.verb is Verb.NBIRTH:
            defined = {metric.name for metric in templates}
        else:
            assert {metric.template_value.template_ref for metric in templates} <= defined


@pytest.mark.tck("tck-id-payloads-template-definition-nbirth")
def test_an_instance_of_a_template_that_is_not_defined_is_refused() -> None:
    with pytest.raises(SparkplugError):
        _node(replace(X_AXIS, ref="Spindle"))


@pytest.mark.tck("tck-id-payloads-template-definition-members", "tck-id-payloads-template-definition-parameters")
def test_a_definition_has_all_members_and_parameters_that_its_instances_have(life: EdgeLife) -> None:
    (definition, *_) = _definitions(life)
    assert [metric.name for metric in definition.metrics] == ["position", "load"]
    assert [parameter.name for parameter in definition.parameters] == ["letter", "stroke"]
    for instance in _instances(life):
        assert {metric.name for metric in instance.metrics} <= {"position", "load"}
        assert {parameter.name for parameter in instance.parameters} <= {"letter", "stroke"}


@pytest.mark.tck(
    "tck-id-payloads-template-instance-members",
    "tck-id-payloads-template-definition-members",
)
def test_an_instance_with_a_member_that_its_definition_has_not_is_refused() -> None:
    stranger = Metric("colour", "red", DataType.STRING, EPOCH_MS)
    with pytest.raises(SparkplugError):
        _node(replace(X_AXIS, metrics=(*X_AXIS.metrics, stranger)))


@pytest.mark.tck("tck-id-payloads-template-instance-members-birth")
def test_an_instance_that_lacks_a_member_is_not_born() -> None:
    with pytest.raises(SparkplugError):
        _node(replace(X_AXIS, metrics=X_AXIS.metrics[:1]))


@pytest.mark.tck("tck-id-payloads-template-definition-parameters")
def test_an_instance_with_a_parameter_that_its_definition_has_not_is_refused() -> None:
    stranger = Parameter("colour", DataType.STRING, "red")
    with pytest.raises(SparkplugError):
        _node(replace(X_AXIS, parameters=(stranger,)))


@pytest.mark.tck("tck-id-payloads-template-instance-members-data")
def test_an_instance_in_data_may_have_some_of_the_members(edge: EdgeLife) -> None:
    part = replace(X_AXIS, metrics=X_AXIS.metrics[:1], parameters=())
    (sent,) = edge.publish("okuma", change("x_axis", part, edge.now_ms))
    assert [metric.name for metric in sent.payload.metrics[0].template_value.metrics] == ["position"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("x_axis", replace(X_AXIS, metrics=X_AXIS.metrics[:1], parameters=())),
        ("offsets", DataSet(("tool",), (DataType.UINT8,), ((1,),))),
    ],
)
def test_a_host_reads_templates_and_datasets_from_data_too(edge: EdgeLife, host: HostLife, name: str, value: Any) -> None:
    host.connect()
    host.receive(*edge.rebirth())
    (event,) = host.receive(*edge.publish("okuma", change(name, value, edge.now_ms)))
    assert event.readings[0].value == value


@pytest.mark.tck("tck-id-payloads-template-instance-members-birth")
def test_after_a_part_of_the_members_was_sent_the_next_birth_has_all_of_them(edge: EdgeLife) -> None:
    part = replace(X_AXIS, metrics=(Metric("position", 99.0, DataType.DOUBLE, edge.now_ms),), parameters=())
    edge.publish("okuma", change("x_axis", part, edge.now_ms))
    birth = next(sent for sent in edge.rebirth() if sent.topic.device == "okuma")
    members = {metric.name: metric.double_value for metric in birth.metric("x_axis").template_value.metrics}
    assert members == {"position": 99.0, "load": 3.0}


@pytest.mark.tck("tck-id-payloads-template-definition-parameters-default")
def test_a_definition_may_have_values_for_its_parameters(life: EdgeLife) -> None:
    for template in _definitions(life):
        letter, stroke = template.parameters
        assert letter.string_value == "X"
        assert stroke.WhichOneof("value") is None


@pytest.mark.tck("tck-id-payloads-template-instance-parameters")
def test_an_instance_may_have_values_for_the_parameters(life: EdgeLife) -> None:
    for template in _instances(life):
        assert [(p.name, p.string_value) for p in template.parameters] == [("letter", "X")]


@pytest.mark.tck("tck-id-payloads-template-version")
@pytest.mark.parametrize("version", ["1.0", "", "α-2"])
def test_a_version_is_a_text(version: str) -> None:
    template = _on_the_wire(replace(AXIS, version=version))
    assert template.version == version
    assert _TEMPLATE.fields_by_name["version"].type == _TEMPLATE.fields_by_name["template_ref"].type == 9
    assert not _on_the_wire(replace(AXIS, version=None)).HasField("version")


@pytest.mark.tck(
    "tck-id-payloads-template-parameter-name-required",
    "tck-id-payloads-template-parameter-name-type",
    "tck-id-payloads-template-parameter-type-req",
)
def test_every_parameter_has_a_name_and_a_type(life: EdgeLife) -> None:
    for template in [*_definitions(life), *_instances(life)]:
        for parameter in template.parameters:
            assert parameter.name
            assert parameter.HasField("type")
    assert _PARAMETER.fields_by_name["name"].type == 9
    with pytest.raises(PayloadError):
        replace(AXIS, parameters=(Parameter("", DataType.STRING, "X"),))


@pytest.mark.tck("tck-id-payloads-template-parameter-value-type")
def test_the_type_of_a_parameter_is_an_unsigned_32_bit_number() -> None:
    assert _PARAMETER.fields_by_name["type"].type == 13


@pytest.mark.tck("tck-id-payloads-template-parameter-type-value", "tck-id-payloads-template-parameter-value")
@pytest.mark.parametrize("datatype", BASIC)
def test_a_parameter_of_a_basic_type_goes_into_a_scalar_field_and_comes_back(datatype: DataType) -> None:
    parameter = Parameter("p", datatype, VALUES.get(datatype, 7))
    field = _on_the_wire(replace(AXIS, parameters=(parameter,))).parameters[0]
    assert field.type == datatype
    assert field.WhichOneof("value") in SCALAR_FIELDS
    payload = Payload(EPOCH_MS, (Metric("x", replace(X_AXIS, parameters=(parameter,)), DataType.TEMPLATE, EPOCH_MS),))
    assert decode(encode(payload)) == payload


@pytest.mark.tck("tck-id-payloads-template-parameter-type-value")
@pytest.mark.parametrize("datatype", sorted(set(DataType) - set(BASIC) - {DataType.UUID}))
def test_a_parameter_of_any_other_type_is_refused(datatype: DataType) -> None:
    with pytest.raises(PayloadError):
        replace(AXIS, parameters=(Parameter("p", datatype, None),))


@pytest.mark.tck("tck-id-payloads-template-parameter-type-value")
def test_a_parameter_of_type_uuid_is_refused() -> None:
    with pytest.raises(PayloadError):
        replace(AXIS, parameters=(Parameter("p", DataType.UUID, "x"),))


@pytest.mark.tck("tck-id-payloads-template-dataset-value")
@pytest.mark.parametrize("datatype", BASIC)
def test_a_cell_of_a_dataset_goes_into_a_scalar_field(datatype: DataType) -> None:
    table = DataSet(("c",), (datatype,), ((VALUES.get(datatype, 7),),))
    data = encode(Payload(EPOCH_MS, (Metric("x", table, DataType.DATASET, EPOCH_MS),)))
    (element,) = parse(data).metrics[0].dataset_value.rows[0].elements
    assert element.WhichOneof("value") in SCALAR_FIELDS
