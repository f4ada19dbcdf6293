"""A wrong configuration of the alerts is refused, and no secret is repeated."""

import tomllib
from typing import Any

import pytest

from processors.alerts.config import AlertsConfig
from processors.alerts.processor import PROCESSOR
from processors.alerts.state import Severity
from processors.config import Configuration
from processors.discovery import sample_configuration
from processors.errors import ConfigurationError
from sparkplug.quality import Quality
from tests.processors.alerts.courier.alert_shop import DESK, VIBRATION, Shop


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"signals": {"twin/nonsense": {"severity": "high"}}}, "'twin/nonsense' is no alarm signal"),
        ({"routes": [{"receivers": ["nobody"]}]}, "there is no receiver 'nobody'"),
        ({"heartbeat": {"receiver": "nobody"}}, "heartbeat: there is no receiver"),
        ({"cells": {"a": ["okuma"]}}, "alerts watch all machines together"),
        ({"labels": {"machine": "x"}}, "labels: 'machine'"),
        ({"quiet_hours": [{"time_zone": "Mars/Olympus", "start": "22:00", "end": "06:00"}]}, "no time zone 'Mars/Olympus'"),
        ({"quiet_hours": [{"time_zone": "UTC", "start": "25:00", "end": "06:00"}]}, "'25:00' is no time of the day"),
        ({"receivers": {"a b": DESK["desk"]}}, "receivers: 'a b'"),
    ],
)
def test_a_wrong_configuration_says_what_is_wrong(table: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        Configuration(AlertsConfig, table, name="alerts")
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("receiver", "said"),
    [
        ({"type": "pushover", "token": "hunter2", "user": "$U"}, "a secret does not stand in the configuration"),
        ({"type": "pushover", "token": "$T", "user": "$U", "password": "hunter2"}, "receivers.x.pushover.password is not known"),
        ({"type": "webhook", "url": "https://ada:hunter2@plant.example/x"}, "holds a user name or a password"),
        ({"type": "webhook", "url": "https://plant.example/x?key=hunter2"}, "has a query"),
        ({"type": "webhook", "url": "http://plant.example/hunter2"}, "is not encrypted: use https://"),
        ({"type": "webhook", "url": "ftp://plant.example/hunter2"}, "is not https://"),
        ({"type": "apprise", "url": "pover://hunter2@hunter2"}, "a secret does not stand in the configuration"),
        ({"type": "hunter2"}, "receivers.x"),
    ],
)
def test_a_secret_in_the_configuration_is_refused_and_not_repeated(receiver: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        Configuration(AlertsConfig, {"receivers": {"x": receiver}}, name="alerts")
    assert said in str(error.value)
    if receiver["type"] != "hunter2":
        assert "hunter2" not in str(error.value)


def test_the_alerts_that_the_sample_shows_are_the_defaults() -> None:
    """They stand there as comments, so that an alarm that a processor adds is an alert without a line there."""
    lines = sample_configuration(PROCESSOR).read_text(encoding="utf-8").splitlines()
    shown = [line.removeprefix("# ") for line in lines if line.startswith(('# "twin/', "# [alerts.signals]"))]
    table = tomllib.loads("\n".join(shown))["alerts"]
    defaults = AlertsConfig()
    assert set(table["signals"]) == set(defaults.signals)
    assert AlertsConfig.model_validate(table).signals.items() <= defaults.signals.items()


def test_an_entry_changes_what_it_gives_and_no_other_alert() -> None:
    defaults = AlertsConfig().signals
    given = AlertsConfig.model_validate({"signals": {"twin/score_drift": {"severity": "medium"}}})
    changed = defaults["twin/score_drift"].model_copy(update={"severity": Severity.MEDIUM})
    assert given.signals == {**defaults, "twin/score_drift": changed}


def test_what_is_not_enabled_is_no_alert() -> None:
    shop = Shop(
        signals={VIBRATION: {"enabled": False}},
        machine_offline={"severity": "medium", "enabled": False},
        alarm_source_lost={"severity": "medium", "enabled": False},
    )
    shop.set(vibration=True)
    shop.set(drift=False, quality=Quality.STALE)
    shop.set(load=True)
    shop.wait(200)
    shop.offline()
    shop.wait(200)
    assert {one["labels"]["alertname"] for one in shop.shown()["alerts"]} == {"rule_load_over_limit"}
