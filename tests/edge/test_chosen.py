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
    specs = {spec.name: spec for spec in device_metrics([one.offer("there") for one in config.chosen], {}, 0)}
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


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ('[variables]\nw = "#500"', "variables.w = '#500': must be a table; write name = { address = "),
        ('[variables]\nw = { adress = "#500", address = "#1" }', "variables.w.adress is not known; did you mean address?"),
        ('[variables]\nw = { unit = "mm" }', "variables.w.address is missing; write name = { address = "),
        ('[variables]\nW = { address = "#500" }', "variables.W: is no name; it must match ^[a-z]"),
        ('[variables]\nw = { address = "#500", scale = "x" }', "variables.w.scale = 'x': is no number; write one without quotes"),
        ('[plc]\nd = { address = "R1.3", kind = "bit" }', "plc.d.kind = 'bit': must be 'number'"),
        ('[plc]\nd = { address = "R1.3", kind = "flag", unit = "bar" }', "plc.d: is a flag with a unit or a scale; remove them"),
        ("[plc]\nd = { address = 500 }", "plc.d.address = 500: is no text; put it in quotes"),
        ('[plc]\nd = { address = "" }', "plc.d.address = '': is empty; write what it should be"),
    ],
)
def test_a_mistake_is_one_line_with_key_value_and_the_way_out(table: str, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(HEAD + table, Path("edge.toml"))
    assert str(caught.value).startswith(f"edge.toml: {line}")
    assert "\n" not in str(caught.value)


def test_a_table_has_a_limit() -> None:
    rows = "".join(f'v{number} = {{ address = "#{500 + number}" }}\n' for number in range(201))
    with pytest.raises(ConfigError, match="200"):
        parse(f"{HEAD}[variables]\n{rows}", Path("edge.toml"))
