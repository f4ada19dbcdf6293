"""Recordings and device models: which device, which pace, drafts, dirt, and what is refused."""

import time
from itertools import pairwise
from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent import DeviceModelError, RecordingError, ReplayAgent, ReplayError
from cnctwin.standins.mtconnect_agent.recording import Recording
from cnctwin.standins.mtconnect_agent.replay import Pace
from tests.cnctwin.program import until
from tests.cnctwin.standins.mtconnect_agent.adapter_socket import ShdrAdapter
from tests.cnctwin.standins.mtconnect_agent.small_machine import (
    DEVICES,
    at,
    elements,
    fetch,
    observations,
    played,
    values,
    write_machine,
)
from tests.recordings import recording

FILES = {
    "nist/raw/Mazak01-20180718-20180719.txt": ("Mazak01", 65_906, {"duplicate": 67, "unknown_key": 19}),
    "nist/raw/Mazak03-20170629-20170630.txt": ("Mazak03", 22_846, {"duplicate": 119}),
    "nist/plate/Plate-Hurco04-02of20.txt": ("Hurco04", 7_199, {"truncated": 1}),
    "nist/cover/Cover-Hurco04-01of20.txt": ("Hurco04", 11_928, {"duplicate": 1}),
    "nist/box/Box-Hurco02-03of20.txt": ("Hurco02", 40_203, {"truncated": 4}),
}


@pytest.mark.parametrize("name", FILES)
def test_a_recorded_day_goes_through_with_every_drop_counted(name: str) -> None:
    device, lines, dropped = FILES[name]
    agent = ReplayAgent(recording(name), recording("nist/devices.xml"), speed=0)
    agent.step(1_000_000)
    ledger = agent.ledger
    agent.stop()
    assert agent.device_name == device
    assert (ledger.lines, ledger.entries) == (lines, lines)
    assert dict(ledger.dropped) == dropped
    assert ledger.balances
    own = sum(len(d.items) for d in agent.agent.model.devices)
    assert ledger.observations == own + ledger.accepted


def test_a_recording_without_a_device_model_gets_a_draft() -> None:
    agent = ReplayAgent(recording("nist/plate/Plate-Hurco04-02of20.txt"), speed=0, device="Hurco04")
    agent.step(1_000_000)
    with agent:
        text = fetch(agent, "/Hurco04/probe")
        current = fetch(agent, "/current")
    items = {e.get("name"): (e.get("category"), e.get("type")) for e in elements(text) if e.tag == "DataItem"}
    assert items["Spindle_Speed"] == ("SAMPLE", "ROTARY_VELOCITY")
    assert items["Current_Tool"] == ("EVENT", "TOOL_NUMBER")
    assert items["Program_Runtime_Seconds"] == ("EVENT", "VARIABLE")
    assert [o.text for o in observations(current) if o.get("name") == "Program_Status"] != ["UNAVAILABLE"]
    assert dict(agent.ledger.dropped) == {"truncated": 1}


def test_a_draft_knows_conditions_by_their_form(tmp_path: Path) -> None:
    file = tmp_path / "a b.txt"
    file.write_text("\n".join([at(0, "servo|Normal||||"), at(1, "Xload|5|strange key!|7"), "2017"]), encoding="utf-8")
    agent = ReplayAgent(file, speed=0)
    agent.step(10)
    with agent:
        text = fetch(agent, "/a_b/current")
    assert {(o.get("name"), o.tag, o.text) for o in observations(text) if o.get("name")} == {
        ("servo", "Normal", None),
        ("Xload", "Load", "5"),
        ("strange key!", "Variable", "7"),
    }


@pytest.mark.parametrize(
    ("name", "device", "expected"),
    [
        ("VMC-3.txt", None, "VMC-3"),
        ("day-of-lathe-1-monday.txt", None, "LATHE-1"),
        ("any.txt", "000", "VMC-3"),
        ("any.txt", "d2", "LATHE-1"),
        ("any.txt", None, "none is named in any.txt; say which: VMC-3, LATHE-1"),
        ("any.txt", "GRINDER", "has no device 'GRINDER'; it has VMC-3, LATHE-1"),
    ],
)
def test_the_device_is_named_or_in_the_file_name(tmp_path: Path, name: str, device: str | None, expected: str) -> None:
    file, devices = write_machine(tmp_path, [at(0, "tool|1")], name)
    if " " in expected:
        with pytest.raises(RecordingError, match=expected):
            ReplayAgent(file, devices, device=device)
        return
    agent = ReplayAgent(file, devices, device=device)
    agent.stop()
    assert agent.device_name == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE x [<!ENTITY a "b">]>' + DEVICES, "DOCTYPE"),
        ("<MTConnectDevices/>", "no Device"),
        ("<MTConnectDevices>", "not well-formed"),
        ('<Device id="a" name="a"/>', "uuid"),
        ('<D><Device id="a" name="a" uuid="a"/><Device id="b" name="a" uuid="b"/></D>', "two devices are named 'a'"),
        ('<Device id="a" uuid="a"><DataItems><DataItem id="i" type="LOAD" category="ODD"/></DataItems></Device>', "'ODD'"),
    ],
)
def test_a_device_model_that_cannot_be_used_says_why(tmp_path: Path, text: str, message: str) -> None:
    file, devices = write_machine(tmp_path, [at(0, "tool|1")])
    devices.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceModelError, match=message):
        ReplayAgent(file, devices)


def test_files_that_are_not_there_are_named(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(0, "tool|1")])
    with pytest.raises(RecordingError, match=r"nothing\.txt"):
        ReplayAgent(tmp_path / "nothing.txt", devices)
    with pytest.raises(DeviceModelError, match=r"nothing\.xml"):
        ReplayAgent(file, tmp_path / "nothing.xml")


def test_dirt_is_counted_by_reason(tmp_path: Path) -> None:
    lines = ["2017", "20175", "now|tool|1", at(0, "tool|1"), at(1, "tool"), at(2, "spindle|1"), at(3, "Cmode|CONTOUR"), ""]
    agent = played(tmp_path, lines)
    agent.stop()
    assert dict(agent.ledger.dropped) == {"truncated": 3, "bad_stamp": 1, "unknown_key": 1, "constant": 1}
    assert agent.ledger.accepted == 1
    assert agent.ledger.balances


def test_backward_and_stale_stamps_are_replayed_in_file_order(tmp_path: Path) -> None:
    lines = ["2017-01-23T18:33:25.767113Z|tool|1", at(60, "tool|2"), at(59, "tool|3"), at(61, "tool|4")]
    with played(tmp_path, lines) as agent:
        text = fetch(agent, "/sample?count=1000")
    assert values(text, "tool") == ["UNAVAILABLE", "1", "2", "3", "4"]


def test_the_pace_of_the_okuma_recording_is_that_of_its_four_programs() -> None:
    pace = Pace(5.0)
    lines = list(Recording(recording("mtconnect/okuma.txt")).lines())
    played_s = sum(map(pace.pause_s, lines))
    assert played_s == pytest.approx(190 + 610 + 552 + 25, rel=0.02)


def test_a_replay_keeps_the_pace(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(n, f"tool|{n}") for n in range(21)])
    begun = time.monotonic()
    with ReplayAgent(file, devices, speed=40.0) as agent:
        assert agent.wait_finished(60.0)
        assert 20 / 40.0 <= time.monotonic() - begun < 10.0, "at its own pace, it would take 20 s"
        assert agent.finished
        assert values(fetch(agent, "/current"), "tool") == ["20"]  # at its end it goes on serving


def test_a_loop_begins_again_and_is_never_finished(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(n, f"tool|{n}") for n in range(3)])
    agent = ReplayAgent(file, devices, speed=0, loop=True)
    assert agent.step(7) == 7
    assert not agent.finished
    assert agent.ledger.loops == 2
    agent.stop()


def test_a_loop_of_a_short_recording_keeps_the_pace(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(n, f"tool|{n}") for n in range(3)])
    begun = time.monotonic()
    with ReplayAgent(file, devices, speed=20.0, loop=True) as agent:
        until(lambda: agent.ledger.loops >= 3, "three passes")
        loops, passed_s = agent.ledger.loops, time.monotonic() - begun
    assert loops <= passed_s / 0.1 + 1.0  # a pass takes 0.1 s


@pytest.mark.parametrize("lines", [[], ["", ""]])
def test_a_loop_of_nothing_ends(tmp_path: Path, lines: list[str]) -> None:
    file, devices = write_machine(tmp_path, lines)
    with ReplayAgent(file, devices, speed=float("inf"), loop=True) as agent:
        assert agent.wait_finished(60.0)


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(0, "tool|1")])
    with ReplayAgent(file, devices, speed=0) as agent:
        port = int(agent.url.rpartition(":")[2])
        with pytest.raises(ReplayError, match=f"port {port}"):
            ReplayAgent(file, devices, port=port)
        with pytest.raises(ReplayError, match=f"port {port}"):
            ShdrAdapter(file, devices, port=port)


def test_steps_end_with_the_recording(tmp_path: Path) -> None:
    file, devices = write_machine(tmp_path, [at(n, f"tool|{n}") for n in range(3)])
    agent = ReplayAgent(file, devices, speed=0)
    assert [agent.step(2), agent.finished, agent.step(2), agent.finished] == [2, False, 1, True]
    agent.stop()


@pytest.mark.parametrize("speed", [-1.0, float("nan")])
def test_a_speed_that_is_none_is_refused(tmp_path: Path, speed: float) -> None:
    file, devices = write_machine(tmp_path, [at(0, "tool|1")])
    with pytest.raises(ValueError, match="speed"):
        ReplayAgent(file, devices, speed=speed)


def test_instances_started_one_after_another_differ(tmp_path: Path) -> None:
    agent = played(tmp_path, [at(0, "tool|1")])
    ids = []
    for _ in range(3):
        ids.append(agent.agent.instance_id)
        agent.restart()
    agent.stop()
    assert all(a < b for a, b in pairwise(ids))
