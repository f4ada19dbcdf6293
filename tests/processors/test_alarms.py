"""The alarms that are declared: who reads them, and what becomes of them where a processor is broken."""

import logging
from collections.abc import Iterator

import pytest

from processors import alarms
from processors.alarms import alarm_signals, machine_alarms, unknown_processors
from processors.alerts.config import AlertsConfig
from processors.alerts.processor import PROCESSOR as ALERTS
from processors.discovery import AnyProcessor, find
from processors.events.processor import PROCESSOR as EVENTS
from processors.historian import HistorianConfig
from twin.vocabulary.twin_signals import (
    ANOMALY_ALARM,
    CONTROL_ALARM,
    GAP_GROWING,
    MACHINE_DRIFT,
    RULES,
    SCORE_DRIFT,
    TOOL_WEARS_FAST,
)


@pytest.fixture
def broken_rules(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A module of the processor `rules` that fails when it is imported."""

    def find_or_fail(name: str) -> AnyProcessor:
        if name == "rules":
            raise ModuleNotFoundError("No module named 'spindles'")
        return find(name)

    monkeypatch.setattr(alarms, "find", find_or_fail)
    alarms._declared.cache_clear()
    machine_alarms.cache_clear()
    yield
    alarms._declared.cache_clear()
    machine_alarms.cache_clear()


def test_every_alarm_of_the_machine_pins_its_data_and_stands_in_the_records_of_its_parts() -> None:
    """The drift of a score is the model's, and asks for training."""
    assert set(alarm_signals()) == {
        *(ANOMALY_ALARM, CONTROL_ALARM, GAP_GROWING, MACHINE_DRIFT, SCORE_DRIFT, TOOL_WEARS_FAST, *RULES)
    }
    assert unknown_processors() == ()
    assert set(machine_alarms()) == set(alarm_signals()) - {SCORE_DRIFT}
    assert HistorianConfig().flags == machine_alarms()
    assert EVENTS.signals is not None and EVENTS.inputs is not None
    assert set(alarm_signals()) & EVENTS.signals == set(machine_alarms())


def test_a_processor_that_cannot_be_imported_is_named_once_and_the_others_alarms_stay(
    broken_rules: None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert set(alarm_signals()) == {ANOMALY_ALARM, CONTROL_ALARM, GAP_GROWING, MACHINE_DRIFT, SCORE_DRIFT, TOOL_WEARS_FAST}
        assert set(alarm_signals()) == set(machine_alarms()) | {SCORE_DRIFT}
    assert [one.getMessage() for one in caplog.records] == [
        "processor rules cannot be imported, its alarms are not known: ModuleNotFoundError: No module named 'spindles'"
    ]
    assert unknown_processors() == ("rules",)


def test_alerts_go_on_without_a_processor_that_cannot_be_imported(broken_rules: None) -> None:
    """It may well run elsewhere: its alarms are watched as far as their names are known."""
    assert set(RULES) < set(AlertsConfig().signals)
    own = {"twin/rule_of_our_own": {"severity": "high"}}
    assert {*RULES, *own} < set(AlertsConfig.model_validate({"signals": own}).signals)
    assert ALERTS.signals is not None
    assert {ANOMALY_ALARM, GAP_GROWING, SCORE_DRIFT, *RULES} < ALERTS.signals
