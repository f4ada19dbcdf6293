"""What a server shows of itself: models that are known, units, a configuration to begin with."""

import asyncio
from pathlib import Path

import pytest

pytest.importorskip("asyncua")

from asyncua import ua

from cnctwin.standins.opcua_server.alarms import ShownAlarm
from cnctwin.standins.simulated_control.state import ControlState
from edge.config_file import parse
from edge.controls.opcua import resolve, session
from edge.controls.opcua.check import describe
from edge.controls.opcua.draft import draft
from edge.controls.opcua.point import node_of
from edge.errors import ConfigError
from tests.edge.controls.opcua.conftest import Bench


def address(bench: Bench) -> str:
    return f"{bench.server.url}?server_fingerprint={bench.server.fingerprint}&certificate_folder={bench.folder}/edge"


def rows(bench: Bench, **source: object) -> dict[str, object]:
    return {row.signal: row.value if row.reason is None else row.reason for row in describe(bench.config(**source))}


def test_what_follows_40502_is_found_by_its_types_whatever_its_nodes_are_called(bench: Bench) -> None:
    bench.show(
        ControlState(tool_number=4, exec_state="ACTIVE", line=12, block="G1 X5.", axis_pos_mm=(1.5, 2.5, 3.5), spindle_rpm=900.0)
    )
    found = rows(bench, map="cnc_40502")
    wanted = {
        "tool_number": 4,
        "exec_state": "ACTIVE",
        "nc_line": 12,
        "nc_block": "G1 X5.",
        "axis_y_pos_mm": 2.5,
        "spindle_rpm": 900.0,
    }
    assert wanted.items() <= found.items()
    assert found["spindle_rpm_cmd"] == "the server has no S1/CmdSpeed"
    assert not any(name.endswith("pos_deg") for name in found)


def test_what_follows_40501_tells_the_tool_by_its_place(bench: Bench) -> None:
    bench.show(ControlState(tool_number=2, exec_state="ACTIVE", mode="MANUAL"))
    found = rows(bench, map="machinetool_40501")
    assert {"tool_number": 2, "exec_state": "ACTIVE", "controller_mode": "MANUAL"}.items() <= found.items()
    assert rows(bench, map="machinetool_40501", spindle_place="99")["tool_number"] == 2
    assert rows(bench, map="machinetool_40501", spindle_place="turret")["tool_number"] == "empty"


def test_a_channel_that_is_not_there_is_said_to_be_missing(bench: Bench) -> None:
    found = rows(bench, map="cnc_40502", channel="Channel9")
    assert found["tool_number"] == "the server has no object of type CncChannelType"
    assert found["spindle_rpm"] == 0.0


def test_a_drafted_configuration_loads_and_shows_the_control_in_true_units(bench: Bench, tmp_path: Path) -> None:
    bench.show(ControlState(tool_number=4, feed_mm_min=1500.0))
    text = draft(address(bench), 'M"1')
    assert "# It is a SINUMERIK 828D, 840D sl, ONE: 25 of 25 signals, mapped below" in text
    assert "# It follows OPC 40501-1, machine tools: 9 of 9 signals" in text
    config = parse(text.replace("[opcua]", f'[opcua]\ncertificate_folder = "{bench.folder}/edge"'), tmp_path / "mill.toml")
    assert config.machine.name == 'M"1'
    assert '[broker]\nurl = "mqtt://127.0.0.1:1883"\n' in text, "as in the drafts of the other controls"
    assert config.source.map == "sinumerik", "what a control calls its own is more than a model that it follows besides"
    assert config.source.server_fingerprint == bench.server.fingerprint
    assert {row.signal: row.value for row in describe(config)}["feed_mm_min"] == 1500.0


def test_without_tools_of_its_own_a_control_is_drafted_by_the_model_that_knows_them_in_true_units(
    bench: Bench, tmp_path: Path
) -> None:
    bench.show(ControlState(tool_number=4, feed_mm_min=1500.0))
    bench.server.set_status("/Channel/State/actTNumber[u1,1]", "BadNotReadable")
    text = draft(address(bench), "mill")
    config = parse(text.replace("[opcua]", f'[opcua]\ncertificate_folder = "{bench.folder}/edge"'), tmp_path / "mill.toml")
    assert config.source.map == "cnc_40502"
    assert {row.signal: row.value for row in describe(config)}["feed_mm_min"] == 1500.0
    assert config.signals["feed_mm_min"].native_unit == "METER/MINUTE"


def test_a_draft_says_where_alarms_come_from_and_which_are_there(bench: Bench) -> None:
    bench.server.set_alarms(ShownAlarm("700012", "Coolant\nlow", 500, acknowledged=False))
    lines = draft(address(bench), "mill").splitlines()
    assert "# Alarms: events of nsu=SinumerikVarProvider;s=Sinumerik, 1 now" in lines
    assert any(line.startswith("#   700012: Coolant low, severity 500, active, not acknowledged") for line in lines)


def test_an_address_may_say_how_to_get_in_and_what_it_says_is_checked(bench: Bench) -> None:
    text = draft(f"{bench.server.url}?security=none", "")
    assert 'security = "none"  # nothing is encrypted' in text
    with pytest.raises(ConfigError, match="is not known"):
        draft(f"{bench.server.url}?trust=all", "")


def test_browsing_is_bounded_and_names_can_be_written_into_a_configuration(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    async def seen() -> tuple[list[resolve.BrowsedNode], list[str]]:
        async with session.opened(bench.config(security="none")) as client:
            namespaces = await client.get_namespace_array()
            return await resolve.browse(client, namespaces, ""), namespaces

    found, namespaces = asyncio.run(seen())
    names = [resolve.name_of(one.node, namespaces) for one in found if one.is_variable]
    assert "nsu=SinumerikVarProvider;s=/Channel/State/actTNumber[u1,1]" in names
    assert all(resolve.node_id(node_of(name), namespaces) is not None for name in names)
    monkeypatch.setattr(resolve, "NODES_MAX", 10)
    assert len(asyncio.run(seen())[0]) == 10
    monkeypatch.setattr(resolve, "BROWSE_S_MAX", 0.0)
    assert asyncio.run(seen())[0] == []


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("i=2258", "i=2258"),
        ("nsu=urn:x;i=7", "ns=1;i=7"),
        ("nsu=urn:x;s=a;b=c", "ns=1;s=a;b=c"),
        ("nsu=urn:x;g=72962B91-FA75-4AE6-8D28-B404DC7DAF63", "ns=1;g=72962b91-fa75-4ae6-8d28-b404dc7daf63"),
        ("nsu=urn:unknown;i=7", None),
    ],
)
def test_nodes_of_each_kind_are_found_by_their_namespace(name: str, expected: str | None) -> None:
    node = resolve.node_id(node_of(name), ["http://opcfoundation.org/UA/", "urn:x"])
    assert (None if node is None else node.to_string()) == expected
    if node is not None and node.NodeIdType is not ua.NodeIdType.Guid:
        assert resolve.name_of(node, ["", "urn:x"]) == name
