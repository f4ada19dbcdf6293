"""The example flow for Node-RED: whole, made of nodes that every Node-RED has, and without a secret or an address of ours."""

import json
from pathlib import Path
from typing import Any

from twin.vocabulary import topics

FLOWS = Path(__file__).parents[2] / "deploy" / "node-red" / "flows.json"
CORE = {"tab", "mqtt-broker", "mqtt in", "function", "switch", "delay", "debug", "http in", "http response"}


def nodes() -> dict[str, dict[str, Any]]:
    """All nodes by id."""
    found = json.loads(FLOWS.read_text(encoding="utf-8"))
    by_id = {node["id"]: node for node in found}
    assert len(by_id) == len(found)
    return by_id


def test_every_wire_ends_at_a_node_and_every_node_is_one_that_node_red_brings() -> None:
    known = nodes()
    assert {node["type"] for node in known.values()} == CORE
    for node in known.values():
        assert len(node.get("wires", [])) == int(node.get("outputs", len(node.get("wires", []))))
        assert {end for output in node.get("wires", []) for end in output} <= set(known)
        assert node.get("z", "cnctwin-tab") in known


def test_it_reads_the_mirror_and_publishes_nothing() -> None:
    (reader,) = [node for node in nodes().values() if node["type"] == "mqtt in"]
    assert reader["topic"] == f"{topics.MIRROR}#"
    assert reader["datatype"] == "json"
    assert nodes()[reader["broker"]]["broker"] == "${CNCTWIN_BROKER_HOST}"


def test_there_is_no_credential_in_it() -> None:
    assert not [node for node in nodes().values() if "credentials" in node or {"user", "password"} & set(node)]
