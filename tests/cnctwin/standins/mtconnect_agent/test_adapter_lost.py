"""The adapter is lost and comes back: everything unavailable, then its present values again."""

from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent import ReplayAgent
from tests.cnctwin.standins.mtconnect_agent.small_machine import at, fetch, observations, played, values, write_machine

START_S = 1_800_000_000.0


@pytest.mark.parametrize("style", ["2.3", "1.4"])
def test_a_lost_adapter_makes_its_device_unavailable(tmp_path: Path, style: str) -> None:
    lines = [at(0, "tool|5|Xload|10"), at(1, "logic|FAULT|7|||hot"), at(2, "logic|WARNING|8|||warm")]
    with played(tmp_path, lines, style=style, now=lambda: START_S) as agent:
        agent.adapter_lost()
        text = fetch(agent, "/VMC-3/current")
    assert values(text, "tool") == values(text, "xl") == values(text, "avail") == ["UNAVAILABLE"]
    assert [o.tag for o in observations(text) if o.get("dataItemId") == "logic"] == ["Unavailable"]
    assert values(text, "cm") == ["SPINDLE"]  # it can't be anything else
    lost = {o.get("timestamp") for o in observations(text) if o.get("dataItemId") in ("tool", "logic")}
    assert lost == {"2027-01-15T08:00:00Z"}  # stamped by the agent


def test_lines_meanwhile_are_counted_and_the_machine_goes_on(tmp_path: Path) -> None:
    recording, devices = write_machine(tmp_path, [at(n, f"tool|{n}|Xload|10") for n in range(10)])
    with ReplayAgent(recording, devices, speed=0) as agent:
        agent.step(3)
        agent.adapter_lost()
        agent.step(3)
        assert agent.ledger.dropped["adapter_lost"] == 6
        assert values(fetch(agent, "/current"), "tool") == ["UNAVAILABLE"]
        agent.adapter_back()
        text = fetch(agent, "/sample?count=1000")
        agent.step(1)
        assert agent.ledger.balances
    assert values(text, "tool") == ["UNAVAILABLE", "0", "1", "2", "UNAVAILABLE", "5"]
    assert values(text, "xl") == ["UNAVAILABLE", "10", "UNAVAILABLE", "10"]
    back = [o.get("timestamp") for o in observations(text) if o.text == "5"]
    assert back == ["2024-05-01T12:00:05.5Z"]


def test_losing_it_twice_says_nothing_new(tmp_path: Path) -> None:
    agent = played(tmp_path, [at(0, "tool|5")])
    agent.adapter_lost()
    stored = agent.ledger.observations
    agent.adapter_lost()
    assert agent.ledger.observations == stored
    agent.stop()
