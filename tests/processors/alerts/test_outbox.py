"""Killed after it told something and before it saved that: what a fold reads in its outbox when it comes back."""

import json

from processors.alerts.courier.desk import Desk
from processors.alerts.messages import OUTBOX
from processors.alerts.notification import Notification
from processors.alerts.phases import Beat, caught_up
from processors.alerts.state import Alert, AlertsState, Phase, Severity
from tests.processors.alerts.courier.alert_shop import VIBRATION, Shop
from twin.vocabulary.twin_signals import RULE_FINDINGS

BRIEF = {"signals": {VIBRATION: {"severity": "medium", "keep_firing_for_s": 5.0}}, "group_interval_s": 10.0}
BEAT = Beat(1_795_000_000.0, 100.0, 0.0)


def back(shop: Shop, snapshot: AlertsState) -> None:
    """The fold comes back with this snapshot, and is given what the broker retains of its outbox."""
    shop.state = snapshot
    for topic, payload in list(shop.retained.items()):
        if topic.startswith(OUTBOX):
            shop.plain(topic, payload.decode())


def test_an_alarm_that_stands_again_after_its_end_was_told_is_an_episode_of_its_own() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(vibration=True)
    shop.wait(30)
    first = shop.alert()["episode"]
    shop.set(vibration=False)
    shop.wait(4)
    snapshot = shop.state  # still firing
    shop.wait(3)
    assert shop.alert()["phase"] == "resolved"
    shop.wait(10)
    shop.set(vibration=True)
    again_ms = round(shop.wall_s * 1000)
    back(shop, snapshot)
    shop.wait(30)
    said = [one for payload in outbox(shop) for one in payload["says"]]
    assert [one.split(".")[1:4] for one in said] == [
        [str(first), "firing", "0"],
        [str(first), "resolved", "1"],
        [str(again_ms), "firing", "0"],
    ]


def test_the_end_of_what_was_told_is_told_though_the_snapshot_knew_nothing_of_it() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set("okuma", vibration=False, program="O1000")
    shop.wait(2)
    snapshot = shop.state
    shop.set("okuma", vibration=True)
    shop.wait(11)
    shown = shop.alert()
    assert shown["phase"] == "firing"
    shop.set("okuma", vibration=False)
    back(shop, snapshot)
    shop.wait(1)
    assert {name: shop.alert()[name] for name in ("labels", "phase", "startsAt", "annotations")} == {
        name: shown[name] for name in ("labels", "phase", "startsAt", "annotations")
    }
    shop.wait(30)
    assert [one.split(".")[2] for payload in outbox(shop) for one in payload["says"]] == ["firing", "resolved"]


def test_what_a_notification_tells_of_its_beginning_is_known_again() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(load=False)
    shop.wait(2)
    snapshot = shop.state
    since_ms = round(shop.wall_s * 1000) - 5000
    shop.set(load=True, **{RULE_FINDINGS: json.dumps({"load_over_limit": {"value": 112, "limit": 100, "since": since_ms}})})
    shop.wait(11)
    shown = shop.alert("rule_load_over_limit")
    shop.set(load=False)
    back(shop, snapshot)
    shop.wait(1)
    again = shop.alert("rule_load_over_limit")
    assert (again["startsAt"], again["episode"]) == (shown["startsAt"], shown["episode"])


def test_what_was_told_before_the_snapshot_changes_no_alert() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(vibration=True)
    shop.wait(11)
    ((topic, payload),) = [item for item in shop.retained.items() if item[0].startswith(OUTBOX)]
    shop.set(vibration=False)
    shop.wait(30)
    before = shop.state.alerts
    shop.state = AlertsState(wall_s=shop.wall_s, clock_s=shop.state.clock_s)
    shop.plain(topic, payload.decode())
    assert before != {}
    assert shop.state.alerts == {}


def test_labels_that_are_not_those_of_the_fingerprint_make_no_alert() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(vibration=True)
    snapshot = shop.state
    shop.wait(11)
    ((topic, payload),) = [item for item in shop.retained.items() if item[0].startswith(OUTBOX)]
    forged = json.loads(payload)
    forged["body"]["alerts"][0]["labels"]["machine"] = "mazak"
    shop.state = snapshot
    shop.plain(topic, json.dumps(forged))
    assert shop.state.alerts == {}
    assert shop.state.malformed == 0


def test_an_alert_is_never_taken_back() -> None:
    """Whatever it was told of, in any order: it ends as far as the latest of it."""
    fresh = Alert("okuma", "rule_vibration", VIBRATION, "f", Severity.LOW, 0)
    fires = caught_up(fresh, Severity.MEDIUM, 1000, None, BEAT)
    assert (fires.phase, fires.episode, fires.severity) == (Phase.FIRING, 1000, Severity.MEDIUM)
    over = caught_up(fires, Severity.MEDIUM, 1000, 5000, BEAT)
    assert (over.phase, over.ended_ms) == (Phase.RESOLVED, 5000)
    assert caught_up(over, Severity.HIGH, 1000, None, BEAT) == over
    next_one = caught_up(over, Severity.LOW, 9000, None, BEAT)
    assert (next_one.phase, next_one.episode, next_one.severity) == (Phase.FIRING, 9000, Severity.LOW)
    assert caught_up(next_one, Severity.LOW, 1000, 5000, BEAT) == next_one
    assert caught_up(fresh, Severity.MEDIUM, 1000, 5000, BEAT) == over
    assert caught_up(fires, Severity.HIGH, 1000, None, BEAT).severity is Severity.HIGH


def test_one_that_pends_fires_where_that_was_told() -> None:
    pending = Alert("okuma", "rule_vibration", VIBRATION, "f", Severity.LOW, 1000, phase=Phase.PENDING)
    fires = caught_up(pending, Severity.LOW, 1000, None, BEAT)
    assert (fires.phase, fires.rises_s) == (Phase.FIRING, (100.0,))


def outbox(shop: Shop) -> list[dict[str, list[str]]]:
    found = [json.loads(payload) for topic, payload in shop.retained.items() if topic.startswith(OUTBOX)]
    return sorted(found, key=lambda one: str(one["created"]))


def test_what_is_written_is_read_again_by_the_one_parser() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(vibration=True)
    shop.wait(11)
    (payload,) = outbox(shop)
    read = Notification.of(json.dumps(payload))
    names = ("id", "receiver", "kind", "severity", "title", "text", "created", "expires_s", "body")
    assert {name: getattr(read, name) for name in names} == {name: payload[name] for name in names}
    assert [statement.text for statement in read.statements] == list(read.says) == payload["says"]


def test_what_is_no_notification_is_refused_by_the_processor_and_by_the_courier() -> None:
    shop = Shop(delivers=False, **BRIEF)
    shop.set(vibration=True)
    shop.wait(11)
    (payload,) = outbox(shop)
    broken = [{**payload, "says": ["fp.now.firing.0.high"]}, {**payload, "body": {"alerts": [{}]}}]
    broken += [{key: value for key, value in payload.items() if key != name} for name in ("title", "expires_s", "body")]
    for number, document in enumerate(broken):
        text = json.dumps({**document, "id": f"{number}"})
        desk = Desk("here", {})
        desk.outbox(f"{number}", text.encode())
        shop.plain(f"{OUTBOX}{number}", text)
        assert (desk.malformed, shop.state.malformed) == (1, number + 1)
