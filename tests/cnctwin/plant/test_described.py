"""The doctor tells which description is live, what of it is assumed, which challenger waits, and which file is wrong."""

import json
import sys

import pytest

from cnctwin.cli import main
from cnctwin.plant.described import described_machines, sentences
from cnctwin.plant.descriptions import FAULTS_MAX, LiveDescriptions
from processors.description import DescriptionMessage, Role, topic_of, version_of
from sparkplug.broker import BrokerAddress
from tests.deploy.wire_client import WireClient
from tests.wire.mosquitto import Mosquitto

SINCE_MS = 1_795_327_200_000  # 2026-11-22 06:00 UTC
TOML = """
[machine]
name = "vmc"
assumed = ["thermal.alpha_w_per_pct_rpm2", "spindle.efficiency"]

[spindle]
rated_power_kw = 11.0
efficiency = 0.85
idle_power_kw = 0.25

[thermal]
alpha_w_per_pct_rpm2 = 2.2e-8
beta_w_per_rpm = 1.6e-2
resistance_k_per_w = 0.12
capacity_j_per_k = 9000.0
"""
KNOWN = TOML.replace('assumed = ["thermal.alpha_w_per_pct_rpm2", "spindle.efficiency"]\n', "")


def message(toml: str, **more: str) -> bytes:
    return DescriptionMessage(version=version_of(toml), toml=toml, t=SINCE_MS, **more).payload()


def heard(**of: bytes) -> LiveDescriptions:
    """Descriptions by what came on the topics of vmc: live, challenger, fault."""
    found = LiveDescriptions()
    for role, payload in of.items():
        found.take(f"cnctwin/description/vmc/{role.replace('__', '/')}", payload)
    return found


def said(descriptions: LiveDescriptions, *machines: str) -> list[tuple[bool, str]]:
    found = [one for machine in described_machines(descriptions, machines) for one in sentences(machine)]
    return [(one.good, one.text) for one in found]


def test_a_machine_whose_constants_are_known_has_one_line() -> None:
    live = message(KNOWN, step="promoted", by="anna", why="coolant cools")
    assert said(heard(live=live), "vmc") == [
        (True, f"vmc: description {version_of(KNOWN)} is live since 2026-11-22 06:00 UTC, promoted by anna: coolant cools")
    ]


def test_what_is_assumed_is_named_with_the_command_that_fits_it() -> None:
    (_, first), (good, second) = said(heard(live=message(TOML)))
    assert first == f"vmc: description {version_of(TOML)} is live since 2026-11-22 06:00 UTC"
    assert good
    assert second == (
        "vmc: thermal.alpha_w_per_pct_rpm2, spindle.efficiency are assumed; "
        "`cnctwin identify --store STORE --machine vmc --out vmc.toml` fits them"
    )


def test_a_section_that_live_figures_rest_on_is_assumed_where_the_file_lacks_it() -> None:
    text = '[machine]\nname = "vmc"\n' + TOML[TOML.index("[thermal]") :]
    (machine,) = described_machines(heard(live=message(text)), [])
    assert machine.assumed == ("spindle",)
    assert "vmc: spindle is assumed; " in [*sentences(machine)][1].text


def test_a_connected_machine_that_nobody_has_described_is_named_with_the_way_out() -> None:
    (line,) = said(LiveDescriptions(), "okuma")
    assert line == (
        True,
        "okuma: not described, so its constants are assumed; write machines/okuma.toml, "
        "or `cnctwin identify --store STORE --machine okuma --out okuma.toml` fits one",
    )


def test_a_command_for_a_name_with_a_space_can_be_typed() -> None:
    ((_, line),) = said(LiveDescriptions(), "Fräse 1")
    assert "--machine 'Fräse 1' --out 'Fräse 1.toml'" in line


def test_a_challenger_that_waits_is_told_with_the_commands_that_weigh_and_promote_it() -> None:
    found = heard(live=message(KNOWN), challenger=message(TOML, step="filed", by="loop", why="coolant cools"))
    (_, _), (good, line) = said(found)
    assert good
    assert line == (
        f"vmc: challenger {version_of(TOML)} waits since 2026-11-22 06:00 UTC: coolant cools; "
        "`cnctwin twin show vmc` weighs it, `cnctwin twin promote vmc` makes it live"
    )
    found.take(topic_of("vmc", Role.CHALLENGER), b"")
    assert len(said(found)) == 1


def test_a_wrong_file_and_a_processor_that_refuses_a_description_are_bad_news_until_they_are_mended() -> None:
    wrong = json.dumps({"t": 1, "text": "machines/vmc.toml: [spindle] efficiency = 2.0"}).encode()
    refused = json.dumps({"t": 2, "text": "gap cannot take up the live description 3f2a: no [thermal]"}).encode()
    found = heard(live=message(KNOWN), fault=wrong, fault__gap__live=refused)
    assert [text for good, text in said(found) if not good] == [
        "vmc: machines/vmc.toml: [spindle] efficiency = 2.0",
        "vmc: gap cannot take up the live description 3f2a: no [thermal]",
    ]
    found.take("cnctwin/description/vmc/fault", b"")
    found.take("cnctwin/description/vmc/fault/gap/live", b"")
    assert all(good for good, _ in said(found))


@pytest.mark.parametrize("payload", [b"{", b"[]", b'{"t": "yesterday", "text": "x"}', b'{"text": 3}', b"\xff"])
def test_a_fault_that_cannot_be_read_changes_nothing(payload: bytes) -> None:
    found = heard(fault=b'{"t": 1, "text": "wrong"}')
    found.take("cnctwin/description/vmc/fault", payload)
    found.take("cnctwin/description/okuma/fault", payload)
    assert [(machine, fault.text) for machine, fault in found.faults()] == [("vmc", "wrong")]


def test_the_faults_that_are_kept_are_bounded() -> None:
    found = LiveDescriptions()
    for number in range(FAULTS_MAX + 2):
        found.take(f"cnctwin/description/m{number}/fault", b'{"text": "wrong"}')
    assert len(found.faults()) == FAULTS_MAX


@pytest.mark.broker
def test_the_command_reads_descriptions_from_the_broker(
    mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    broker = BrokerAddress(*mosquitto.address)
    with WireClient(broker) as writer:
        told = {
            "live": message(TOML, by="anna"),
            "challenger": message(KNOWN),
            "fault": b'{"t": 1, "text": "machines/vmc.toml: wrong"}',
        }
        writer.settle(
            *(writer.publish(f"cnctwin/description/vmc/{role}", payload, retain=True) for role, payload in told.items())
        )
    monkeypatch.setattr(sys, "argv", ["cnctwin", "doctor", "--broker", broker.url, "--seconds", "1", "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    report = json.loads(capfd.readouterr().out)
    (machine,) = report["machines"]
    assert machine == {
        "machine": "vmc",
        "version": version_of(TOML),
        "since_ms": SINCE_MS,
        "step": "",
        "by": "anna",
        "why": "",
        "assumed": ["thermal.alpha_w_per_pct_rpm2", "spindle.efficiency"],
        "challenger": version_of(KNOWN),
        "challenger_since_ms": SINCE_MS,
        "challenger_why": "",
        "faults": ["machines/vmc.toml: wrong"],
    }
    assert {"good": False, "text": "vmc: machines/vmc.toml: wrong", "note": False} in report["findings"]
