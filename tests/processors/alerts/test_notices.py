"""Who is told what, when, and how often."""

from datetime import UTC, datetime
from typing import Any

from tests.processors.alerts.courier.alert_shop import DESK, LOAD, PHONE, SCORE, T0_S, VIBRATION, Shop

BRISK = {"keep_firing_for_s": 0.0}
FLAPPY = {"signals": {VIBRATION: {"severity": "high", **BRISK}, "twin/anomaly_alarm": {"severity": "medium", **BRISK}}}


NIGHT = {"time_zone": "Europe/Berlin", "start": "22:00", "end": "06:00"}


def at(shop: Shop, hour: int, minute: int = 0) -> None:
    """Turn the clock to a time in Berlin on the next day."""
    shop.wall_s = datetime(2026, 11, 19, hour - 1, minute, tzinfo=UTC).timestamp()
    shop.beat()


def news(told: list[Any]) -> list[list[str]]:
    return [one.news for one in told]


def test_one_firing_is_one_notification_and_its_end_another() -> None:
    shop = Shop()
    shop.set(vibration=True)
    assert news(shop.wait(600)) == [["firing"]]
    shop.set(vibration=False)
    assert news(shop.wait(600)) == [["resolved"]]
    assert news(shop.wait(3600, beat_s=30.0)) == []


def test_what_happens_together_on_a_machine_is_told_together() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.set("mazak", vibration=True)
    shop.wait(4)
    shop.set(load=True)
    told = shop.wait(60)
    assert sorted((one.title, *one.news) for one in told) == [
        ("mazak: Vibration too high for 10 s", "firing"),
        ("okuma: Spindle load over its limit for 6 s (+1 more)", "firing", "firing"),
    ]
    assert all(one.at_s == 11 for one in told)  # group_wait_s after the first beat that saw it


def test_all_machines_may_be_told_together() -> None:
    shop = Shop(group_by="all")
    for machine in ("okuma", "mazak", "haas"):
        shop.set(machine, score=True)
    (told,) = shop.wait(60)
    assert told.title == "3 alerts on 3 machines: haas: Machine behaves unusually for 10 s"
    assert (told.body["groupLabels"], told.body["commonLabels"]["alertname"]) == ({}, "anomaly_alarm")


def test_more_of_a_group_waits_for_its_interval_but_a_high_alert_does_not() -> None:
    shop = Shop()
    shop.set(score=True)
    assert [one.at_s for one in shop.wait(20)] == [11]
    shop.set(drift=True)
    assert [one.at_s for one in shop.wait(400)] == [311]
    shop.set(vibration=True)
    (told,) = shop.wait(30)
    assert told.at_s == 431
    assert told.news == ["firing", "raised"]
    assert len(told.body["alerts"]) == 3  # what else fires stands beside what is new


def test_what_still_fires_is_repeated_and_what_is_acknowledged_is_not() -> None:
    shop = Shop(repeat_interval_s=3600.0)
    shop.set(vibration=True)
    assert news(shop.wait(3 * 3600 + 60, beat_s=5.0)) == [["firing"], ["repeat"], ["repeat"], ["repeat"]]
    shop.command("ack", fingerprint=shop.fingerprint())
    assert shop.wait(3 * 3600, beat_s=5.0) == []
    shop.set(vibration=False)
    assert news(shop.wait(400)) == [["resolved"]]


# The pains of peers.


def test_every_firing_is_told_also_where_ends_are_not_wanted() -> None:
    """alertmanager #1063: with send_resolved = false a second firing was never told."""
    shop = Shop(**FLAPPY, flap_episodes=50, receivers={"desk": DESK["desk"] | {"send_resolved": False}})
    for _ in range(4):
        shop.set(vibration=True)
        assert news(shop.wait(300)) == [["firing"]]
        shop.set(vibration=False)
        assert news(shop.wait(300)) == []


def test_the_repeat_interval_holds_for_an_alert_that_flaps() -> None:
    """alertmanager #3846: an alert that fires every half an hour is told each time, whatever repeat_interval says."""
    shop = Shop(**FLAPPY, repeat_interval_s=76 * 3600.0)
    for _ in range(20):
        shop.set(vibration=True)
        shop.wait(900, beat_s=5.0)
        shop.set(vibration=False)
        shop.wait(900, beat_s=5.0)
    firings = [one.at_s for one in shop.told if "firing" in one.news]
    assert len(firings) == 4  # until it is known to flap; then it is one firing, to be repeated after 76 hours
    assert firings[-1] < 2 * 3600


def test_an_alert_that_is_resolved_while_silenced_is_told_when_it_fires_again() -> None:
    """grafana #80996: its next firing was not told until repeat_interval had passed."""
    shop = Shop()
    shop.set(vibration=True)
    assert news(shop.wait(60)) == [["firing"]]
    assert shop.command("silence", matchers={"machine": "okuma"}, for_s=600.0)["done"]
    shop.set(vibration=False)
    assert shop.wait(300) == []
    assert shop.alert()["phase"] == "resolved"
    shop.command("unsilence", silence=shop.state.silences[0].id)
    shop.set(vibration=True)
    (told,) = shop.wait(60)
    assert [said.split(".")[2] for said in told.says] == ["resolved", "firing"]
    assert [alert["status"] for alert in told.body["alerts"]] == ["resolved", "firing"]


def test_a_notification_for_each_flap_is_not_sent() -> None:
    """alertmanager #3048: on and off every ten seconds for an hour."""
    shop = Shop(**FLAPPY)
    for _ in range(180):
        shop.set(vibration=True)
        shop.wait(10)
        shop.set(vibration=False)
        shop.wait(10)
    assert len(shop.told) <= 4


# Silences.


def test_a_silence_matches_by_labels_with_wildcards_and_ends_by_itself() -> None:
    shop = Shop()
    assert shop.command("silence", matchers={"machine": "ok*", "alertname": "rule_*"}, for_s=100.0, comment="new tool")["done"]
    shop.set(vibration=True, drift=True)
    shop.set("mazak", vibration=True)
    told = shop.wait(60)
    drifts = "okuma: Scores have drifted for 10 s: the model no longer fits the machine"
    assert sorted(one.title for one in told) == ["mazak: Vibration too high for 10 s", drifts]
    silence = shop.state.silences[0]
    assert shop.alert()["silenced_by"] == silence.id
    shown = shop.shown()["silences"][0]
    assert (shown["by"], shown["comment"]) == ("ada", "new tool")
    assert [one.title for one in shop.wait(300)] == ["okuma: Vibration too high for 1 min 49 s (+1 more)"]
    assert shop.shown()["silences"] == []


def test_an_end_that_falls_into_a_silence_is_told_after_it() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(60)
    shop.command("silence", matchers={"machine": "okuma"}, for_s=1000.0)
    shop.set(vibration=False)
    assert shop.wait(900) == []
    assert news(shop.wait(200)) == [["resolved"]]


def test_what_comes_and_goes_within_a_silence_is_never_told() -> None:
    shop = Shop(**FLAPPY)
    shop.command("silence", matchers={"machine": "okuma"}, for_s=300.0)
    shop.set(vibration=True)
    shop.wait(60)
    shop.set(vibration=False)
    assert shop.wait(3600) == []


# What is over before it was told.


def test_an_alert_that_is_over_before_its_group_was_told_is_told_all_the_same() -> None:
    shop = Shop(**FLAPPY)
    shop.wait(1)
    shop.set(vibration=True)
    shop.wait(3)
    shop.set(vibration=False)
    (told,) = shop.wait(60)
    assert (told.news, told.title) == (["passed"], "okuma: Over after 3 s: vibration too high")
    assert told.text == "From 2026-11-18 11:06:41 UTC to 2026-11-18 11:06:44 UTC"
    assert shop.wait(3600, beat_s=30.0) == []


def test_what_is_over_at_the_end_of_quiet_hours_is_not_told_unless_it_was_high() -> None:
    shop = Shop(quiet_hours=[NIGHT], **FLAPPY)
    at(shop, 23)
    for _ in range(2):
        shop.set(score=True)
        shop.set("mazak", vibration=True)
        shop.wait(3)
        shop.set(score=False)
        shop.set("mazak", vibration=False)
        shop.wait(400)
    told = shop.wait(8 * 3600, beat_s=30.0)
    assert told == []
    assert [(one.title, one.news) for one in shop.told] == [("mazak: Over after 3 s: vibration too high", ["passed"])] * 2


# Escalation.


LADDER = {"receivers": DESK | PHONE, "routes": [{"receivers": ["desk"], "escalation": [{"receiver": "phone", "after_s": 600.0}]}]}


def test_what_nobody_acknowledges_goes_to_the_next() -> None:
    shop = Shop(**LADDER)
    shop.set(vibration=True)
    told = shop.wait(900)
    assert [(one.receiver, one.at_s) for one in told] == [("desk", 11), ("phone", 611)]
    shop.set(vibration=False)
    assert sorted((one.receiver, *one.news) for one in shop.wait(400)) == [("desk", "resolved"), ("phone", "resolved")]


def test_what_is_acknowledged_in_time_goes_to_nobody_else() -> None:
    shop = Shop(**LADDER)
    shop.set(vibration=True)
    shop.wait(500)
    shop.command("ack", fingerprint=shop.fingerprint())
    assert shop.wait(3600, beat_s=30.0) == []


def test_what_could_not_be_delivered_goes_to_the_next_at_once() -> None:
    shop = Shop(**LADDER)
    shop.fails["desk"] = "desk.plant.example answered 401"
    shop.set(vibration=True)
    told = shop.wait(60)
    assert [one.receiver for one in told] == ["desk", "phone"]
    (failure,) = shop.shown()["failures"]
    assert (failure["receiver"], failure["reason"]) == ("desk", "desk.plant.example answered 401")
    assert shop.shown()["receivers"]["desk"]["last_error"] == "desk.plant.example answered 401"
    assert shop.alert()["undelivered"] is True


def test_routes_pick_by_machine_name_and_severity() -> None:
    routes = [{"receivers": ["desk"], "machines": ["okuma"]}, {"receivers": ["phone"], "severity_min": "high"}]
    shop = Shop(receivers=DESK | PHONE, routes=routes)
    shop.set("okuma", score=True)
    shop.set("mazak", score=True)
    shop.set("haas", vibration=True)
    assert sorted((one.receiver, one.title.split()[0]) for one in shop.wait(60)) == [("desk", "okuma:"), ("phone", "haas:")]


# Rate limits.


def test_what_the_rate_limit_holds_back_is_counted_and_said_and_high_has_a_limit_of_its_own() -> None:
    shop = Shop(receivers={"desk": DESK["desk"] | {"rate_per_hour": 5}})
    for number in range(12):
        shop.set(f"m{number}", score=True)
        shop.wait(30)
    assert len(shop.told) == 5
    assert shop.shown()["receivers"]["desk"]["held_back"] == 7
    shop.set("m0", vibration=True)
    (told,) = shop.wait(30)
    assert "severity high" in told.text
    assert told.text.endswith("7 notifications were held back before this one")
    later = shop.wait(7300, beat_s=30.0)
    assert {one.title.split()[0] for one in later} == {f"m{number}:" for number in range(5, 12)}  # each of them in the end


def test_high_alerts_are_limited_only_far_beyond_what_a_shop_brings() -> None:
    shop = Shop(receivers={"desk": DESK["desk"] | {"rate_per_hour": 1, "rate_high_per_hour": 60}})
    for number in range(80):
        shop.set(f"m{number}", vibration=True)
        shop.wait(11)
    shop.wait(60)
    assert len(shop.told) == 60
    assert shop.shown()["receivers"]["desk"]["held_back"] == 20


def test_a_flood_of_alerts_of_many_machines_is_one_notification_a_minute_and_buries_nobody() -> None:
    shop = Shop(receivers={"desk": DESK["desk"] | {"rate_per_hour": 5, "rate_high_per_hour": 60}})
    shop.set("okuma", vibration=False)
    shop.beat()
    for number in range(300):
        shop.set(f"hostile-{number}", vibration=True)
    shop.wait(11)
    assert len(shop.told) == 1
    assert shop.told[0].title.startswith("300 alerts on 300 machines: hostile-0: ")
    for number in range(300, 900):
        shop.set(f"hostile-{number}", vibration=True)
        if number % 30 == 0:
            shop.beat()
    shop.set("okuma", vibration=True)
    told = shop.wait(90)
    assert len(told) <= 2
    assert any("okuma" in alert["labels"]["machine"] for one in told for alert in one.body["alerts"])
    assert shop.shown()["receivers"]["desk"]["held_back"] == 0


def test_a_machine_whose_alerts_come_and_go_uses_up_no_more_than_its_share_of_the_rate() -> None:
    signals = {signal: {"severity": "high", "keep_firing_for_s": 0.0} for signal in (VIBRATION, LOAD, SCORE)}
    shop = Shop(
        receivers={"desk": DESK["desk"] | {"rate_high_per_hour": 60}}, signals=signals, flap_episodes=50, group_wait_s=0.0
    )
    for _ in range(200):
        for which in ("vibration", "load", "score"):
            shop.set("hostile", **{which: True})
            shop.wait(3)
            shop.set("hostile", **{which: False})
            shop.wait(3)
    assert len(shop.told) < 30
    shop.set("okuma", vibration=True)
    (told,) = [one for one in shop.wait(5) if "okuma" in one.title]
    assert "severity high" in told.text


# Quiet hours.


def test_in_quiet_hours_only_high_alerts_are_told_and_the_rest_as_one_digest_after_them() -> None:
    shop = Shop(quiet_hours=[NIGHT])
    at(shop, 23)
    shop.set("okuma", score=True)
    shop.set("mazak", score=True)
    shop.set("haas", drift=True)
    assert shop.wait(3600, beat_s=30.0) == []
    shop.set("okuma", vibration=True)
    assert [one.title for one in shop.wait(60)] == ["okuma: Machine behaves unusually for 59 min (+1 more)"]
    shop.set("haas", drift=False)
    told = shop.wait(6 * 3600 + 60, beat_s=30.0)
    digests = [one for one in told if one.kind == "digest"]
    assert [(one.title, one.news) for one in digests] == [
        ("After quiet hours: mazak: Machine behaves unusually for 6 h 59 min", ["firing"])
    ]
    assert {said for one in told if one.kind != "digest" for said in one.news} == {"repeat"}


def test_a_night_without_news_has_no_digest() -> None:
    shop = Shop(quiet_hours=[NIGHT])
    at(shop, 23)
    shop.set(score=True)
    shop.wait(600)
    shop.set(score=False)
    assert shop.wait(8 * 3600, beat_s=30.0) == []


def test_quiet_hours_may_be_those_of_one_receiver() -> None:
    shop = Shop(receivers=DESK | PHONE, quiet_hours=[NIGHT | {"receivers": ["phone"]}])
    at(shop, 23)
    shop.set(score=True)
    assert [one.receiver for one in shop.wait(60)] == ["desk"]


# Heartbeat and tests.


def test_a_heartbeat_comes_in_every_slot_and_alerts_do_not_go_there() -> None:
    shop = Shop(receivers=DESK | PHONE, heartbeat={"receiver": "phone", "every_s": 60.0})
    shop.set(vibration=True)
    told = shop.wait(600)
    beats = [one for one in told if one.kind == "heartbeat"]
    assert len(beats) == 11
    assert {one.receiver for one in beats} == {"phone"}
    assert [one.receiver for one in told if one.kind == "notify"] == ["desk"]


def test_a_test_is_told_to_the_one_receiver() -> None:
    shop = Shop()
    assert shop.command("test", receiver="desk")["done"]
    (told,) = shop.wait(5)
    assert (told.kind, told.title, told.text) == ("test", "Test of cnctwin's alerts", "Asked for by ada")
    (alert,) = told.body["alerts"]
    assert (told.body["status"], alert["status"], told.severity) == ("firing", "firing", "none")
    assert alert["labels"] == {"alertname": "cnctwin_test", "machine": "test", "severity": "low"}
    assert alert["annotations"] == {"summary": told.title, "description": told.text, "test": "true"}
    assert alert["startsAt"] == "2026-11-18T11:06:40.000Z"
    assert shop.alert("cnctwin_test", "test") is None  # nothing fires
    outcome = shop.command("test", receiver="nobody")
    assert outcome == {"done": False, "text": "there is no receiver 'nobody'; there are: desk"}


def test_the_start_of_a_shop_is_a_wednesday() -> None:
    assert datetime.fromtimestamp(T0_S, UTC).strftime("%A %H:%M") == "Wednesday 11:06"
