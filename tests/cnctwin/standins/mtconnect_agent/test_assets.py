"""Assets: what the agent keeps, shows and announces."""

from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent.assets import AssetStore, read_asset
from tests.cnctwin.standins.mtconnect_agent.small_machine import at, elements, fetch, header, observations, played, values


def tool(second: int, asset_id: str, life: int) -> str:
    return at(second, f'@ASSET@|{asset_id}|CuttingTool|<CuttingTool toolId="1"><ToolLife>{life}</ToolLife></CuttingTool>')


LINES = [
    at(0, "@REMOVE_ALL_ASSETS@|CuttingTool"),
    tool(1, "T1", 10),
    tool(2, "T2", 20),
    tool(3, "T1", 10),  # as it was
    tool(4, "T1", 11),
    at(5, "@REMOVE_ASSET@|T1"),
    at(6, "@REMOVE_ASSET@|T9"),
    at(7, "@ASSET@|T3|CuttingTool|<CuttingTool>"),
]


def test_changes_are_announced_with_id_and_type(tmp_path: Path) -> None:
    with played(tmp_path, LINES) as agent:
        text = fetch(agent, "/VMC-3/sample?count=1000")
        ledger = agent.ledger
    assert values(text, "d1_asset_chg") == ["UNAVAILABLE", "T1", "T2", "T1", "UNAVAILABLE"]
    assert values(text, "d1_asset_rem") == ["UNAVAILABLE", "T1"]
    assert {o.get("assetType") for o in observations(text) if o.tag == "AssetRemoved"} == {"UNAVAILABLE", "CuttingTool"}
    counts = [
        [(e.get("key"), e.get("removed"), e.text) for e in o]
        for o in sorted(observations(text), key=lambda o: int(o.attrib["sequence"]))
        if o.tag == "AssetCountDataSet"
    ]
    assert counts == [
        [],
        [("CuttingTool", "true", None)],
        [("CuttingTool", None, "1")],
        [("CuttingTool", None, "2")],
        [("CuttingTool", None, "1")],
    ]
    assert ledger.dropped == {"duplicate": 1, "asset_not_found": 1, "bad_asset": 1}
    assert ledger.balances


@pytest.mark.parametrize("path", ["/assets", "/asset", "/VMC-3/assets", "/assets?type=CuttingTool"])
def test_assets_are_shown_newest_first(tmp_path: Path, path: str) -> None:
    with played(tmp_path, [*LINES[:5], tool(6, "T4", 1)]) as agent:
        text = fetch(agent, path)
    tools = [e for e in elements(text) if e.tag == "CuttingTool"]
    assert [t.get("assetId") for t in tools] == ["T4", "T1", "T2"]
    assert tools[1].attrib | {"hash": ""} == {
        "assetId": "T1",
        "deviceUuid": "000",
        "timestamp": "2024-05-01T12:00:04.5Z",
        "toolId": "1",
        "hash": "",
    }
    assert tools[1][0].text == "11"
    assert header(text)["assetCount"] == "3"
    assert header(text)["assetBufferSize"] == "1024"


def test_removed_assets_are_shown_only_where_asked_for(tmp_path: Path) -> None:
    with played(tmp_path, LINES) as agent:
        plain, removed, one, none = (
            [(e.get("assetId"), e.get("removed")) for e in elements(fetch(agent, path)) if e.tag == "CuttingTool"]
            for path in ("/assets", "/assets?removed=true", "/asset/T1;T2", "/assets?type=Fixture")
        )
    assert plain == [("T2", None)]
    assert removed == [("T1", "true"), ("T2", None)]
    assert one == [("T1", "true"), ("T2", None)]
    assert none == []


def test_agent_1_4_has_no_counts_and_no_hashes(tmp_path: Path) -> None:
    with played(tmp_path, LINES, style="1.4") as agent:
        text = fetch(agent, "/VMC-3/sample?count=1000") + fetch(agent, "/assets")
    assert "AssetCount" not in text
    assert "hash=" not in text
    assert ">T2</AssetChanged>" in text


def test_beyond_the_bound_the_one_that_changed_longest_ago_goes() -> None:
    store = AssetStore(2)
    for asset_id in ("A", "B", "A", "C"):
        asset = read_asset(asset_id, "u", "t", "<Fixture/>")
        assert asset is not None
        store.put(asset)
    assert [a.id for a in store.newest_first()] == ["C", "A"]


def test_an_asset_cannot_bring_entities() -> None:
    assert read_asset("A", "u", "t", '<!DOCTYPE a [<!ENTITY x "y">]><a>&x;</a>') is None
