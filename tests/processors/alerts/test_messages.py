"""Commands, the fate of notifications, and what is left on the broker after a crash."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.alerts.messages import COMMAND, DELIVERY, OUTBOX
from processors.alerts.report import STATE_TOPIC
from tests.depth import examples
from tests.processors.alerts.courier.alert_shop import DESK, Shop


def outbox(shop: Shop) -> dict[str, bytes]:
    return {topic: payload for topic, payload in shop.retained.items() if topic.startswith(OUTBOX)}


# The outbox.


def test_a_notification_stays_in_the_outbox_until_its_fate_is_known_and_a_minute_longer() -> None:
    shop = Shop(delivers=False)
    shop.set(vibration=True)
    shop.wait(20)
    ((topic, payload),) = outbox(shop).items()
    shop.wait(3600, beat_s=5.0)
    assert outbox(shop) == {topic: payload}
    key = topic.removeprefix(OUTBOX)
    shop.retained[DELIVERY + key] = b"{}"
    shop.plain(DELIVERY + key, json.dumps({"id": key, "receiver": "desk", "outcome": "delivered"}))
    shop.wait(55)
    assert outbox(shop) == {topic: payload}  # a snapshot that knows of it has long been written when it goes
    shop.wait(10)
    assert outbox(shop) == {}
    assert DELIVERY + key not in shop.retained
    assert shop.shown()["receivers"]["desk"]["delivered"] == 1


def test_a_notification_that_may_have_been_lost_on_its_way_is_published_again_the_same() -> None:
    shop = Shop(delivers=False)
    shop.set(vibration=True)
    shop.wait(20)
    before = outbox(shop)
    shop.retained.clear()
    shop.wait(31)
    assert outbox(shop) == before


def test_what_no_courier_takes_is_said_to_have_failed() -> None:
    shop = Shop(delivers=False)
    shop.set(vibration=True)
    shop.wait(30)
    shop.command("ack", fingerprint=shop.fingerprint())
    shop.wait(7 * 3600, beat_s=30.0)
    assert [one["reason"] for one in shop.shown()["failures"]] == ["what became of it was not reported; it may have arrived"]
    assert outbox(shop) == {}


def test_the_fate_of_a_notification_counts_once() -> None:
    shop = Shop(delivers=False)
    shop.set(vibration=True)
    shop.wait(20)
    (topic,) = outbox(shop)
    key = topic.removeprefix(OUTBOX)
    for _ in range(3):
        shop.plain(DELIVERY + key, json.dumps({"id": key, "receiver": "desk", "outcome": "failed", "reason": "401"}))
    shop.wait(2)
    assert shop.shown()["receivers"]["desk"]["failed"] == 1
    assert len(shop.shown()["failures"]) == 1


def test_after_a_crash_the_same_decision_has_the_same_id() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(10)
    before = shop.state  # the last snapshot
    (told,) = shop.wait(1)
    shop.state = before
    shop.retained.clear()
    (again,) = shop.wait(1)
    assert again.id == told.id


def test_what_was_told_after_the_last_snapshot_is_read_from_the_outbox_and_not_told_again() -> None:
    shop = Shop(delivers=False)
    shop.set(vibration=True)
    shop.wait(10)
    before = shop.state
    shop.wait(1)
    ((topic, payload),) = outbox(shop).items()
    shop.state = before
    shop.set(load=True)  # so that the decision would now be another one, with another id
    shop.plain(topic, payload.decode())
    shop.wait(30)
    said = {key: json.loads(found)["says"] for key, found in outbox(shop).items()}
    assert len(said) == 2
    told = [entry for entries in said.values() for entry in entries]
    assert len(told) == len(set(told)) == 2


def test_a_delivery_of_what_is_not_known_is_cleared_after_a_while_and_its_notification_is_not_sent_again() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(10)
    before = shop.state
    (told,) = shop.wait(1)
    shop.state = before
    shop.retained = {topic: payload for topic, payload in shop.retained.items() if not topic.startswith(OUTBOX)}
    shop.plain(DELIVERY + told.id, json.dumps({"id": told.id, "receiver": "desk", "outcome": "delivered"}))
    assert shop.wait(300) == []
    assert outbox(shop) == {}


def test_a_restart_at_every_beat_changes_nothing() -> None:
    shops = (Shop(), Shop())
    for step in range(120):
        for shop in shops:
            if step in (3, 50):
                shop.set(vibration=True, score=True)
            if step == 30:
                shop.set(vibration=False, score=None)
            shop.wait(5, beat_s=1.0)
        shops[1].restarted()
    assert shops[0].told == shops[1].told
    assert shops[0].state == shops[1].state
    assert len(shops[0].told) >= 2


# Commands.


def test_who_acknowledges_is_shown() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(5)
    outcome = shop.command("ack", fingerprint=shop.fingerprint(), comment="on my way")
    assert outcome == {"done": True, "text": "rule_vibration on okuma is acknowledged"}
    shop.wait(1)
    alert = shop.alert()
    assert (alert["phase"], alert["acknowledged_by"], alert["comment"]) == ("acknowledged", "ada", "on my way")
    again = shop.command("ack", fingerprint=shop.fingerprint())
    assert again == {"done": True, "text": "rule_vibration on okuma is already acknowledged by ada"}


def test_an_acknowledgement_is_for_the_episode_that_fires() -> None:
    shop = Shop()
    assert shop.command("ack", fingerprint="0123") == {"done": False, "text": "no alert 0123 fires"}
    shop.set(vibration=True)
    shop.wait(5)
    episode = shop.alert()["episode"]
    fingerprint = shop.fingerprint()
    shop.set(vibration=False)
    shop.wait(100)
    shop.set(vibration=True)
    shop.wait(5)
    outcome = shop.command("ack", fingerprint=fingerprint, episode=episode)
    assert outcome == {"done": False, "text": "rule_vibration on okuma: that episode is over, another one fires"}
    assert shop.command("ack", fingerprint=fingerprint, episode=shop.alert()["episode"])["done"]


def test_a_command_that_comes_twice_is_done_once() -> None:
    shop = Shop()
    text = json.dumps({"id": "x", "by": "ada", "matchers": {"machine": "okuma"}, "for_s": 60.0})
    shop.plain(COMMAND + "silence", text)
    shop.plain(COMMAND + "silence", text)
    assert len(shop.state.silences) == 1


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("ack", "{", "cannot be read"),
        ("ack", "[]", "cannot be read"),
        ("ack", '{"id":"1","fingerprint":"0"}', "by: Field required"),
        ("ack", '{"id":"1","by":"","fingerprint":"0"}', "by: String should have at least 1 character"),
        ("silence", '{"id":"1","by":"a","matchers":{},"for_s":1}', "matchers: Dictionary should have at least 1 item"),
        ("silence", '{"id":"1","by":"a","matchers":{"machine":"m"},"for_s":1e9}', "for_s: Input should be less than"),
        ("silence", '{"id":"1","by":"a","matchers":{"machine":"m"},"for_s":NaN}', "for_s"),
        ("dance", '{"id":"1","by":"a"}', "no command 'dance'; there are: ack, silence, unsilence, test"),
        ("ack", '{"id":"1","by":"a","fingerprint":"' + "0" * 5000 + '"}', "more than 4096 characters"),
        ("ack", "[" * 4000, "cannot be read"),
    ],
)
def test_a_malformed_command_is_counted_and_shown_and_changes_nothing(name: str, text: str, said: str) -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(5)
    alerts = shop.state.alerts
    shop.plain(COMMAND + name, text)
    assert shop.state.alerts == alerts
    assert shop.state.silences == ()
    shop.wait(1)
    assert shop.shown()["malformed"] == 1
    assert said in shop.shown()["commands"][-1]["text"]


_texts = st.one_of(
    st.text(max_size=50),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    ).map(json.dumps),
    st.fixed_dictionaries(
        {"id": st.text(max_size=3), "by": st.text(max_size=3)},
        optional={
            "fingerprint": st.text(max_size=3) | st.integers(),
            "matchers": st.dictionaries(st.text(max_size=3), st.text(max_size=3), max_size=2),
            "for_s": st.floats() | st.integers(),
            "starts_s": st.floats(),
            "receiver": st.sampled_from(["desk", "nobody", ""]),
            "says": st.lists(st.text(max_size=20) | st.sampled_from(["a.1.firing.0.high", "a.x.firing.0.high", "a.1.y.z.low"])),
            "kind": st.text(max_size=3),
            "outcome": st.sampled_from(["delivered", "failed", "x"]),
            "reason": st.text(max_size=5),
        },
    ).map(json.dumps),
)


@given(messages=st.lists(st.tuples(st.sampled_from([f"{COMMAND}ack", f"{COMMAND}silence", f"{COMMAND}unsilence", f"{COMMAND}test",
    f"{COMMAND}", f"{DELIVERY}x", f"{OUTBOX}x"]), _texts), max_size=12))  # fmt: skip
@settings(max_examples=examples(150), deadline=None)
def test_no_message_crashes_it_and_its_state_stays_one_that_can_be_saved(messages: list[tuple[str, str]]) -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.beat()
    for topic, text in messages:
        shop.plain(topic, text)
        shop.beat()
        shop.wall_s += 1.0
    shop.restarted()
    json.loads(shop.retained[STATE_TOPIC], parse_constant=pytest.fail)


# The state.


def test_the_state_is_published_when_it_changes_and_once_a_minute() -> None:
    shop = Shop()
    shop.set(vibration=False)
    shop.wait(1)
    before = shop.retained[STATE_TOPIC]
    shop.wait(50)
    assert shop.retained[STATE_TOPIC] == before
    shop.wait(15)
    assert shop.shown()["at"] > json.loads(before)["at"]


def test_no_receiver_is_needed() -> None:
    shop = Shop(receivers={})
    shop.set(vibration=True)
    shop.wait(60)
    assert (shop.alert()["phase"], shop.shown()["receivers"], outbox(shop)) == ("firing", {}, {})


def test_a_receiver_that_is_taken_out_of_the_configuration_is_gone_and_a_new_one_is_told_what_fires() -> None:
    shop = Shop()
    shop.set(vibration=True)
    shop.wait(20)
    table: dict[str, Any] = {"phone": DESK["desk"]}
    later = Shop(receivers=table)
    later.state, later.rows, later.wall_s = shop.state, shop.rows, shop.wall_s
    later.wait(30)
    assert list(later.shown()["receivers"]) == ["phone"]
    assert [one.receiver for one in later.told] == ["phone"]
