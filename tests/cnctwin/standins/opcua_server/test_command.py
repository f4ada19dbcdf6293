"""The simulated control behind OPC UA, as a program: asked by the library's own client, without any code of the edge."""

import asyncio
import importlib.util
import json
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

pytest.importorskip("asyncua")

from asyncua import ua
from asyncua.client.client import Client

from cnctwin.errors import ApplicationError
from cnctwin.standins.opcua_server.serve import simulate_opcua
from cnctwin.standins.opcua_server.shown import ADDRESSES, MODELS, TOOLS, shown
from cnctwin.standins.simulated_control.state import ControlState
from edge.chosen import Chosen
from edge.controls.opcua.address import node_of_address
from edge.controls.opcua.point import maps

TOOL = "/Channel/State/actTNumber[u1,1]"


@pytest.fixture(scope="module")
def state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file in which the program says where it is."""
    file, stop = tmp_path_factory.mktemp("simulate") / "state.json", threading.Event()
    options = {"speed": 40.0, "port": 0, "clock_offset_s": 100.0, "is_open": True, "state_file": file}
    program = threading.Thread(target=simulate_opcua, args=(stop,), kwargs=options)
    program.start()
    deadline_s = time.monotonic() + 60.0
    while not file.exists():
        assert program.is_alive()
        assert time.monotonic() < deadline_s
        time.sleep(0.05)
    yield file
    stop.set()
    program.join(timeout=60.0)
    assert not program.is_alive()


def written(file: Path, count: int) -> bool:
    """Return whether so many writes of clients have been counted, in a while."""
    deadline_s = time.monotonic() + 60.0
    while json.loads(file.read_text())["writes"] != count:
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.05)
    return True


def test_it_shows_the_tool_with_the_controls_own_time_and_all_models(state: Path) -> None:
    async def look() -> tuple[list[str], list[ua.DataValue]]:
        async with Client(json.loads(state.read_text())["url"]) as client:
            namespaces = await client.get_namespace_array()
            node = client.get_node(ua.NodeId(TOOL, namespaces.index("SinumerikVarProvider")))
            seen = []
            while {value.Value.Value for value in seen if value.Value} < {0, 1}:  # a tool change, within seconds at this speed
                seen.append(await node.read_data_value())
                await asyncio.sleep(0.02)
            return namespaces, seen

    namespaces, seen = asyncio.run(asyncio.wait_for(look(), 120.0))
    assert set(MODELS.values()) <= set(namespaces)
    stamps = [value.SourceTimestamp for value in seen]
    assert all(stamp is not None for stamp in stamps)
    ahead_s = (stamps[-1].replace(tzinfo=UTC) - datetime.now(UTC)).total_seconds()
    assert 90.0 < ahead_s < 90.0 + 40.0 * 120.0


def test_who_writes_or_calls_is_counted(state: Path) -> None:
    """So a count of nought elsewhere says something."""

    async def disturb() -> list[str]:
        refusals = []
        async with Client(json.loads(state.read_text())["url"]) as client:
            index = (await client.get_namespace_array()).index("SinumerikVarProvider")
            try:
                await client.get_node(ua.NodeId(TOOL, index)).write_value(ua.Variant(7, ua.VariantType.UInt16))
            except ua.UaStatusCodeError as error:
                refusals.append(type(error).__name__)
        return refusals

    assert written(state, 0)
    assert asyncio.run(disturb()) == ["BadUserAccessDenied"]
    assert written(state, 1)


def test_what_is_shown_is_what_the_maps_read() -> None:
    served = {one.identifier for one in shown() if one.identifier}
    names = {point.node_for(tool).partition(";s=")[2] for point in maps()["sinumerik"].points for tool in TOOLS}
    chosen = (Chosen("chosen", text, is_plc=text != "R10") for text in ADDRESSES)
    by_address = {node_of_address(one).partition(";s=")[2] for one in chosen}
    assert served == names | by_address
    assert {name: known.namespace for name, known in maps().items()} == MODELS


def test_a_value_is_shown_for_each_state_that_a_control_may_be_in() -> None:
    for one in shown():
        for execution in ("READY", "ACTIVE", "FEED_HOLD", "PROGRAM_COMPLETED"):
            value = one.value(ControlState(exec_state=execution, alarm=(700012, "coolant low")))
            assert isinstance(value, str | int | float | list)


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ApplicationError, match=r"install it with: pip install 'cnctwin\[opcua\]'"):
        simulate_opcua(threading.Event())
