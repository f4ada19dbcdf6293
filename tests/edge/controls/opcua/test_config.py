"""The table [opcua], the maps, and the names of nodes."""

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

import edge.controls.opcua
from edge.config import EdgeConfig, SignalSection
from edge.config_file import parse
from edge.controls.opcua import library
from edge.controls.opcua.config import OpcUaConfig, points_of
from edge.controls.opcua.connection import OpcUaConnection
from edge.controls.opcua.point import maps, node_of
from edge.errors import ConfigError
from edge.signals import signal


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ('url = "http://x"', "is no opc.tcp://host:port address"),
        ('url = "opc.tcp://a:b@x:4840"', "must hold no user or password"),
        ('map = "fanuc"', "no such map; there are cnc_40502, machinetool_40501, sinumerik"),
        ('security = "None"', "is none of auto, none, or one of"),
        ('security = "Basic256:Sign"', "is none of auto, none, or one of"),
        ('server_fingerprint = "12:34"', "is no SHA-256 fingerprint"),
        ('username = "edge"', "username needs password_env"),
        ('user_certificate = "a.der"', "user_certificate and user_key belong together"),
        ("queue_size = 0", "must be 1 or more"),
        ("trust_all = true", "is not known"),
    ],
)
def test_what_cannot_be_used_is_refused_before_any_connection(line: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint) as refused:
        parse(f'[machine]\nadapter = "opcua"\n[opcua]\n{line}\n', Path("mill.toml"))
    assert "\n" not in str(refused.value)
    assert "a:b@" not in str(refused.value)


def test_a_fingerprint_may_be_written_as_any_tool_writes_it() -> None:
    plain = "ab" * 32
    assert OpcUaConfig(server_fingerprint="SHA256:" + ":".join(["AB"] * 32)).server_fingerprint == plain


@pytest.mark.parametrize("name", sorted(maps()))
def test_the_points_of_each_map_are_canonical_and_say_on_what_they_rest(name: str) -> None:
    for point in maps()[name].points:
        if point.signal != "tool":
            known = signal(point.signal.replace("{name}", "x"))
            assert set(point.words.values()) <= (known.words or set(point.words.values()))
        assert point.seen
        assert not point.node or node_of(point.node).namespace == maps()[name].namespace


def test_a_line_of_the_configuration_takes_the_place_of_the_map_and_keeps_its_words() -> None:
    own = {
        "exec_state": SignalSection(data_item="nsu=urn:plc;i=17"),
        "vibration_rms_g": SignalSection(data_item="nsu=urn:plc;s=Vib"),
    }
    points = {point.signal: point for point in points_of(EdgeConfig(source=OpcUaConfig(), signals=own))}
    assert points["exec_state"].node == "nsu=urn:plc;i=17"
    assert points["exec_state"].words["3"] == "ACTIVE"
    assert points["vibration_rms_g"].node == "nsu=urn:plc;s=Vib"
    assert points["tool_number"].node.endswith("actTNumber[u1,1]")


@pytest.mark.parametrize("text", ["ns=2;s=/Channel", "nsu=urn:x", "s=", "i=twelve", "g=123", "tool", "nsu=urn:x;i=12345678901"])
def test_a_node_that_is_none_or_hangs_on_an_index_is_refused_with_the_way_out(text: str) -> None:
    config = EdgeConfig(source=OpcUaConfig(), signals={"tool_number": SignalSection(data_item=text)})
    with pytest.raises(ConfigError, match=r"signals\.tool_number\.data_item: node .* write nsu=<namespace URI>"):
        points_of(config)


def test_the_adapter_is_there_without_the_library_and_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import edge.adapter, sys; edge.adapter.adapters(); print({'asyncua', 'cryptography', 'asyncio'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "asyncua" not in done.stdout
    assert "cryptography" not in done.stdout
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"install it with: pip install 'cnctwin\[opcua\]'"):
        OpcUaConnection(EdgeConfig(source=OpcUaConfig()))


def test_no_service_that_changes_anything_is_on_the_list_and_the_guard_refuses_it() -> None:
    class WriteRequest:
        """What the library would send."""

    with (
        pytest.raises(library.ForbiddenServiceError, match="WriteRequest is not sent"),
        library.ReadOnlyGuard().observe_request(WriteRequest()),
    ):
        pytest.fail("it was let through")
    changing = ("Write", "Call", "Add", "Delete", "Update", "Set", "Register", "Cancel", "Transfer", "Modify")
    assert {name for name in library.ALLOWED if name.startswith(changing)} == {"DeleteSubscriptionsRequest"}


def test_no_part_of_the_adapter_calls_what_writes() -> None:
    folder = Path(edge.controls.opcua.__file__).parent
    for path in folder.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute):
                assert not node.attr.startswith(
                    ("write_attr", "write_val", "set_value", "call_method", "add_nodes", "delete_nodes")
                ), path
