"""What a birth declares, and how changes are written."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sparkplug.certificate import Certificate, definition_metrics
from sparkplug.codec import decode, encode
from sparkplug.datatype import DataType
from sparkplug.errors import MetricValueError, SparkplugError, TopicError, UnknownMetricError
from sparkplug.metric import Change, MetricSpec
from sparkplug.quality import Quality
from sparkplug.values import DataSet, MetaData, Metric, Payload, PropertyValue, Template
from tests.sparkplug.everything import ALL_VALUES, DEFINITION, EDGES, INSTANCE, same

LOAD = MetricSpec(
    "load", DataType.DOUBLE, value=5.0, unit="%", low=0.0, high=200.0, properties={"axis": "S", "gear": 2, "cooled": True}
)
TOOL = MetricSpec("tool", DataType.INT32, value=-1, is_transient=True)


# A definition that has just what the instance has.
DEFINITIONS = {"Axis": replace(DEFINITION, metrics=INSTANCE.metrics, parameters=INSTANCE.parameters)}


def certificate(*specs: MetricSpec, now_ms: int = 5) -> Certificate:
    """The certificate of a device whose aliases are 1, 2, 3, …"""
    aliases = count(1)
    return Certificate("device okuma", specs, lambda _: next(aliases), now_ms, DEFINITIONS)


def written(owner: Certificate, *changes: Change) -> tuple[Metric, ...]:
    """The metrics of a data message."""
    return decode(owner.data(changes)).metrics


def declared_by(owner: Certificate) -> tuple[Metric, ...]:
    """The metrics of a birth."""
    return decode(owner.birth()).metrics


def test_a_birth_says_all_that_is_known() -> None:
    load, tool = declared_by(certificate(LOAD, TOOL))
    assert load == Metric(
        "load",
        5.0,
        DataType.DOUBLE,
        5,
        1,
        properties={
            "engUnit": PropertyValue(DataType.STRING, "%"),
            "engLow": PropertyValue(DataType.DOUBLE, 0.0),
            "engHigh": PropertyValue(DataType.DOUBLE, 200.0),
            "axis": PropertyValue(DataType.STRING, "S"),
            "gear": PropertyValue(DataType.INT64, 2),
            "cooled": PropertyValue(DataType.BOOLEAN, True),
        },
    )
    assert tool == Metric("tool", -1, DataType.INT32, 5, 2, is_transient=True)


def test_a_change_travels_as_alias_time_and_value_only() -> None:
    (metric,) = written(certificate(LOAD), Change("load", 37.5, 9))
    assert (metric.name, metric.datatype, metric.alias, metric.timestamp_ms) == (None, None, 1, 9)
    assert (metric.value, metric.properties) == (37.5, {})


def test_changes_are_written_in_the_order_of_time() -> None:
    metrics = written(certificate(LOAD, TOOL), Change("load", 1.0, 30), Change("tool", 2, 10), Change("load", 3.0, 20))
    assert [(m.alias, m.timestamp_ms) for m in metrics] == [(2, 10), (1, 20), (1, 30)]


def test_the_next_birth_carries_the_newest_value_whatever_order_the_changes_came_in() -> None:
    owner = certificate(LOAD)
    owner.note([Change("load", 2.0, 20), Change("load", 1.0, 10)])
    assert [(m.value, m.timestamp_ms) for m in declared_by(owner)] == [(2.0, 20)]


def test_history_does_not_change_the_present() -> None:
    owner = certificate(TOOL)
    owner.note([Change("tool", 7, 1, is_historical=True)])
    assert declared_by(owner)[0].value == -1
    (metric,) = written(owner, Change("tool", 7, 1, is_historical=True))
    assert metric.is_historical and metric.is_transient


def test_a_metric_without_a_value_is_not_good() -> None:
    owner = certificate(MetricSpec("load", DataType.DOUBLE))
    (born,) = declared_by(owner)
    assert born.value is None
    assert {name: p.value for name, p in born.properties.items()} == {"Quality": 0, "reason": "not known yet"}
    (metric,) = written(owner, Change("load", 37.5, 9))
    assert metric.properties == {"Quality": PropertyValue(DataType.INT32, 192)}


def test_a_first_value_may_have_its_own_time_and_quality() -> None:
    spec = MetricSpec("load", DataType.DOUBLE, value=1.0, timestamp_ms=3, quality=Quality.STALE, reason="agent gone")
    (born,) = declared_by(certificate(spec))
    assert (born.value, born.timestamp_ms) == (1.0, 3)
    assert {name: p.value for name, p in born.properties.items()} == {"Quality": 500, "reason": "agent gone"}


def test_a_quality_is_told_until_it_is_good_again_and_that_once() -> None:
    owner = certificate(LOAD)
    told = []
    for quality in (Quality.GOOD, Quality.BAD, Quality.BAD, Quality.GOOD, Quality.GOOD):
        change = Change("load", None, 1, quality)
        told.append(written(owner, change)[0].properties.get("Quality"))
        owner.note([change])
    bad, good = PropertyValue(DataType.INT32, 0), PropertyValue(DataType.INT32, 192)
    assert told == [None, bad, bad, good, None]


def test_a_birth_carries_the_quality_and_its_reason() -> None:
    owner = certificate(TOOL)
    owner.note([Change("tool", None, 8, Quality.STALE, "agent gone")])
    (metric,) = declared_by(owner)
    assert (metric.value, metric.timestamp_ms) == (None, 8)
    assert {name: p.value for name, p in metric.properties.items()} == {"Quality": 500, "reason": "agent gone"}


@given(st.sampled_from(sorted(ALL_VALUES)).flatmap(lambda t: st.tuples(st.just(t), ALL_VALUES[t])))
def test_what_is_written_as_data_is_what_the_next_birth_carries(typed: tuple[DataType, Any]) -> None:
    datatype, value = typed
    assume(datatype is not DataType.TEMPLATE)  # instances are bound to their definition, see below
    owner = certificate(MetricSpec("m", datatype))
    change = Change("m", value, 9)
    written_data = owner.data([change])
    owner.note([change])
    data = decode(written_data, lambda _name, _alias: datatype).metrics[0]
    born = declared_by(owner)[0]
    assert same(data.value, value) and same(born.value, value)


@pytest.mark.parametrize("datatype", sorted(EDGES))
def test_a_wrong_value_is_refused_before_it_is_kept(datatype: DataType) -> None:
    owner = certificate(MetricSpec("m", datatype))
    for wrong in (object(), 1j):
        with pytest.raises(MetricValueError, match="device okuma: metric 'm'"):
            owner.check([Change("m", wrong, 1)])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("datatype", "wrong"),
    [
        (DataType.INT8, 128),
        (DataType.DOUBLE, "1"),
        (DataType.STRING, "\ud800"),
        (DataType.TEMPLATE, DEFINITION),
        (DataType.TEMPLATE, Template("T", (Metric("m", 300, DataType.INT8),))),
        (DataType.DATASET, DataSet(("a",), (DataType.INT8,), ((300,),))),
        (DataType.DATASET, DataSet(("\ud800",), (DataType.INT8,), ())),
    ],
)
def test_a_wrong_first_value_is_refused_when_it_is_declared(datatype: DataType, wrong: Any) -> None:
    with pytest.raises(MetricValueError, match="device okuma: metric 'm'"):
        certificate(MetricSpec("m", datatype, value=wrong))


def test_an_instance_of_a_template_may_be_declared_a_definition_stands_apart() -> None:
    (metric,) = declared_by(certificate(MetricSpec("x", DataType.TEMPLATE, value=INSTANCE)))
    assert metric.value == INSTANCE
    metric = Metric("Axis", DEFINITION, DataType.TEMPLATE, 5, alias=7)
    assert definition_metrics({"Axis": DEFINITION}, {"Axis": 7}.__getitem__, 5) == (metric,)


def test_an_undeclared_metric_is_refused_with_those_that_are() -> None:
    owner = certificate(LOAD, TOOL)
    for use in (owner.check, lambda changes: written(owner, *changes)):
        with pytest.raises(UnknownMetricError, match="device okuma has no metric 'lod'; its birth declares load, tool"):
            use([Change("lod", 1.0, 1)])


def test_a_metric_is_declared_once_and_has_a_name() -> None:
    with pytest.raises(SparkplugError, match="'load' beside 'load'"):
        certificate(LOAD, LOAD)
    with pytest.raises(TopicError, match="needs a name"):
        MetricSpec("", DataType.INT8)


def test_a_new_declaration_keeps_the_values_of_metrics_of_the_same_type() -> None:
    older = certificate(LOAD, TOOL)
    older.note([Change("load", 40.0, 8), Change("tool", 3, 9, Quality.BAD, "debounce")])
    newer = certificate(MetricSpec("tool", DataType.INT64), LOAD, now_ms=20)
    newer.keep_values(older)
    assert [(m.name, m.value, m.timestamp_ms) for m in declared_by(newer)] == [("load", 40.0, 8), ("tool", None, 20)]


def test_metadata_travels_with_the_birth() -> None:
    metadata = MetaData(content_type="text/plain", file_name="part.nc")
    (metric,) = declared_by(certificate(MetricSpec("program", DataType.FILE, value=b"M30", metadata=metadata)))
    assert decode(encode(Payload(1, (metric,)))).metrics[0].metadata == metadata


def test_metrics_are_found_by_name_and_by_alias() -> None:
    owner = certificate(LOAD, TOOL)
    assert "load" in owner and "lod" not in owner
    assert owner.specs == (LOAD, TOOL)
    assert (owner.spec("tool"), owner.spec("lod")) == (TOOL, None)
    assert (owner.name_of(2), owner.name_of(3)) == (TOOL, None)
