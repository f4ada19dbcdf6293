"""What an edge would publish, and a first configuration, from a running agent and without a broker."""

from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from edge.check import check, discover
from edge.config_file import parse
from edge.controls.mtconnect.documents import DevicesDocument, parse_document
from edge.controls.mtconnect.draft import text_of
from edge.errors import ConfigError, ConnectionLostError
from tests.edge.controls.mtconnect.agent_documents import probe
from tests.recordings import recording


def okuma() -> ReplayAgent:
    files = recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml")
    return ReplayAgent(*files, device="OKUMA", speed=0)


def test_a_drafted_configuration_works_as_it_is(tmp_path: Path) -> None:
    with okuma() as agent:
        agent.step(3)
        draft = discover(agent.url)
        (tmp_path / "okuma.toml").write_text(draft, encoding="utf-8")
        rows = {row.signal: row for row in check(tmp_path / "okuma.toml")}
    assert (rows["spindle_load_pct"].source, rows["spindle_load_pct"].unit, rows["spindle_load_pct"].value) == (
        "S1load",
        "%",
        0.0,
    )
    assert (rows["feed_mm_min"].native_unit, rows["feed_mm_min"].unit) == ("MILLIMETER/SECOND", "mm/min")
    assert (rows["tool_number"].value, rows["program"].value) == (2206, "IMTS-2022-2-HOB.MIN")


def test_the_draft_names_what_has_no_signal_and_which_spindles_there_are() -> None:
    with okuma() as agent:
        draft = discover(agent.url)
    assert 'device = "OKUMA"' in draft
    assert 'spindle = "Lc1"  # of Lc1, Lc2, Lc6' in draft
    assert "#   S6speed  (SAMPLE ROTARY_VELOCITY ACTUAL REVOLUTION/MINUTE C6)" in draft
    assert "[signals.feed_mm_min]  # mm/min" in draft


def test_names_from_a_device_description_cannot_break_the_draft() -> None:
    document = parse_document(probe(other=True).replace(b'name="VMC"', b'name="V/M&quot;C&#10;[broker]"'))
    assert isinstance(document, DevicesDocument)
    machines = [device for device in document.devices if not device.is_agent]
    config = parse(text_of("http://agent:5000", machines[0], machines), Path("x.toml"))
    assert (config.machine.name, config.source.device) == ('V-M"C-[broker]', 'V/M"C\n[broker]')


def test_what_is_wrong_is_said_in_one_line(tmp_path: Path) -> None:
    with okuma() as agent:
        for text, expected in (
            (f'[mtconnect]\nurl = "{agent.url}"\ndevice = "LATHE"', "the agent has no such device; it has OKUMA"),
            (
                f'[mtconnect]\nurl = "{agent.url}"\ndevice = "OKUMA"\n[signals.feed_mm_min]\ndata_item = "p1Fac"',
                "has no such item; near are p1Fact",
            ),
        ):
            (tmp_path / "x.toml").write_text(text, encoding="utf-8")
            with pytest.raises(ConfigError) as caught:
                check(tmp_path / "x.toml")
            assert expected in str(caught.value)
            assert "\n" not in str(caught.value)
    with pytest.raises(ConnectionLostError, match="is the agent running, and the address right"):
        discover("http://127.0.0.1:1")
    with pytest.raises(ConfigError, match=r"no adapter speaks to such an address; there are .*http:// \(mtconnect\)"):
        discover("agent:5000")
