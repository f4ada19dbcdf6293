"""A language of somebody's own: a file that is checked when the configuration is read, and templates that can do no harm."""

from dataclasses import replace
from pathlib import Path

import pytest

from processors.alerts.config import AlertsConfig
from processors.alerts.processor import PROCESSOR
from processors.alerts.state import Alert, Phase, Severity
from processors.alerts.words.wording import Occasion, wording
from processors.config import Configuration
from processors.errors import ConfigurationError

SHAKES = Alert("okuma", "rule_vibration", "twin/rule_vibration", "f" * 16, Severity.HIGH, 1_795_000_000_000, Phase.FIRING)


def title(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    return wording(str(path), "UTC", "").title([SHAKES], Occasion(9.0))


def test_a_file_changes_what_it_names_and_leaves_the_rest_in_english(tmp_path: Path) -> None:
    own = '[alerts.rule_vibration]\nname = "vibration trop forte"\n[form]\nseconds = "sec"\n'
    assert title(tmp_path / "fr.toml", own) == "okuma: Vibration trop forte for 9 sec"
    assert title(tmp_path / "short.toml", 'title = "{{ first.machine|upper }} {{ first.severity }}"\n') == "OKUMA high"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('title = "{{ machine"', "title: "),
        ('[alerts.rule_vibration]\nname = "x"\nwhat = "{% if %}"', "alerts.rule_vibration.what: "),
        ('titel = "x"', "titel is not known; did you mean title?"),
        ("[form]\ndecimal = 7", "form.decimal: "),
        ("title = ", "Invalid value"),
        ('title = "{{ x|nofilter }}"', "No filter named 'nofilter'"),
    ],
)
def test_a_fault_in_a_file_is_one_line_that_names_the_file_and_the_place(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as told:
        PROCESSOR.configured({"language": str(path)})
    assert f"language {path}: " in str(told.value) and said in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize("name", ["xx", "", "de_AT"])
def test_a_language_that_is_not_there_is_refused_with_those_that_are(name: str) -> None:
    with pytest.raises(ConfigurationError, match="de, en" if name else "language"):
        PROCESSOR.configured(
            {"receivers": {"desk": {"type": "webhook", "url": "https://d", "language": "xx"}}, "language": name or "xx"}
        )


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"none\.toml: No such file"):
        PROCESSOR.configured({"language": str(tmp_path / "none.toml")})


def test_a_time_zone_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no time zone 'CETX'"):
        Configuration(AlertsConfig, {"time_zone": "CETX"}, name="alerts")


@pytest.mark.parametrize(
    "template",
    [
        "{{ ''.__class__.__mro__ }}",
        "{{ alerts.__init__.__globals__ }}",
        "{{ alerts.append(1) }}",
        "{{ first.update({'a': 1}) }}",
        "{% for i in range(10000000) %}x{% endfor %}",
        "{{ 1 / 0 }}",
        "{{ first.machine.nothing }}",
        "{{ first.value }}",
    ],
)
def test_a_template_that_reaches_out_or_fails_is_refused_at_the_start(tmp_path: Path, template: str) -> None:
    with pytest.raises(ValueError, match="title: "):
        title(tmp_path / "own.toml", f'title = """{template}"""\n')


def test_a_template_that_fails_only_later_costs_no_notification(tmp_path: Path) -> None:
    own = """title = "{% if first.alert == 'rule_tool_broken' %}{{ first.value }}{% endif %}{{ first.machine }}"\n"""
    path = tmp_path / "own.toml"
    path.write_text(own, encoding="utf-8")
    broken = replace(SHAKES, name="rule_tool_broken")
    assert wording(str(path), "UTC", "").title([broken], Occasion(9.0)) == "okuma: Tool is probably broken for 9 s"


def test_a_template_that_writes_without_end_is_cut_off(tmp_path: Path) -> None:
    assert len(title(tmp_path / "own.toml", "title = \"{% for i in range(90000) %}{{ 'x' * 1000 }}{% endfor %}\"\n")) == 200
