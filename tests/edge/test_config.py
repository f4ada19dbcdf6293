"""Configurations: each mistake is one line that says where, what and the way out."""

from pathlib import Path

import pytest

from edge.check import discover
from edge.config import BLOCK_PATTERN, BrokerSection, EdgeConfig
from edge.config_file import load, parse
from edge.controls.mtconnect.adapter import ADAPTER
from edge.controls.mtconnect.config import MtconnectConfig
from edge.errors import ConfigError
from edge.running.run import broker_addresses

FILE = Path("vmc.toml")


def test_an_empty_table_is_all_defaults() -> None:
    config = parse("[machine]", FILE)
    assert config == EdgeConfig(source=MtconnectConfig(), path=FILE)
    assert config.node == "edge-machine"


def test_the_values_of_the_sample_are_the_defaults() -> None:
    sample = load(ADAPTER.sample_config)
    assert sample == EdgeConfig(source=MtconnectConfig(), path=ADAPTER.sample_config)
    assert sample.tool_change.block_pattern == BLOCK_PATTERN


def test_the_example_of_a_signal_in_the_sample_is_valid() -> None:
    text = ADAPTER.sample_config.read_text(encoding="utf-8")
    example = text[text.index("# [signals") :].replace("\n# ", "\n").removeprefix("# ")
    section = parse(example, FILE).signals["feed_mm_min"]
    assert (section.data_item, section.native_unit) == ("Feed_Rate", "INCH/MINUTE")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[machine]\nname = 'a/b'", "vmc.toml: machine.name = 'a/b': does not match the pattern ^[^/+#]+$"),
        ("[machine]\nnam = 'a'", "vmc.toml: machine.nam is not known; did you mean name? See docs/how-to/edges.md"),
        ("[machine]\nadapter = 'fagor'", "vmc.toml: machine.adapter = 'fagor' is not known; known are focas, "),
        ("[machine]\nlost_after_s = 'soon'", "vmc.toml: machine.lost_after_s = 'soon': is no number; write one without quotes"),
        ("[mtconnect]\nurl = 'agent:5000'", "vmc.toml: mtconnect.url = 'agent:5000': is no http:// or https:// address"),
        ("[mtconnect]\ncount = 0", "vmc.toml: mtconnect.count = 0: must be 1 or more"),
        ("[signals.spindle_speed]", "vmc.toml: [signals.spindle_speed]: signal 'spindle_speed' is no canonical name; known are"),
        ("[signals.tool_change_active]\ndata_item = 'x'", "vmc.toml: [signals.tool_change_active]: is derived by the edge"),
        (
            "[signals.feed_mm_min]\nnative_unit = 'KNOT'",
            "vmc.toml: [signals.feed_mm_min]: native unit 'KNOT' cannot become mm/min; it may be",
        ),
        ("[signals.program]\ndeadband = 1", "vmc.toml: [signals.program]: scale and deadband need a number; remove them"),
        ("[signals.feed_mm_min]\ndeadband = -1", "vmc.toml: signals.feed_mm_min.deadband = -1: must be 0 or more"),
        ("[signals.feed_mm_min]\nscale = nan", "vmc.toml: signals.feed_mm_min.scale = nan: is not a finite number"),
        ("[tool_change]\nblock_pattern = '('", "vmc.toml: tool_change.block_pattern = '(': is no regular expression: missing )"),
        ("", "vmc.toml: is empty; cnctwin edge discover ADDRESS > vmc.toml drafts it"),
        ("# only a comment\n", "vmc.toml: is empty; "),
        (
            "[machine]\nname = 'mill'\n[focas]\nhost = '10.0.0.7'",
            'vmc.toml: machine.adapter is missing; [focas] needs adapter = "focas" below [machine]',
        ),
        ("[opcua]", 'vmc.toml: machine.adapter is missing; [opcua] needs adapter = "opcua" below [machine]'),
        ("[machine]\nadapter = 'focas'\n[opcua]", "vmc.toml: [opcua]: is the table of another control; "),
        ("[mtconnect]\n[opcua]", "vmc.toml: [opcua]: is the table of another control; "),
        (
            "[broker]\nurl = 'mqtt://a'\nurls = ['mqtt://b']",
            "vmc.toml: broker: has url and urls; put all brokers into urls",
        ),
        (
            "[broker]\nurls = ['mqtt://b', 'mqtt://b']",
            "vmc.toml: broker: urls names a broker twice",
        ),
        ("machine = 3", "vmc.toml: machine: must be a table"),
        ("[machine", "vmc.toml: is no TOML: "),
    ],
)
def test_a_mistake_is_one_line_with_the_way_out(text: str, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(text, FILE)
    assert str(caught.value).startswith(expected)
    assert "\n" not in str(caught.value)


def test_all_mistakes_of_a_file_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse("[machine]\nname = 'a'\n[mtconnect]\ncount = 0\nur = 'x'\n[signals.feed_mm_min]\ndeadbnd = 1\n[repot]\n", FILE)
    assert str(caught.value).split("\n  ") == [
        "vmc.toml: 4 faults; see docs/how-to/edges.md",
        "signals.feed_mm_min.deadbnd is not known; did you mean deadband?",
        "mtconnect.ur is not known; did you mean url?",
        "mtconnect.count = 0: must be 1 or more",
        "[repot] is not known; did you mean report?",
    ]


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        load(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b'[machine]\nname = "\xe4"')
    with pytest.raises(ConfigError, match="is not UTF-8 at byte 18"):
        load(tmp_path / "latin.toml")


def test_secrets_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    section = parse("[broker]\nusername = 'edge'\npassword_env = 'EDGE_SECRET'", FILE).broker
    with pytest.raises(ConfigError, match=r"broker\.password_env = 'EDGE_SECRET': no such environment variable"):
        broker_addresses(section, FILE)
    monkeypatch.setenv("EDGE_SECRET", "s3cret")
    (address,) = broker_addresses(section, FILE)
    assert (address.username, address.password) == ("edge", "s3cret")
    assert "s3cret" not in repr(address) + address.url


def test_several_brokers_share_the_user_and_keep_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EDGE_SECRET", "s3cret")
    text = "[broker]\nurls = ['mqtt://one', 'mqtts://two:8884']\nusername = 'edge'\npassword_env = 'EDGE_SECRET'"
    addresses = broker_addresses(parse(text, FILE).broker, FILE)
    assert [address.url for address in addresses] == ["mqtt://edge@one:1883", "mqtts://edge@two:8884"]
    assert [address.password for address in addresses] == ["s3cret", "s3cret"]


def test_one_edge_speaks_one_version_of_mqtt_to_all_its_brokers() -> None:
    section = BrokerSection(urls=("mqtt://one", "mqtt://two?version=5"))
    with pytest.raises(ConfigError, match="give all addresses version=5, or none"):
        broker_addresses(section, FILE)


def test_a_mistake_in_one_of_several_addresses_names_the_key() -> None:
    section = parse("[broker]\nurls = ['mqtt://one', 'http://two']", FILE).broker
    with pytest.raises(ConfigError, match=r"broker\.urls: broker address 'http://two'"):
        broker_addresses(section, FILE)


def test_an_address_with_a_password_is_refused_without_showing_it(tmp_path: Path) -> None:
    file = tmp_path / "vmc.toml"
    file.write_text('[mtconnect]\nurl = "http://u:hunter2@127.0.0.1:5000"\n')
    with pytest.raises(ConfigError, match="must hold no user or password") as caught:
        load(file)
    assert "hunter2" not in str(caught.value)
    with pytest.raises(ConfigError, match="must hold no user or password") as caught:
        discover("http://u:hunter2@127.0.0.1:5000")
    assert "hunter2" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "mode", "expected"),
    [
        ("secret\n", 0o600, "secret"),
        ("secret\n", 0o640, "others can read it; chmod 600 it"),
        ("\n", 0o600, "is empty; put the password into its first line"),
    ],
)
def test_a_password_comes_from_a_file_that_only_its_owner_can_read(tmp_path: Path, text: str, mode: int, expected: str) -> None:
    secret = tmp_path / "secret"
    secret.write_text(text)
    secret.chmod(mode)
    section = BrokerSection(username="edge", password_file=str(secret))
    if expected == "secret":
        assert broker_addresses(section, FILE)[0].password == expected
        return
    with pytest.raises(ConfigError, match=expected):
        broker_addresses(section, FILE)
