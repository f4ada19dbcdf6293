"""Processors that fall behind are one alert and one notification; what passes by itself is none."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.alerts.lag import FRESH_S, LAGS_MAX
from processors.lag_report import LagReport, topic_of
from tests.depth import examples
from tests.processors.alerts.courier.alert_shop import Shop

NAME, PLANT = "processors_behind", "plant"
ALONE = "hall-3:4711"


def report(shop: Shop, lag_s: float, *processors: str, process: str = ALONE, sent_s: float | None = None) -> None:
    """Processors of one process report their lag."""
    at_ms = round(1000 * (shop.wall_s if sent_s is None else sent_s))
    for name in processors or ("thermal",):
        shop.plain(topic_of(name), LagReport((name,), process, at_ms, lag_s, 20, 104.8).payload().decode())


def behind(shop: Shop, seconds: int, lag_s: float, *processors: str, process: str = ALONE) -> None:
    """Let time pass in which processors are so far behind, and say so."""
    for _ in range(seconds):
        report(shop, lag_s, *processors, process=process)
        shop.wait(1)


def test_twelve_processors_that_are_behind_are_one_notification_that_names_them_and_says_what_to_do() -> None:
    shop = Shop()
    shop.set(spindle_rpm=1.0)
    behind(shop, 29, 18.2, "thermal", "mirror")
    assert (shop.alert(NAME, PLANT)["phase"], shop.told) == ("pending", [])
    behind(shop, 31, 18.2, "thermal", "mirror")
    assert shop.alert(NAME, PLANT)["phase"] == "firing"
    (told,) = shop.told
    assert told.title == "plant: Processors are 18 s behind for 39 s, limit 5 s"
    first, _, advice = told.text.splitlines()
    assert first == "20 machines, 105 % of one core, processors mirror, thermal"
    assert advice == "Results and alerts are late. `cnctwin plan fleet` says what the plant takes."
    assert shop.metrics["okuma", "twin/alert_state"] == "none"
    behind(shop, 600, 30.0, "thermal", "mirror")
    assert len(shop.told) == 1


def test_what_it_says_is_as_of_the_moment_when_it_fired() -> None:
    shop = Shop()
    for second in range(60):
        behind(shop, 1, 5.0 + second)
    assert shop.told[0].title.startswith("plant: Processors are 35 s behind")


def test_it_is_over_when_all_have_caught_up_for_a_minute_and_that_is_one_notification_too() -> None:
    shop = Shop()
    behind(shop, 60, 18.0)
    behind(shop, 300, 3.0)  # less than where it begins, more than where it ends
    assert shop.alert(NAME, PLANT)["phase"] == "firing"
    behind(shop, 59, 1.0)
    assert shop.alert(NAME, PLANT)["phase"] == "firing"
    behind(shop, 400, 0.0)
    assert shop.alert(NAME, PLANT)["phase"] == "resolved"
    assert [told.news for told in shop.told] == [["firing"], ["resolved"]]
    assert shop.told[1].text.startswith("20 machines, 105 % of one core, processor thermal\nFrom ")


@pytest.mark.parametrize(("seconds", "lag_s"), [(25, 60.0), (600, 4.9)])
def test_a_storm_of_births_and_a_lag_that_is_small_wake_nobody(seconds: int, lag_s: float) -> None:
    shop = Shop()
    for _ in range(3):
        behind(shop, seconds, lag_s)
        report(shop, 0.0)
        shop.wait(60)
    assert shop.told == []


def test_a_process_that_ended_while_it_was_behind_is_behind_no_longer() -> None:
    shop = Shop()
    behind(shop, 60, 18.0)
    shop.wait(FRESH_S + 62.0)
    assert shop.alert(NAME, PLANT)["phase"] == "resolved"
    assert shop.state.lags == {}


def test_several_processes_are_one_alert() -> None:
    shop = Shop()
    for _ in range(60):
        report(shop, 8.0, "historian", process="hall-3:4712")
        behind(shop, 1, 18.0)
    (told,) = shop.told
    assert told.title.startswith("plant: Processors are 18 s behind")
    assert "processors historian, thermal\n" in told.text


def test_a_report_that_comes_the_long_way_round_is_no_news() -> None:
    shop = Shop()
    report(shop, 0.0)
    for _ in range(60):
        report(shop, 18.0, sent_s=shop.wall_s - 18.0)  # as the broker brings it, behind everything else
        report(shop, 0.0)
        shop.wait(1)
    assert shop.alert(NAME, PLANT) is None


def test_a_suspended_computer_and_a_clock_that_leaps_wake_nobody() -> None:
    shop = Shop()
    behind(shop, 3, 18.0)
    shop.wall_s += 3600.0
    shop.beat()
    behind(shop, 10, 18.0)
    report(shop, 0.0)
    shop.wait(120)
    assert shop.told == []


def test_a_clock_that_is_set_back_hides_nothing_for_long() -> None:
    shop = Shop()
    behind(shop, 5, 18.0)
    shop.wall_s -= 3600.0
    behind(shop, 120, 18.0)
    assert shop.alert(NAME, PLANT)["phase"] == "firing"


def test_it_can_be_configured_and_switched_off() -> None:
    rule = {"severity": "high", "for_s": 5.0, "behind_s": 1.5, "caught_up_s": 1.0}
    quick, off = Shop(processors_behind=rule), Shop(processors_behind=None)
    for shop in (quick, off):
        behind(shop, 30, 2.0)
    assert quick.alert(NAME, PLANT)["severity"] == "high"
    assert (off.alert(NAME, PLANT), off.told) == (None, [])


def test_it_can_be_silenced_and_acknowledged_like_any_other() -> None:
    shop = Shop()
    shop.command("silence", matchers={"alertname": NAME}, for_s=600.0)
    behind(shop, 60, 18.0)
    assert shop.told == []
    assert shop.command("ack", fingerprint=shop.fingerprint(NAME, PLANT))["done"]


def test_what_is_no_report_is_counted_and_reports_are_bounded() -> None:
    shop = Shop()
    shop.plain(topic_of("thermal"), "18 s")
    assert shop.state.malformed == 1
    report(shop, 18.0, *(f"processor-{number}" for number in range(LAGS_MAX + 5)))
    assert len(shop.state.lags) == LAGS_MAX


@given(lags_s=st.lists(st.floats(0.0, 1e9), min_size=1, max_size=120), restart_at=st.integers(0, 119))
@settings(max_examples=examples(30, 20), deadline=None)
def test_a_restart_in_the_middle_changes_nothing(lags_s: list[float], restart_at: int) -> None:
    one, other = Shop(), Shop()
    for second, lag_s in enumerate(lags_s):
        if second == restart_at:
            other.restarted()
        for shop in (one, other):
            behind(shop, 1, lag_s)
    assert other.state == one.state
    assert other.told == one.told
