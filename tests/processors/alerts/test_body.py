"""What a notification says, in Alertmanager's words."""

import json

from processors.alerts.words.language import language
from tests.processors.alerts.courier.alert_shop import VIBRATION, Shop
from twin.vocabulary.twin_signals import RULE_FINDINGS


def test_the_body_is_that_of_alertmanagers_webhook_version_4() -> None:
    shop = Shop(labels={"site": "north"}, external_url="https://twin.plant.example")
    shop.set(vibration=True)
    (told,) = shop.wait(20)
    (alert,) = told.body["alerts"]
    labels = {"alertname": "rule_vibration", "machine": "okuma", "signal": VIBRATION, "severity": "high", "site": "north"}
    assert told.body == {
        "version": "4",
        "groupKey": "{}/{receiver='desk'}:{machine='okuma'}",
        "truncatedAlerts": 0,
        "status": "firing",
        "receiver": "desk",
        "groupLabels": {"machine": "okuma"},
        "commonLabels": labels,
        "commonAnnotations": alert["annotations"],
        "externalURL": "https://twin.plant.example",
        "alerts": [alert],
    }
    assert alert == {
        "status": "firing",
        "labels": labels,
        "annotations": {"summary": "okuma: Vibration too high", "advice": language("en").alerts["rule_vibration"].advice},
        "startsAt": "2026-11-18T11:06:40.000Z",
        "endsAt": "0001-01-01T00:00:00Z",
        "generatorURL": "https://twin.plant.example/#/replay/okuma?from=1794999700000&to=1795000300000&at=1795000000000",
        "fingerprint": shop.fingerprint(),
        "episode": 1_795_000_000_000,
    }


def test_a_beginning_is_when_it_began_to_be_so_wherever_it_is_told() -> None:
    shop = Shop()
    since_ms = 1_795_000_000_000 - 5000
    shop.set(load=True, **{RULE_FINDINGS: json.dumps({"load_over_limit": {"value": 112, "limit": 100, "since": since_ms}})})
    (told,) = shop.wait(20)
    began = "2026-11-18T11:06:35.000Z"
    assert told.body["alerts"][0]["startsAt"] == shop.alert("rule_load_over_limit")["startsAt"] == began
    assert f"since {began}" in shop.metrics["okuma", "twin/alert_summary"]
    shop.set(load=False)
    (over,) = shop.wait(400)
    (alert,) = over.body["alerts"]
    assert alert["annotations"]["summary"] == "okuma: Over after 25 s: spindle load over its limit"
    assert (alert["startsAt"], alert["endsAt"]) == (began, "2026-11-18T11:07:00.000Z")
    assert over.text.startswith("From 2026-11-18 11:06:35 UTC to 2026-11-18 11:07:00 UTC")


def test_a_body_holds_fifty_alerts_and_says_how_many_more_there_are() -> None:
    shop = Shop(group_by="all")
    for number in range(60):
        shop.set(f"m{number:02d}", score=True)
    (told,) = shop.wait(30)
    assert (len(told.body["alerts"]), told.body["truncatedAlerts"], len(told.news)) == (50, 10, 60)
