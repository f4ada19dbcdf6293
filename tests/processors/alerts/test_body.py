"""What a notification says, in Alertmanager's words."""

from processors.alerts.words.language import language
from tests.processors.alerts.courier.alert_shop import VIBRATION, Shop


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
    }


def test_a_body_holds_fifty_alerts_and_says_how_many_more_there_are() -> None:
    shop = Shop(group_by="all")
    for number in range(60):
        shop.set(f"m{number:02d}", score=True)
    (told,) = shop.wait(30)
    assert (len(told.body["alerts"]), told.body["truncatedAlerts"], len(told.news)) == (50, 10, 60)
