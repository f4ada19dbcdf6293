"""Laws of alerts, whatever machines and people do: no storm, none lost, high is never muted, a restart changes nothing."""

from collections import Counter
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from sparkplug.quality import Quality
from tests.depth import examples
from tests.processors.alerts.courier.alert_shop import DESK, DRIFT, PHONE, SCORE, VIBRATION, Shop

# A receiver with room for everything, so that the laws are those of grouping; the rate limit has a law of its own.
ROOMY = {name: one | {"rate_per_hour": 10_000, "rate_high_per_hour": 10_000} for name, one in (DESK | PHONE).items()}
NIGHT = [{"time_zone": "UTC", "start": "00:00", "end": "23:59"}]
MACHINES = ("okuma", "mazak")
VALUES: list[tuple[Any, Quality]] = [
    (True, Quality.GOOD),
    (True, Quality.GOOD),
    (False, Quality.GOOD),
    (False, Quality.GOOD),
    (None, Quality.BAD),
    (True, Quality.STALE),
]

_sets = st.tuples(
    st.just("set"), st.sampled_from(MACHINES), st.sampled_from(["vibration", "score", "drift"]), st.sampled_from(VALUES)
)
_happenings = st.lists(
    st.one_of(
        _sets,
        st.tuples(st.just("wait"), st.integers(1, 400)),
        st.tuples(st.just("offline"), st.sampled_from(MACHINES)),
        st.tuples(st.just("ack")),
        st.tuples(st.just("silence"), st.sampled_from(MACHINES), st.integers(1, 600)),
        st.tuples(st.just("clock"), st.integers(-4000, 4000)),
        st.tuples(st.just("restart")),
    ),
    max_size=25,
)


def live(shop: Shop, happenings: list[tuple[Any, ...]], without: tuple[str, ...] = ()) -> None:
    """Let these things happen."""
    away: dict[str, Any] = {}
    for what, *values in happenings:
        if what in without:
            continue
        if what == "set":
            machine, signal, (value, quality) = values
            if machine in away:
                shop.rows[machine] = away.pop(machine)
            shop.set(machine, quality=quality, reason="by chance", **{signal: value})
        elif what == "wait":
            shop.wait(values[0], beat_s=4.0)
        elif what == "offline" and values[0] in shop.rows:
            away[values[0]] = shop.offline(values[0])
        elif what == "ack":
            for key in list(shop.state.alerts):
                shop.command("ack", fingerprint=key)
        elif what == "silence":
            shop.command("silence", matchers={"machine": values[0]}, for_s=float(values[1]))
        elif what == "clock":
            shop.wall_s += values[0]
            shop.beat()
        elif what == "restart":
            shop.restarted()


@given(happenings=_happenings)
@settings(max_examples=examples(60, 30), deadline=None)
def test_nothing_is_told_twice_and_every_notification_says_something_new(happenings: list[tuple[Any, ...]]) -> None:
    shop = Shop(receivers=ROOMY)
    live(shop, happenings)
    shop.wait(60)
    said = Counter((one.receiver, entry) for one in shop.told for entry in one.says)
    assert [entry for entry, count in said.items() if count > 1] == []
    assert all(one.says for one in shop.told)
    assert len({one.id for one in shop.told}) == len(shop.told)


@given(happenings=_happenings)
@settings(max_examples=examples(60, 30), deadline=None)
def test_a_group_is_told_at_most_once_an_interval_but_for_high_alerts_that_begin(happenings: list[tuple[Any, ...]]) -> None:
    """No storm: of what is not high, one notification for each machine and receiver in five minutes."""
    shop = Shop(receivers=ROOMY)
    live(shop, happenings, without=("clock",))
    shop.wait(60)
    times: dict[tuple[str, str], list[float]] = {}
    for one in shop.told:
        times.setdefault((one.receiver, one.body["groupKey"]), []).append(one.at_s)
        begins_high = any(entry.split(".")[2] in ("firing", "raised") and entry.endswith(".high") for entry in one.says)
        if len(times[one.receiver, one.body["groupKey"]]) > 1 and not begins_high:
            *_, before, now = times[one.receiver, one.body["groupKey"]]
            assert now - before >= 300.0


@given(happenings=_happenings)
@settings(max_examples=examples(60, 30), deadline=None)
def test_every_firing_that_nobody_silenced_or_acknowledged_is_told_to_everybody(happenings: list[tuple[Any, ...]]) -> None:
    brief = {"keep_firing_for_s": 0.0}  # so that some are over before anybody was told
    signals = {
        VIBRATION: {"severity": "high", **brief},
        SCORE: {"severity": "medium", **brief},
        DRIFT: {"severity": "low", **brief},
    }
    shop = Shop(receivers=ROOMY, signals=signals)
    live(shop, happenings, without=("ack", "silence", "clock"))
    shop.wait(400, beat_s=4.0)  # longer than any interval
    firing = {(alert.fingerprint, alert.episode) for alert in shop.state.alerts.values() if alert.rises_s}
    for receiver in ROOMY:
        told = {tuple(entry.split(".")[:2]) for one in shop.told if one.receiver == receiver for entry in one.says}
        assert {(key, str(episode)) for key, episode in firing} <= told


@given(happenings=_happenings)
@settings(max_examples=examples(60, 30), deadline=None)
def test_in_quiet_hours_every_high_alert_is_told_and_nothing_else_begins(happenings: list[tuple[Any, ...]]) -> None:
    shop = Shop(receivers={"desk": ROOMY["desk"]}, quiet_hours=NIGHT)
    live(shop, happenings, without=("ack", "silence", "clock"))
    shop.wait(30)
    high = {key for key, alert in shop.state.alerts.items() if alert.is_on and alert.severity.value == "high"}
    told = {entry.split(".")[0] for one in shop.told for entry in one.says}
    assert high <= told
    assert [entry for one in shop.told for entry in one.says if not entry.endswith(".high")] == []


@given(happenings=_happenings, rate=st.integers(1, 5))
@settings(max_examples=examples(40, 25), deadline=None)
def test_the_rate_limit_holds_for_whatever_happens(happenings: list[tuple[Any, ...]], rate: int) -> None:
    shop = Shop(receivers={"desk": DESK["desk"] | {"rate_per_hour": rate, "rate_high_per_hour": 10}})
    live(shop, happenings, without=("clock",))
    for limit, is_high in ((rate, False), (10, True)):
        times = [
            one.at_s
            for one in shop.told
            if is_high is any(e.endswith(".high") and e.split(".")[2] != "resolved" for e in one.says)
        ]
        assert all(sum(at_s - 3600.0 < other_s <= at_s for other_s in times) <= limit for at_s in times)


@given(happenings=_happenings)
@settings(max_examples=examples(40, 25), deadline=None)
def test_a_restart_anywhere_changes_nothing(happenings: list[tuple[Any, ...]]) -> None:
    restarted, whole = Shop(receivers=ROOMY), Shop(receivers=ROOMY)
    live(restarted, happenings)
    live(whole, happenings, without=("restart",))
    assert restarted.told == whole.told
    assert restarted.state == whole.state


@given(happenings=_happenings)
@settings(max_examples=examples(40, 25), deadline=None)
def test_what_cannot_be_delivered_is_said_to_have_failed(happenings: list[tuple[Any, ...]]) -> None:
    shop = Shop(receivers=ROOMY)
    shop.fails["desk"] = "no"
    live(shop, happenings)
    shop.wait(2)
    failed = {failure.id for failure in shop.state.failures}
    assert failed == {one.id for one in shop.told if one.receiver == "desk"}
    assert shop.state.receivers["desk"].delivered == 0
