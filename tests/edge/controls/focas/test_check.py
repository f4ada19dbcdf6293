"""What `edge check` and `edge discover` say of a control, on our own server."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.standins.focas_server.serve import described
from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.focas_server.shown import CodedState
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.config import EdgeConfig
from edge.config_file import parse
from edge.controls.focas.check import describe
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.draft import draft
from edge.errors import ConfigError, ConnectionLostError


@pytest.fixture
def server() -> Iterator[FocasServer]:
    with FocasServer(SimulatedControl([ControlState(exec_state="ACTIVE", program="O1701", spindle_rpm=3500.0)])) as one:
        yield one


def test_check_shows_each_signal_its_function_and_warns_that_the_protocol_is_not_published(server: FocasServer) -> None:
    rows = {row.signal: row for row in describe(EdgeConfig(source=FocasConfig(port=server.port)))}
    assert (rows["spindle_rpm"].value, rows["spindle_rpm"].unit) == (3500.0, "rev/min")
    assert rows["spindle_rpm"].source == "cnc_acts"
    assert rows["axis_z_pos_mm"].source == "cnc_rddynamic2 machine Z"
    assert str(rows["(warning)"].reason).startswith("FANUC has not published this protocol")
    assert {"tool_number", "nc_block", "program", "alarm", "feed_override_pct"} <= rows.keys()


def test_check_shows_what_the_configuration_chose_and_the_tool_in_force_over_the_real_wire() -> None:
    tool = CodedState(exec_state="ACTIVE", program="O1701", t_code=2, h_code=2, alarm=(1005, "DOOR OPEN"))
    text = """
[machine]
adapter = "focas"
[focas]
port = {port}
[variables]
part_width = {{ address = "#500", unit = "mm" }}
vacant = {{ address = "#510" }}
[plc]
spindle_tool = {{ address = "D100:2" }}
changing = {{ address = "R100.0", kind = "flag" }}
"""
    with FocasServer(SimulatedControl([tool]), described()) as server:
        config = parse(text.format(port=server.port), Path("edge.toml"))
        rows = {row.signal: row for row in describe(config)}
    shown = {name: (row.value, row.unit) for name, row in rows.items()}
    assert shown["tool_length_mm"] == (135.0, "mm")
    assert shown["tool_length_wear_mm"] == (-0.02, "mm")
    assert shown["tool_radius_mm"] == (None, "mm")
    assert rows["tool_radius_mm"].reason == "no offset is in force: D 0"
    assert shown["operator_message"] == ("CHECK COOLANT LEVEL", "")
    assert str(shown["program_comment"][0]).startswith("BASE PLATE")
    assert json.loads(str(shown["alarms"][0]))[0]["code"] == "EX1005"
    assert (shown["variable_part_width"], shown["plc_changing"]) == ((80.0, "mm"), (False, ""))
    assert rows["variable_vacant"].reason == "unavailable: the variable is vacant"


UNREAD = ("alarm_history", "tool_life_used_min", "tool_life_limit_min", "tool_life_used_count", "tool_life_limit_count")


@pytest.mark.parametrize("signal", UNREAD)
def test_what_only_the_library_can_read_is_a_null_that_says_the_way_out(server: FocasServer, signal: str) -> None:
    rows = {row.signal: row for row in describe(EdgeConfig(source=FocasConfig(port=server.port)))}
    assert (rows[signal].value, rows[signal].source) == (None, "none")
    assert rows[signal].reason == (
        'only by FANUC\'s own library: set focas.backend = "library" and focas.library (docs/how-to/edge-focas.md)'
    )


def test_a_group_that_is_left_out_or_a_signal_that_is_not_published_is_not_there_as_a_null_either(server: FocasServer) -> None:
    text = f"""
[machine]
adapter = "focas"
[focas]
port = {server.port}
groups = ["alarms"]
[signals.tool_life_used_min]
publish = false
"""
    shown = {row.signal for row in describe(parse(text, Path("edge.toml")))}
    assert {"alarm_history", "tool_life_used_min"} & shown == set()
    assert "tool_life_limit_min" in shown


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('[plc]\nx = { address = "Q100" }', "plc.x.address: 'Q100' is no PMC address; write R100"),
        ('[variables]\nx = { address = "R1" }', "variables.x.address: 'R1' is no macro variable; write #500"),
        ('[plc]\nX = { address = "R100" }', "plc.X"),
        ('[plc]\nx = { address = "R1.0", kind = "flag", unit = "bar" }', "is a flag with a unit or a scale"),
    ],
)
def test_an_address_or_name_that_cannot_be_is_refused_before_any_connection(table: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(f'[machine]\nadapter = "focas"\n{table}\n', Path("edge.toml"))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_check_shows_what_the_control_refuses(server: FocasServer) -> None:
    server.faults.failing = {(1, 0x40): 6}
    rows = {row.signal: row for row in describe(EdgeConfig(source=FocasConfig(port=server.port)))}
    assert rows["spindle_load_pct"].value is None
    assert str(rows["spindle_load_pct"].reason).startswith("EW_NOOPT (6)")


def test_a_draft_can_be_used_as_it_is(server: FocasServer) -> None:
    server.faults.failing = {(1, 0x40): 6}
    text = draft(server.url, "vmc 1")
    config = parse(text, Path("edge.toml"))
    assert (config.machine.name, config.source.port, config.source.host) == ("vmc-1", server.port, "127.0.0.1")
    assert "# 31i-M series" in text
    assert "#   spindle_load_pct: EW_NOOPT (6)" in text
    assert f"#   {', '.join(UNREAD)}: only by FANUC's own library" in text
    assert {row.signal for row in describe(config)} >= {"spindle_rpm", "exec_state"}


@pytest.mark.parametrize("url", ["http://host", "focas://", "focas://host:99999", "focas://host/path", "host"])
def test_an_address_that_is_none_is_refused(url: str) -> None:
    with pytest.raises(ConfigError, match="write it as focas:"):
        draft(url)


def test_nobody_there_is_one_line_with_the_way_out(server: FocasServer) -> None:
    server.stop()
    with pytest.raises(ConnectionLostError) as caught:
        draft(server.url)
    assert "EW_SOCKET (-16)" in str(caught.value)
    assert "is the control on" in str(caught.value)
