"""What a control keeps of the tool in the spindle, and what is read by its address."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("asyncua")

from cnctwin.standins.opcua_server.shown import CNC
from cnctwin.standins.simulated_control.state import ControlState
from edge.chosen import Chosen, PlcSection, VariableSection
from edge.config import EdgeConfig
from edge.controls.opcua import tool_reader
from edge.controls.opcua.address import node_of_address
from edge.controls.opcua.check import describe
from edge.controls.opcua.config import OpcUaConfig
from edge.controls.opcua.cursor import parse, start
from edge.controls.opcua.tool_life import LifeEntry, life_fact
from edge.errors import ConfigError
from edge.sweep import Fact, Sweep
from tests.edge.controls.opcua.conftest import NOW_S, Bench
from tests.edge.controls.opcua.test_connection import reading


def test_geometry_wear_and_life_are_those_of_the_tool_in_the_spindle_and_follow_it(bench: Bench) -> None:
    bench.show(ControlState(tool_number=3, part_count=30))
    with reading(bench.config()) as reader:
        first = reader.until(lambda one: bool(one.samples))
        found = {s.signal: s.value for s in first.samples if s.signal.startswith("tool_")}
        assert found == {
            "tool_number": 3, "tool_length_mm": 130.0, "tool_radius_mm": 6.0, "tool_length_wear_mm": -0.03,
            "tool_radius_wear_mm": -0.006, "tool_life_limit_min": 60.0, "tool_life_used_min": 0.0,
            "tool_life_limit_count": 200, "tool_life_used_count": 30,
        }  # fmt: skip
        bench.show(ControlState(tool_number=0, part_count=30))
        gone = reader.until(lambda one: any(s.signal == "tool_length_mm" for s in one.samples))
        assert {s.reason for s in gone.samples if s.signal.startswith("tool_l")} == {tool_reader.NO_TOOL}
        changed_ms = round((NOW_S + bench.machine_s) * 1000)
        assert {s.timestamp_ms for s in gone.samples if s.signal.startswith("tool_l")} == {changed_ms}, "in the control's time"
        bench.show(ControlState(tool_number=5, part_count=30))
        fifth = reader.until(lambda one: any(s.signal == "tool_length_mm" and s.value == 150.0 for s in one.samples))
        assert all(s.timestamp_ms > changed_ms for s in fifth.samples if s.signal.startswith("tool_l"))
        life = {s.signal: s.reason for s in fifth.samples if s.signal.startswith("tool_life")}
        assert life["tool_life_limit_min"] == "limit 0: not monitored at the control"
        assert life["tool_life_used_min"] == "the control tells what is left, 0, and no limit"


def test_a_tools_life_is_read_again_while_it_cuts(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool_reader, "READ_S", 0.2)
    with reading(bench.config()) as reader:
        reader.until_value("tool_life_used_count", 0)
        bench.show(ControlState(tool_number=3, part_count=7))
        reader.until_value("tool_life_used_count", 7)


def test_parameters_and_plc_addresses_are_read_by_configuration_in_its_units(bench: Bench) -> None:
    bench.show(ControlState(part_count=12, coolant_on=True))
    config = EdgeConfig(
        source=bench.config().source,
        variables={"parts": VariableSection(address="R10"), "none": VariableSection(address="nsu=urn:vendor;i=7")},
        plc={
            "coolant_pressure": PlcSection(address="DB100.DBW2", unit="bar", scale=0.1),
            "coolant": PlcSection(address="M5.0", kind="flag"),
            "no_such": PlcSection(address="DB9.DBB1"),
        },
    )
    rows = {row.signal: (row.value, row.unit, row.reason) for row in describe(config)}
    assert rows["variable_parts"] == (12.0, "", None)
    assert rows["variable_none"] == (None, "", "the server has no namespace urn:vendor")
    assert rows["plc_coolant_pressure"] == (4.5, "bar", None)
    assert rows["plc_coolant"] == (True, "", None)
    assert rows["plc_no_such"] == (None, "", "BadNodeIdUnknown")


def test_the_unit_that_the_server_states_is_converted_to_the_one_that_is_wanted_or_refuses_it(bench: Bench) -> None:
    bench.show(ControlState(feed_mm_min=1500.0))
    (feed,) = [node for one, node in bench.server._nodes.items() if one.path[-1] == "ActFeedrate"]  # in m/min
    address = f"nsu={CNC};i={feed.Identifier}"
    config = EdgeConfig(
        source=bench.config().source,
        variables={
            "feed": VariableSection(address=address, unit="mm/s"),
            "as_stated": VariableSection(address=address),
            "scaled": VariableSection(address=address, unit="bar", scale=2.0),
            "wrong": VariableSection(address=address, unit="bar"),
        },
    )
    rows = {row.signal: (row.value, row.unit, row.native_unit) for row in describe(config)}
    assert rows["variable_feed"] == (25.0, "mm/s", "m/min")
    assert rows["variable_as_stated"] == (1.5, "", "m/min")
    assert rows["variable_scaled"] == (3.0, "bar", "m/min"), "a scale says that the configuration knows better"
    why = "variables.wrong.unit = 'bar': the control says otherwise: m/min is a speed and bar a pressure; "
    why += "correct it, or add a scale"
    with reading(config) as reader:
        first = {s.signal: (s.value, s.reason) for s in reader.until(lambda one: bool(one.samples)).samples}
    assert (first["variable_feed"], first["variable_wrong"]) == ((25.0, None), (None, why))


@pytest.mark.parametrize(
    ("address", "is_plc", "node"),
    [
        ("R10", False, "nsu=SinumerikVarProvider;s=/Channel/Parameter/R[u1,10]"),
        ("/Channel/Parameter/R[u2,56]", False, "nsu=SinumerikVarProvider;s=/Channel/Parameter/R[u2,56]"),
        ("DB5.DBX2.7", True, "nsu=SinumerikVarProvider;s=/Plc/DB5.DBX2.7"),
        ("DB2.DBD0:REAL", True, "nsu=SinumerikVarProvider;s=/Plc/DB2.DBD0:REAL"),
        ("MB6", True, "nsu=SinumerikVarProvider;s=/Plc/MB6"),
        ("i=2258", True, "i=2258"),
        ("R0", False, None),  # the server counts from 1
        ("R10", True, None),
        ("DB5.DBW2", False, None),
        ("DB5.DBX2.8", True, None),
        ("DB8.DBW2:[10]", True, None),
        ("ns=2;s=/Plc/MB6", True, None),
    ],
)
def test_an_address_is_a_node_or_refused_with_the_way_out(address: str, is_plc: bool, node: str | None) -> None:
    chosen = Chosen("plc_x" if is_plc else "variable_x", address, is_plc=is_plc)
    if node is not None:
        assert node_of_address(chosen) == node
        return
    with pytest.raises(ConfigError, match="is no address; write nsu=<namespace URI>"):
        node_of_address(chosen)


@pytest.mark.parametrize(
    ("limit", "left", "used"),
    [
        (60.0, 45.0, 15.0),
        (60.0, 60.0, 0.0),
        (60.0, 0.0, 60.0),
        (60.0, -3.0, 63.0),  # past its end, and still in use
        (0.0, 0.0, "the control tells what is left, 0, and no limit"),
        (60.0, 61.0, "the control tells what is left, 61, which is more than the limit of 60"),
        (None, 45.0, "the control tells what is left, 45, and no limit"),
    ],
)
def test_what_is_left_of_a_life_is_told_as_what_was_used(limit: float | None, left: float, used: object) -> None:
    facts = Fact("tool_life_limit_min", limit, "" if limit is not None else "BadNodeIdUnknown"), Fact("tool_life_used_min", left)
    config = EdgeConfig(source=OpcUaConfig())
    _, one = parse(config, start(config), Sweep("a", 0, 1_000, facts).encode())
    assert one.accounted()
    (sample,) = (s for s in one.samples if s.signal == "tool_life_used_min")
    assert (sample.reason if sample.value is None else sample.value) == used


def test_a_tools_life_is_found_where_a_machine_follows_40501_in_hours_that_are_left_or_parts_that_were_made(bench: Bench) -> None:
    bench.show(ControlState(tool_number=3, part_count=25))
    with reading(bench.config(map="machinetool_40501")) as reader:
        reader.until_value("tool_life_used_min", 15.0)
        bench.show(ControlState(tool_number=2, part_count=25))
        other = reader.until(lambda one: any(s.signal == "tool_life_used_count" for s in one.samples))
        found = {s.signal: s.reason if s.value is None else s.value for s in other.samples if s.signal.startswith("tool_life")}
        assert found == {
            "tool_life_limit_count": 200,
            "tool_life_used_count": 25,
            "tool_life_limit_min": "the control keeps no such life of this tool",
            "tool_life_used_min": "the control keeps no such life of this tool",
        }
    rows = {row.signal: row.value for row in describe(bench.config(map="machinetool_40501"))}
    assert (rows["tool_life_limit_count"], rows["tool_life_used_count"]) == (200, 25)


@pytest.mark.parametrize(
    ("entry", "limit", "used"),
    [
        (LifeEntry(0, False, 0.75, 1.0, 0.0, "h"), 60.0, 15.0),
        (LifeEntry(0, False, 0.75, 1.0, None, ""), 60.0, 15.0),
        (LifeEntry(0, True, 30.0, 0.0, 90.0, "min"), 90.0, 30.0),
        (LifeEntry(0, True, 30.0, None, None, "min"), "the control tells no limit", 30.0),
        (LifeEntry(1, True, 12.0, None, 200.0), 200, 12),
        (LifeEntry(2, False, 12.0, 200.0, 0.0), 200, 188),
        (LifeEntry(2, True, 12.5, None, 200.0), 200, "not a whole number: 12.5"),
        (LifeEntry(1, False, 12.0, None, 0.0), *["the control tells what is left, and not where it began"] * 2),
        (LifeEntry(3, True, 12.0, None, 200.0, "mm"), None, None),  # a distance, for which there is no signal
    ],
)
def test_a_life_of_40501_counts_up_or_down_in_its_unit(entry: LifeEntry, limit: object, used: object) -> None:
    kind = "min" if entry.indication == 0 else "count"
    config = EdgeConfig(source=OpcUaConfig(map="machinetool_40501"))
    _, one = parse(config, start(config), Sweep("a", 0, 1_000, (life_fact([entry]),)).encode())
    assert one.accounted()
    found = {s.signal: s.reason if s.value is None else s.value for s in one.samples}
    assert found == ({} if used is None else {f"tool_life_limit_{kind}": limit, f"tool_life_used_{kind}": used})


@given(
    st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=3), lambda c: st.lists(c, max_size=6), max_leaves=9)
)
def test_a_life_that_is_none_gives_nothing(junk: object) -> None:
    config = EdgeConfig(source=OpcUaConfig(map="machinetool_40501"))
    _, one = parse(config, start(config), Sweep("a", 0, 1_000, (Fact("tool_life", json.dumps(junk)),)).encode())
    assert one.accounted()
    assert one.error is None
