"""What a configuration chooses by address: names, units and flags, up to the birth certificate."""

from pathlib import Path

import pytest

from edge.config_file import parse
from edge.errors import ConfigError
from edge.running.birth import device_metrics
from sparkplug.datatype import DataType

HEAD = '[machine]\nadapter = "focas"\n'
TABLES = """
[variables]
part_width = { address = "#500", unit = "mm" }
[plc]
pressure = { address = "D300:2", unit = "bar", scale = 0.1 }
door_open = { address = "R100.3", kind = "flag" }
[signals.plc_pressure]
deadband = 0.5
"""


def test_the_birth_declares_them_with_their_unit_and_a_flag_as_a_boolean() -> None:
    config = parse(HEAD + TABLES, Path("edge.toml"))
    specs = {spec.name: spec for spec in device_metrics([one.offer("there") for one in config.chosen], {})}
    assert [(specs[name].datatype, specs[name].unit) for name in ("variable_part_width", "plc_pressure", "plc_door_open")] == [
        (DataType.DOUBLE, "mm"),
        (DataType.DOUBLE, "bar"),
        (DataType.BOOLEAN, None),
    ]
    assert config.signals["plc_pressure"].deadband == 0.5


@pytest.mark.parametrize("name", ["Width", "1st", "a" * 33, "with-dash", "ä"])
def test_a_name_that_is_no_name_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=r"edge\.toml: variables\."):
        parse(f'{HEAD}[variables]\n"{name}" = {{ address = "#500" }}\n', Path("edge.toml"))


def test_a_table_has_a_limit() -> None:
    rows = "".join(f'v{number} = {{ address = "#{500 + number}" }}\n' for number in range(201))
    with pytest.raises(ConfigError, match="200"):
        parse(f"{HEAD}[variables]\n{rows}", Path("edge.toml"))
