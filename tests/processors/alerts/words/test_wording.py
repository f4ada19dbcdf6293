"""A notification in plain words: what is wrong, with value, limit, unit and since when; in the reader's language."""

import json
from typing import Any

import pytest

from processors.alarms import alarm_signals
from processors.alerts.config import MACHINE_OFFLINE, PROCESSORS_BEHIND, SOURCE_LOST
from processors.alerts.facts import of_score
from processors.alerts.state import Alert, Phase, Severity
from processors.alerts.words.language import language, shipped
from processors.alerts.words.wording import Occasion, wording
from tests.processors.alerts.courier.alert_shop import DESK, PHONE, Shop
from twin.vocabulary.twin_signals import RULE_FINDINGS, TWIN_PREFIX

PAGE = "https://twin.plant.example"
NAMES = (*(signal.removeprefix(TWIN_PREFIX) for signal in alarm_signals()), MACHINE_OFFLINE, SOURCE_LOST, PROCESSORS_BEHIND)
WHY = {
    **{"signal": "spindle_load_pct", "measured": 59.0, "expected": 50.0, "unit": "%", "by": "12 parts", "lines": [210, 260]},
    **{"like": [{"label": "packed chips", "likeness": 0.91}], "peers": []},
}


def findings(shop: Shop, load_pct: float) -> str:
    """The findings of a rule that was raised two seconds after its condition began."""
    since_ms = round(shop.wall_s * 1000) - 2000
    return json.dumps(
        {
            "load_over_limit": {
                "value": load_pct,
                "limit": 100.0,
                "unit": "%",
                "since": since_ms,
                "line": 210,
                "signal": "spindle_load_pct",
            }
        }
    )


def overloaded(**table: Any) -> Shop:
    shop = Shop(external_url=PAGE, **table)
    shop.set(program="O1701", tool_number=1)
    shop.set(load=True, **{RULE_FINDINGS: findings(shop, 112.04)})
    shop.wait(15)
    return shop


def test_the_first_line_says_what_is_wrong_with_which_machine_and_the_next_what_it_was_doing_and_what_to_do() -> None:
    (told,) = overloaded().told
    assert told.title == "okuma: Spindle load 112 % for 12 s, limit 100 %"
    assert told.text.splitlines() == [
        "Program O1701, tool 1, line 210",
        "Since 2026-11-18 11:06:38 UTC, severity high",
        "Check the tool for wear and packed chips, and the feed and its override.",
    ]
    (alert,) = told.body["alerts"]
    assert (
        alert["generatorURL"]
        == f"{PAGE}/#/replay/okuma?from=1794999700000&to=1795000300000&at=1795000000000&signal=spindle_load_pct"
    )
    told_facts = {name: alert["annotations"][name] for name in ("value", "limit", "unit", "program", "tool", "line")}
    assert told_facts == {"value": "112.04", "limit": "100", "unit": "%", "program": "O1701", "tool": "1", "line": "210"}


def test_the_same_in_german_by_the_clock_of_the_shop() -> None:
    (told,) = overloaded(language="de", time_zone="Europe/Berlin").told
    assert told.title == "okuma: Spindellast 112 % seit 12 s, Grenze 100 %"
    assert "Programm O1701, Werkzeug 1, Zeile 210" in told.text
    assert "Seit 18.11.2026 12:06:38 CET, Schwere hoch" in told.text


def test_what_the_control_itself_shows_is_told_too() -> None:
    shop = Shop(external_url=PAGE)
    shop.set(program="O1701", alarm="EX1012 SPINDLE OVERHEAT")
    shop.set(load=True, **{RULE_FINDINGS: findings(shop, 112.04)})
    shop.wait(15)
    assert "Program O1701, line 210, the control shows: EX1012 SPINDLE OVERHEAT" in shop.told[0].text


def test_each_receiver_may_have_its_own_language() -> None:
    receivers = {"desk": DESK["desk"], "phone": PHONE["phone"] | {"language": "de"}}
    titles = {told.receiver: told.title for told in overloaded(receivers=receivers).told}
    assert titles["desk"].startswith("okuma: Spindle load") and titles["phone"].startswith("okuma: Spindellast")


def test_what_is_over_says_how_long_it_lasted_and_comes_before_what_fires_again() -> None:
    shop = overloaded(group_interval_s=60.0)
    shop.set(load=False)
    shop.wait(62)
    shop.set(load=True, **{RULE_FINDINGS: findings(shop, 118.0)})
    (told,) = shop.wait(20)
    assert [said.split(".")[2] for said in told.says] == ["resolved", "firing"]
    assert told.title == "okuma: Spindle load 118 % for 10 s, limit 100 %"
    assert "\nOver after 15 s: spindle load over its limit\n" in told.text
    first, second = told.body["alerts"]
    assert (first["status"], second["status"]) == ("resolved", "firing")
    assert first["startsAt"] < first["endsAt"] < second["startsAt"]
    shop.set(load=False)
    (told,) = shop.wait(400)
    assert told.title == "okuma: Over after 22 s: spindle load over its limit"


def test_after_a_restart_an_end_and_the_next_beginning_are_known_and_told_to_nobody_again() -> None:
    shop = overloaded(group_interval_s=60.0)
    before = shop.state
    shop.set(load=False)
    shop.wait(62)
    shop.set(load=True, **{RULE_FINDINGS: findings(shop, 118.0)})
    (told,) = shop.wait(20)
    outbox = {topic: payload for topic, payload in shop.retained.items() if told.id in topic}
    shop.state = before  # the snapshot is older than what was told
    for topic, payload in outbox.items():
        shop.plain(topic, payload.decode())
    known = shop.state.receivers["desk"].told[shop.fingerprint("rule_load_over_limit")]
    assert known.is_firing and known.episode == int(told.says[1].split(".")[1])
    assert shop.wait(120) == []


def test_a_score_says_which_signal_is_off_by_how_much() -> None:
    shop = Shop()
    shop.set(**{"twin/anomaly_why": json.dumps(WHY)})
    shop.set(score=True)
    (told,) = shop.wait(15)
    assert told.title == "okuma: Spindle load 18 % above the last 12 parts for 10 s"
    assert told.text.startswith("Lines 210–260, looks like packed chips (0.91), no peer shows it\n")


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("alert", NAMES)
def test_every_alert_has_a_name_and_an_advice_in_every_language_and_needs_no_figures(name: str, alert: str) -> None:
    words, told = wording(name, "UTC", ""), Alert("okuma", alert, TWIN_PREFIX + alert, "f" * 16, Severity.HIGH, 1, Phase.FIRING)
    texts = language(name).alerts[alert]
    assert texts.advice and words.title([told], Occasion(9.0)).lower().startswith(f"okuma: {texts.name.lower()[:20]}")
    assert words.summary(told) and "{" not in words.text([told], (), Occasion(9.0))


@pytest.mark.parametrize(
    ("why", "title"),
    [
        (
            {"measured": 24.0, "expected": 20.0, "unit": "K", "signal": "spindle_temp_c"},
            "Spindle temperature 4 K above what is usual",
        ),
        ({"measured": 150.0, "expected": 40.0, "by": "the twin, 3 parts"}, "Spindle load 3.75 times what the twin expects"),
        ({"measured": 36.0, "expected": 40.0, "by": "1 part"}, "Spindle load 10 % below the part before"),
        ({"measured": float("nan"), "expected": 40.0}, "Machine behaves unusually"),
        ({"measured": True, "expected": "x"}, "Machine behaves unusually"),
        ({"signal": 3}, "Machine behaves unusually"),
    ],
)
def test_a_reason_is_worded_by_what_it_holds(why: dict[str, Any], title: str) -> None:
    facts = of_score({"signal": "spindle_load_pct", **why})
    told = Alert("okuma", "anomaly_alarm", "twin/anomaly_alarm", "f" * 16, Severity.HIGH, 1, Phase.FIRING, facts=facts)
    assert wording("en", "UTC", "").summary(told) == title


@pytest.mark.parametrize(
    "found", ["{", "[]", "7", '{"load_over_limit": 7}', '{"load_over_limit": {"value": "x", "limit": null, "since": 1e300}}']
)
def test_findings_that_are_none_are_left_out(found: str) -> None:
    shop = Shop()
    shop.set(load=True, **{RULE_FINDINGS: found})
    (told,) = shop.wait(15)
    assert told.title == "okuma: Spindle load over its limit for 10 s"


def flapping(**table: Any) -> Shop:
    """A shop whose load is over its limit four times, and under it for longer than its alert is kept firing in between."""
    shop = Shop(external_url=PAGE, **table)
    for _ in range(3):
        shop.set(load=True, **{RULE_FINDINGS: findings(shop, 112.0)})
        shop.wait(300, beat_s=5.0)
        shop.set(load=False)
        shop.wait(300, beat_s=5.0)
    shop.set(load=True, **{RULE_FINDINGS: findings(shop, 112.0)})
    shop.wait(15)
    return shop


def test_an_alert_that_comes_and_goes_says_so_and_when_it_will_be_over() -> None:
    shop = flapping()
    assert shop.told[-2].title == "okuma: Over after 5 min 2 s: spindle load over its limit"
    assert "Comes and goes" not in shop.told[-2].text
    assert shop.told[-1].title == "okuma: Spindle load 112 %, 4 times in 30 min, limit 100 %"
    said = "Comes and goes: 4 times in 30 min. Not every time is reported; its end is, once it has stayed away for 2 h."
    assert said in shop.told[-1].text.splitlines()
    (webhook,) = [one["annotations"] for one in shop.told[-1].body["alerts"] if one["status"] == "firing"]
    assert webhook["summary"] == shop.told[-1].title
    assert (webhook["times"], webhook["within"], webhook["stays_away"]) == ("4", "30 min", "2 h")
    assert "away_for" not in webhook  # it stands
    shop.set(load=False)
    shop.wait(130, beat_s=5.0)
    shown = shop.alert("rule_load_over_limit")
    assert shown["flapping"] and shown["annotations"]["away_for"] == "2 min"
    assert shown["annotations"]["summary"] == "okuma: Spindle load 112 %, 4 times in 32 min, away for 2 min now, limit 100 %"
    (over,) = shop.wait(7300, beat_s=5.0)
    assert over.title == "okuma: Over after 17 s: spindle load over its limit"
    assert "Comes and goes" not in over.text


def test_the_same_in_german() -> None:
    shop = flapping(language="de", repeat_interval_s=600.0)
    told = shop.told[-1]
    assert told.title == "okuma: Spindellast 112 %, 4-mal in 30 min, Grenze 100 %"
    said = "Kommt und geht: 4-mal in 30 min. Es wird nicht jedes Mal gemeldet; das Ende erst, wenn 2 h lang nichts mehr war."
    assert said in told.text.splitlines()
    shop.set(load=False)
    (reminded,) = shop.wait(700, beat_s=5.0)
    said = "okuma: Spindellast 112 %, 4-mal in 40 min, jetzt seit 9 min 55 s nicht mehr, Grenze 100 %"
    assert reminded.title == f"{said} (Erinnerung)"
    assert reminded.body["alerts"][0]["annotations"]["summary"] == said
    assert "Kommt und geht: 4-mal in 40 min, jetzt seit 9 min 55 s nicht mehr. Es wird" in reminded.text


@pytest.mark.parametrize(
    ("name", "repeat", "raised"), [("en", "(reminder)", "(now severity high)"), ("de", "(Erinnerung)", "(jetzt Schwere hoch)")]
)
def test_a_reminder_and_a_raised_alert_say_what_they_are(name: str, repeat: str, raised: str) -> None:
    shop = Shop(language=name)
    shop.set(score=True)
    shop.wait(15)
    assert "(" not in shop.told[0].title
    shop.wait(14_500, beat_s=5.0)
    assert shop.told[1].title.endswith(repeat)
    shop.set(severity="high")
    shop.wait(15)
    assert shop.told[2].title.endswith(raised)


def test_an_end_rings_for_nothing_that_still_stands_says_that_it_does_and_gives_no_advice() -> None:
    shop = overloaded(group_interval_s=60.0)
    shop.set(score=True)
    shop.wait(120)
    shop.set(score=False)
    (told,) = shop.wait(120)
    assert told.news == ["resolved"]
    assert told.severity == "none"
    assert told.title == "okuma: Over after 2 min: machine behaves unusually"
    assert "Still on: Spindle load 112 % for " in told.text
    over, stands = told.body["alerts"]
    assert (over["status"], stands["status"]) == ("resolved", "firing")
    assert "advice" not in over["annotations"]
    assert stands["annotations"]["advice"]
    assert over["annotations"]["summary"] == "okuma: Over after 2 min: machine behaves unusually"


def test_what_was_held_back_is_counted_in_the_singular_and_the_plural() -> None:
    assert wording("en", "UTC", "").held_back(1) == "1 notification was held back before this one"
    assert wording("de", "UTC", "").held_back(2) == "2 Meldungen wurden vor dieser zurückgehalten"
