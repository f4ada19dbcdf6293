"""The table [focas]: what is refused, before anybody is asked, and how it is said."""

from pathlib import Path

import pytest

from edge.config_file import parse
from edge.errors import ConfigError


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ('backend = "library"', 'backend = "library" needs library = "/path/of/libfwlib32.so"'),
        ('tool_number = "toolnum"', 'needs backend = "library"'),
        ('tool_change_pmc = "R100"', "'R100' names no bit; write it as R100.0"),
        ('tool_change_pmc = "Q1.0"', "'Q1.0' is no PMC address; write R100, R100.3, D100:2 or D100:2s"),
        ('tool_change_pmc = "g12.3"', 'tool_change_pmc = "G12.3" lies in a byte of an override'),
        ('tool_number_pmc = "D100.1"', "'D100.1' is one bit; name a byte"),
        ('host = "http://x"', "focas.host = 'http://x'"),
        ("interval_ms = 5", "focas.interval_ms = 5"),
        ('groups = ["blocks"]', "focas.groups"),
        ("speed = 1", "focas.speed is not known"),
    ],
)
def test_a_mistake_is_one_line_that_names_key_and_value(line: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(f'[machine]\nadapter = "focas"\n[focas]\n{line}\n', Path("edge.toml"))
    assert complaint in str(caught.value)
    assert str(caught.value).startswith("edge.toml: ")
    assert "\n" not in str(caught.value)


def test_addresses_may_be_written_small() -> None:
    config = parse('[machine]\nadapter = "focas"\n[focas]\ntool_change_pmc = "r100.3"\n', Path("edge.toml"))
    assert config.source.tool_change_pmc == "R100.3"
