"""The table `[limits]` of a configuration file."""

from dataclasses import fields
from pathlib import Path

import pytest

from processors.errors import ConfigurationError
from processors.running.limits import limits_of
from processors.running.quarantine import quarantine_health
from processors.running.runtime import configured
from sparkplug.admission.limits import DEFAULTS
from sparkplug.admission.refusal import Quarantined, Refusal
from sparkplug.topics import NodeId


def test_a_file_sets_the_limits_it_names_and_leaves_the_others(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[limits]\nmetrics_a_device_max = 3000\n[thermal]\n")
    limits = limits_of(file)
    assert limits.metrics_a_device_max == 3000
    assert limits.name_bytes_max == DEFAULTS.name_bytes_max
    assert configured(["thermal"], file), "the other readers of the file let the table be"
    assert limits_of(None) is DEFAULTS


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("metrics_max = 1", r"\[limits\] metrics_max is not known; "),
        ("text_bytes_max = 0", r"\[limits\] text_bytes_max = 0 is no whole number from 1"),
        ("text_bytes_max = true", "text_bytes_max = True is no whole number"),
        ('text_bytes_max = "much"', "text_bytes_max = 'much' is no whole number"),
    ],
)
def test_a_limit_that_is_none_is_refused_with_the_way_out(tmp_path: Path, line: str, told: str) -> None:
    file = tmp_path / "processors.toml"
    file.write_text(f"[limits]\n{line}\n")
    with pytest.raises(ConfigurationError, match=told):
        limits_of(file)


def test_the_health_metrics_show_the_first_twenty() -> None:
    rows = [Quarantined(NodeId("cnc", "edge"), f"d{n}", Refusal.NAME, "why", n, 2, True) for n in range(30)]
    health = quarantine_health(rows)
    assert health["quarantined"] == 30
    assert isinstance(health["quarantine"], str)
    assert health["quarantine"].count('"device"') == 20
    assert (
        '{"node": "cnc/edge", "device": "d0", "reason": "name", "text": "why", "since_ms": 0, "count": 2}' in health["quarantine"]
    )


def test_the_page_states_the_defaults() -> None:
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "security.md").read_text(encoding="utf-8")
    for field in fields(DEFAULTS):
        assert f"| `{field.name}` | {getattr(DEFAULTS, field.name):,} |" in page
