"""The life of an alert: dwell, hysteresis, what cannot be read, severity, flapping, machines that go."""

import json
from typing import Any

import pytest

from processors.alarms import alarm_signals
from processors.alerts.body import iso
from processors.alerts.config import AlertsConfig
from processors.alerts.processor import PROCESSOR
from processors.discovery import discover
from sparkplug.quality import Quality
from tests.processors.alerts.courier.alert_shop import SCORE, T0_S, VIBRATION, Shop

LONG = {"signals": {VIBRATION: {"severity": "high", "for_s": 10.0, "keep_firing_for_s": 20.0}}}


def phases(shop: Shop, seconds: int, name: str = "rule_vibration") -> list[str]:
    """The phase at each second, runs of the same one put together."""
    seen: list[str] = []
    for _ in range(seconds):
        shop.wait(1)
        alert = shop.alert(name)
        phase = "none" if alert is None else alert["phase"]
        if seen[-1:] != [phase]:
            seen.append(phase)
    return seen


def test_every_alarm_of_every_processor_is_an_alert() -> None:
    """The rules of the others are declared alarms; what is declared and not watched would be an alarm that nobody is told of."""
    alarms = {spec.name for processor in discover().values() for spec in processor.outputs if spec.is_alarm}
    assert alarms == set(alarm_signals())
    assert set(AlertsConfig().signals) == alarms
    assert PROCESSOR.signals is not None
    assert alarms <= PROCESSOR.signals


def test_an_alarm_pends_for_its_dwell_then_fires_and_is_resolved_after_its_hysteresis() -> None:
    shop = Shop(**LONG)
    shop.set(vibration=True)
    assert phases(shop, 30) == ["pending", "firing"]
    assert shop.alert()["startsAt"] == "2026-11-18T11:06:40.000Z"
    fired_after_s = 11  # the first beat sees it, ten more hold it
    shop = Shop(**LONG)
    shop.set(vibration=True)
    shop.wait(fired_after_s - 1)
    assert shop.alert()["phase"] == "pending"
    shop.wait(1)
    assert shop.alert()["phase"] == "firing"
    shop.set(vibration=False)
    shop.wait(20)
    assert shop.alert()["phase"] == "firing"
    shop.wait(1)
    assert (shop.alert()["phase"], shop.alert()["endsAt"]) == ("resolved", "2026-11-18T11:06:51.000Z")


def test_an_alarm_that_goes_before_its_dwell_was_none() -> None:
    shop = Shop(**LONG)
    shop.set(vibration=True)
    shop.wait(8)
    shop.set(vibration=False)
    shop.wait(300)
    assert shop.alert() is None
    assert shop.told == []


def test_an_alarm_that_comes_back_within_its_hysteresis_never_left() -> None:
    shop = Shop(**LONG)
    shop.set(vibration=True)
    shop.wait(20)
    episode = shop.alert()["episode"]
    for _ in range(5):
        shop.set(vibration=False)
        shop.wait(15)
        shop.set(vibration=True)
        shop.wait(5)
    assert (shop.alert()["phase"], shop.alert()["episode"]) == ("firing", episode)
    assert [one.news for one in shop.told] == [["firing"]]


def test_a_pulse_between_two_beats_is_not_missed() -> None:
    shop = Shop()
    shop.wait(1)
    shop.set(vibration=True)
    shop.set(vibration=False)
    shop.wait(1)
    assert shop.alert()["phase"] == "firing"


@pytest.mark.parametrize(
    ("value", "quality", "reason", "said"),
    [
        (None, Quality.BAD, "a hole of 30 s", "twin/rule_vibration is bad: a hole of 30 s"),
        (None, Quality.GOOD, None, "twin/rule_vibration is null"),
        (True, Quality.STALE, "device offline", "twin/rule_vibration is stale: device offline"),
        (False, Quality.STALE, None, "twin/rule_vibration is stale"),
        (0.0, Quality.GOOD, None, "twin/rule_vibration is neither true nor false"),
    ],
)
def test_what_cannot_be_read_keeps_the_phase_and_says_so(value: Any, quality: Quality, reason: str | None, said: str) -> None:
    shop = Shop(alarm_source_lost=None, **LONG)
    shop.set(vibration=True)
    shop.wait(5)
    shop.set(vibration=value, quality=quality, reason=reason)
    shop.wait(100)
    assert (shop.alert()["phase"], shop.alert()["unknown"]) == ("pending", said)
    shop.set(vibration=True)
    shop.wait(7)  # five seconds of the dwell were seen, and those in which nothing could be read do not count
    assert shop.alert()["phase"] == "firing"
    shop.set(vibration=value, quality=quality, reason=reason)
    shop.wait(1000)
    assert (shop.alert()["phase"], shop.alert()["unknown"]) == ("firing", said)
    assert "now unknown" in shop.metrics["okuma", "twin/alert_summary"]


def test_a_machine_that_is_offline_keeps_its_alerts_and_is_one_itself() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(20)
    row = shop.offline()
    shop.wait(30)
    assert shop.alert("machine_offline")["phase"] == "pending"
    shop.wait(40)
    assert shop.alert("machine_offline")["phase"] == "firing"
    assert shop.alert("machine_offline")["startsAt"] == "2026-11-18T11:07:00.000Z"
    assert (shop.alert()["phase"], shop.alert()["unknown"]) == ("firing", "the machine is offline")
    assert shop.alert()["annotations"]["unknown"] == "the machine is offline"
    shop.rows["okuma"] = row
    shop.wait(70)
    assert shop.alert("machine_offline")["phase"] == "resolved"
    back_after_s = 20 + 30 + 40
    assert shop.alert("machine_offline")["endsAt"] <= iso(round((T0_S + back_after_s + 1) * 1000))  # not when its dwell was over


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("en", "not heard again since the processors started"),
        ("de", "seit dem Start der Prozessoren nicht wieder gehört"),
    ],
)
def test_a_machine_that_is_not_heard_after_a_restart_is_not_said_to_be_offline(language: str, said: str) -> None:
    shop = Shop(language=language)
    shop.set(vibration=True)
    shop.wait(20)
    shop.restarted()
    shop.rows.clear()  # its birth has not come yet
    shop.wait(5)
    assert shop.alert()["annotations"]["unknown"] == said


def test_the_control_says_how_severe_its_own_alarm_is() -> None:
    shop = Shop(quiet_hours=[{"time_zone": "UTC", "start": "00:00", "end": "23:59"}])
    text = {"twin/control_alarm_text": "EX1012 SPINDLE LUBRICATION FAILURE"}
    shop.set(**text, **{"twin/control_alarm_findings": '{"severity":"medium","line":52}'})
    shop.set(**{"twin/control_alarm": True})
    assert shop.wait(30) == []
    assert shop.alert("control_alarm")["severity"] == "medium"
    shop.set(**{"twin/control_alarm_findings": '{"severity":"high","line":52}'})
    (told,) = shop.wait(30)
    assert (told.severity, shop.alert("control_alarm")["severities"]) == ("high", ["medium", "high"])
    assert "line 52" in told.text.lower()


def test_a_machine_offline_for_less_than_its_dwell_wakes_nobody() -> None:
    shop = Shop()
    shop.set(vibration=False)
    shop.wait(5)
    for _ in range(10):
        row = shop.offline()
        shop.wait(50)
        shop.rows["okuma"] = row
        shop.wait(20)
    assert shop.told == []


def test_when_what_watches_is_gone_while_the_machine_is_there_that_is_an_alert() -> None:
    shop = Shop()
    shop.set(vibration=False, score=False)
    shop.wait(5)
    shop.set(score=False, quality=Quality.STALE, reason="device offline")
    shop.wait(140)
    assert shop.alert("alarm_source_lost")["phase"] == "firing"
    shop.set(score=False)
    shop.wait(70)
    assert shop.alert("alarm_source_lost")["phase"] == "resolved"


def test_the_score_alone_is_medium_and_high_once_a_rule_fires_on_the_same_machine() -> None:
    shop = Shop()
    shop.set(score=True)
    shop.set("mazak", score=True)
    shop.wait(5)
    assert shop.alert("anomaly_alarm")["severity"] == "medium"
    shop.set(vibration=True)
    shop.wait(2)
    assert (shop.alert("anomaly_alarm")["severity"], shop.alert()["severity"]) == ("high", "high")
    assert shop.alert("anomaly_alarm", "mazak")["severity"] == "medium"
    shop.set(vibration=False)
    shop.wait(100)
    assert shop.alert("anomaly_alarm")["severity"] == "high"  # within an episode it only rises


def test_the_severity_that_rules_publish_raises_too() -> None:
    shop = Shop()
    shop.set(score=True, severity="medium")
    shop.wait(2)
    assert shop.alert("anomaly_alarm")["severity"] == "medium"
    shop.set(severity="high")
    shop.wait(2)
    assert shop.alert("anomaly_alarm")["severities"] == ["medium", "high"]


def test_an_acknowledgement_of_the_lesser_severity_does_not_hold_for_the_greater() -> None:
    shop = Shop()
    shop.set(score=True)
    shop.wait(15)
    assert shop.command("ack", fingerprint=shop.fingerprint("anomaly_alarm"))["done"]
    shop.wait(2)
    assert shop.alert("anomaly_alarm")["phase"] == "acknowledged"
    shop.set(severity="high")
    shop.wait(15)
    assert shop.alert("anomaly_alarm")["phase"] == "firing"
    assert shop.told[-1].news == ["raised"]


def test_an_alert_that_flaps_is_kept_firing_until_it_is_quiet() -> None:
    """alertmanager #3048: every 20 minutes for 10 minutes, a hundred alerts a day; the alert is to be held open."""
    shop = Shop()
    for _ in range(24):
        shop.set(vibration=True)
        shop.wait(600, beat_s=5.0)
        shop.set(vibration=False)
        shop.wait(600, beat_s=5.0)
    assert len([one for one in shop.told if "firing" in one.news]) == 4
    assert (shop.alert()["phase"], shop.alert()["flapping"]) == ("firing", True)
    shop.wait(7300, beat_s=5.0)
    assert shop.alert()["phase"] == "resolved"


def test_a_clock_that_is_set_back_or_leaps_starts_and_ends_nothing() -> None:
    shop = Shop(**LONG)
    shop.set(vibration=True)
    shop.wait(5)
    shop.wall_s -= 3600.0
    shop.beat()
    shop.wait(4)
    assert shop.alert()["phase"] == "pending"
    shop.wait(5)
    assert shop.alert()["phase"] == "firing"
    shop.set(vibration=False)
    shop.beat()
    shop.wall_s += 7200.0
    shop.beat()
    assert shop.alert()["phase"] == "firing"  # of the two hours only five seconds were watched


def test_an_alarm_that_cannot_be_read_for_a_week_is_given_up() -> None:
    shop = Shop(forget_after_s=3600.0)
    shop.set(vibration=True)
    shop.wait(5)
    shop.set(vibration=None)
    shop.wait(3700, beat_s=5.0)
    assert shop.alert()["phase"] == "resolved"
    shop.wait(30_000, beat_s=5.0)
    assert shop.state.alerts == {}


def test_a_machine_that_was_taken_away_is_forgotten() -> None:
    shop = Shop(forget_after_s=3600.0)
    shop.set(vibration=True)
    shop.wait(5)
    shop.offline()
    shop.wait(3800, beat_s=5.0)
    assert {alert.phase.value for alert in shop.state.alerts.values()} == {"resolved"}
    shop.wait(30_000, beat_s=5.0)
    assert (shop.state.alerts, shop.state.machines) == ({}, {})


def test_three_metrics_tell_each_machine_its_alerts() -> None:
    shop = Shop()
    shop.set(vibration=True, score=False)
    shop.set("mazak", vibration=False)
    shop.wait(3)
    assert shop.metrics["okuma", "twin/alert_state"] == "firing"
    assert shop.metrics["okuma", "twin/alerts_firing"] == 1
    assert shop.metrics["okuma", "twin/alert_summary"] == "high: rule_vibration firing since 2026-11-18T11:06:40.000Z"
    assert shop.metrics["mazak", "twin/alert_state"] == "none"
    shop.command("ack", fingerprint=shop.fingerprint())
    shop.wait(1)
    assert shop.metrics["okuma", "twin/alert_state"] == "acknowledged"


def test_what_the_machine_was_doing_is_said() -> None:
    shop = Shop()
    shop.set(program="O1234", tool_number=7)
    shop.set(vibration=True)
    (told,) = shop.wait(15)
    assert told.body["alerts"][0]["annotations"]["description"] == "program O1234, tool 7"
    assert told.text.startswith("Program O1234, tool 7\n")


def test_a_score_says_why_it_alarms_and_another_alarm_does_not() -> None:
    why = {"signal": "spindle_load_pct", "measured": 44.0, "expected": 40.0, "unit": "%", "by": "12 parts", "lines": [210, 260]}
    why["like"] = [{"label": "packed chips", "likeness": 0.91, "at_s": 1.0}]
    shop = Shop()
    shop.set(program="O1234", tool_number=7, **{"twin/anomaly_why": json.dumps(why)})
    shop.set(score=True, vibration=True)
    told = [alert for notification in shop.wait(120) for alert in notification.body["alerts"]]
    said = {alert["labels"]["alertname"]: alert["annotations"]["description"] for alert in told}
    reason = "lines 210–260, looks like packed chips (0.91), no peer shows it"
    assert any(alert["annotations"]["summary"] == "okuma: Spindle load 10 % above the last 12 parts" for alert in told)
    assert said["anomaly_alarm"] == f"{reason}, program O1234, tool 7"
    assert said["rule_vibration"] == "program O1234, tool 7"


@pytest.mark.parametrize("text", ["{", "[]", '"x"', '{"signal": 3}', "[" * 5000])
def test_a_reason_that_is_none_is_left_out(text: str) -> None:
    shop = Shop()
    shop.set(program="O1234", **{"twin/anomaly_why": text})
    shop.set(score=True)
    told = shop.wait(120)
    assert told[0].body["alerts"][0]["annotations"]["description"] == "program O1234"


def test_history_wakes_nobody() -> None:
    from processors.alerts.processor import step
    from processors.contract import Sample, SampleKind

    shop = Shop()
    sample = Sample("okuma", SampleKind.DATA, T0_S, {}, (SCORE,), is_history=True)
    assert step(shop.configuration, shop.state, sample) == (shop.state, ())
