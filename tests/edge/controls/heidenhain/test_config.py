"""The table [heidenhain]: mistakes are found before any I/O, in one line that names the way out."""

from pathlib import Path

import pytest

from edge.config_file import parse
from edge.controls.heidenhain.config import host_and_port
from edge.controls.heidenhain.control import logins_of, plc_password
from edge.errors import ConfigError

FILE = '[machine]\nadapter = "heidenhain"\n'


def test_addresses() -> None:
    assert host_and_port("lsv2://tnc640") == ("tnc640", 19000)
    assert host_and_port("lsv2://[::1]:19001") == ("::1", 19001)


@pytest.mark.parametrize(
    ("table", "names"),
    [
        ('url = "http://tnc640"', "lsv2://"),
        ('url = "lsv2://"', "lsv2://"),
        ('url = "lsv2://user:secret@tnc640"', "nothing more"),
        ('url = "lsv2://tnc640:99999"', "address"),
        ('plc = { spindle_speed = "D1004" }', "spindle_speed"),
        ('plc = { spindle_rpm = "Q5" }', "Q5"),
        ('plc = { tool_change_active = "M4000" }', "tool_change"),
        ('plc = { tool_change = "W1000" }', "no bit"),
        ('tool_number_from = "guess"', "tool_number_from"),
        ("interval_ms = 1", "interval_ms"),
        ("program_kib_max = 100000", "program_kib_max"),
    ],
)
def test_each_mistake_is_named(table: str, names: str) -> None:
    with pytest.raises(ConfigError, match="heidenhain") as told:
        parse(f"{FILE}[heidenhain]\n{table}\n", Path("edge.toml"))
    assert names in str(told.value)
    assert "\n" not in str(told.value)


def test_it_logs_in_only_for_what_is_read() -> None:
    bare = parse(f"{FILE}[heidenhain]\nprogram_text = false\nclock_interval_s = 0\n", Path("edge.toml"))
    assert logins_of(bare) == ("INSPECT", "DNC")
    full = parse(f'{FILE}[heidenhain]\nplc = {{ spindle_rpm = "D1004" }}\n', Path("edge.toml"))
    assert logins_of(full) == ("INSPECT", "DNC", "FILE", "PLCDEBUG", "DIAGNOSTICS")


def test_the_plc_password_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    config = parse(f'{FILE}[heidenhain]\nplc_password_env = "PLC_PASSWORD"\n', Path("edge.toml"))
    with pytest.raises(ConfigError, match="no such environment variable"):
        plc_password(config)
    monkeypatch.setenv("PLC_PASSWORD", "807667")
    assert plc_password(config) == "807667"
