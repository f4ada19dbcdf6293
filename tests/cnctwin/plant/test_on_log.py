"""The doctor on processors that are folded on a log: one line for each trouble, with the way out, and none where all is well."""

import pytest

from cnctwin.plant.lags import lag_reports
from cnctwin.plant.on_log import REPEATED_SHARE, WAITING_MANY, FirstLook, Said, of_log
from cnctwin.plant.view import own_values
from sparkplug.values import Value
from tests.cnctwin.plant.pictures import Pictures, owner

WELL: dict[str, Value] = {
    "process": "kafka: gap+thermal", "runners": 2, "partitions": 12, "lag_records": 3, "transactions": 100,
    "transactions_aborted": 0, "lost_by_retention": 0, "repeated": 0, "silent": "", "bridges": 1, "bridges_silent": 0,
    "bridge_events": 500, "bridge_delivered": 600, "bridge_waiting": 4, "bridge_dropped": 0, "lag_s": 0.2, "busy_pct": 40.0,
    "machines": 20,
}  # fmt: skip
NODES = ("twin-gap", "twin-thermal")


def plant(*, nodes: tuple[str, ...] = NODES, dead: tuple[str, ...] = (), **changed: Value) -> Pictures:
    pictures = Pictures().add("edge-okuma", owner({"health/holes": 0}))
    for node in nodes:
        told = {f"health/{name}": value for name, value in (WELL | changed).items()}
        pictures.add(node, owner(told, online=node not in dead))
    return pictures


def first_look(before: Pictures) -> FirstLook:
    first = FirstLook()
    first.take(before)
    return first


def bad(now: Pictures, before: Pictures | None = None) -> list[str]:
    return [said.text for said in of_log(now, first_look(now if before is None else before)) if not said.good]


def good(now: Pictures, before: Pictures | None = None) -> list[str]:
    return [said.text for said in of_log(now, first_look(now if before is None else before)) if said.good]


def test_what_is_well_is_a_line_for_the_bridge_and_one_for_the_runners() -> None:
    assert of_log(plant(), first_look(plant())) == [
        Said(True, "the bridge to the log: 600 records delivered, 4 waiting"),
        Said(True, "gap, thermal on a log: 2 runners, 12 partitions, 3 records wait"),
    ]


def test_a_plant_without_a_log_hears_nothing_of_one() -> None:
    without = Pictures().add("twin-gap", owner({"health/lag_s": 0.1})).add("edge-okuma", owner({"health/holes": 0}))
    assert of_log(without, first_look(without)) == []


def test_a_processor_with_runners_of_its_own_has_a_line_of_its_own() -> None:
    pictures = plant(nodes=("twin-gap",), process="kafka: gap", runners=1)
    pictures.add("twin-rules", owner({f"health/{name}": value for name, value in (WELL | {"process": "kafka: rules"}).items()}))
    assert good(pictures)[1:] == [
        "gap on a log: 1 runner, 12 partitions, 3 records wait",
        "rules on a log: 2 runners, 12 partitions, 3 records wait",
    ]


def test_a_bridge_that_is_gone_is_named_by_what_it_published() -> None:
    (line,) = bad(plant(dead=NODES))
    assert line.startswith("the bridge of gap, thermal is gone: ") and "start it again with its --name" in line


@pytest.mark.parametrize(("waiting", "is_bad"), [(WAITING_MANY - 1, False), (WAITING_MANY, True)])
def test_many_records_that_wait_at_the_bridge_are_bad_news(waiting: int, is_bad: bool) -> None:
    lines = bad(plant(bridge_waiting=waiting))
    assert len(lines) == is_bad
    assert all(line.startswith(f"the bridge: {waiting} records wait for the log") and "buffer_mb" in line for line in lines)


def test_a_log_that_takes_nothing_is_one_bad_line_that_blames_no_runner() -> None:
    (line,) = bad(plant(bridge_events=540, bridge_waiting=44, runners=0, silent="gap+thermal.r0"), before=plant())
    assert line.startswith("the log takes nothing: 44 records wait at the bridge, none went out while listening")
    assert bad(plant(bridge_events=540, bridge_delivered=640, bridge_waiting=44), before=plant()) == []
    assert bad(plant(bridge_waiting=44), before=plant()) == [], "nothing came in meanwhile: it was not looked at twice"


def test_records_without_room_are_bad_news_while_they_grow_and_counted_after() -> None:
    (line,) = bad(plant(bridge_dropped=7), before=plant(bridge_dropped=5))
    assert line.startswith("the bridge: no room for 2 records while listening, 7 so far; ")
    assert bad(plant(bridge_dropped=7)) == []
    assert good(plant(bridge_dropped=7, bridges=2))[0].startswith("2 bridges: no room for 7 records so far, none while listening")


def test_who_is_silent_is_named_once() -> None:
    (line,) = bad(plant(silent="bridge.hall-2, gap+thermal.r1"))
    assert line.startswith("bridge.hall-2, gap+thermal.r1: silent, and did not say goodbye; start it again")


def test_nobody_who_folds_is_one_bad_line_and_no_lag_of_nothing() -> None:
    (line,) = bad(alone := plant(runners=0, partitions=0, lag_s=0.0))
    assert line.startswith("gap, thermal: no runner reports, so nothing is folded; start `cnctwin process … --kafka`")
    assert lag_reports(own_values(alone)) == []


def test_processors_that_nobody_folds_share_a_line() -> None:
    pictures = plant(nodes=("twin-gap",), process="kafka: gap", runners=0)
    rules = WELL | {"process": "kafka: rules", "runners": 0}
    pictures.add("twin-rules", owner({f"health/{name}": value for name, value in rules.items()}))
    (line,) = bad(pictures)
    assert line.startswith("gap, rules: no runner reports")


def test_runners_that_are_behind_need_one_more_of_them_or_a_look_at_the_log() -> None:
    (full,) = lag_reports(own_values(plant(lag_s=18.0, lag_records=40_213, busy_pct=98.0)))
    assert full.sentence == (
        "processors are 18 s behind: 20 machines, 40213 records wait, 2 runners with 12 partitions, the busiest 98 % busy; "
        "start one more with the same processors (no more of them than partitions) (gap, thermal)"
    )
    (idle,) = lag_reports(own_values(plant(lag_s=18.0, runners=1)))
    assert "1 runner with 12 partitions, the busiest 40 % busy; that is less than a core: look at what else" in idle.sentence


def test_aborted_transactions_are_bad_news_while_they_grow_and_counted_after() -> None:
    (line,) = bad(plant(transactions_aborted=5, transactions=140), before=plant(transactions_aborted=2))
    assert line.startswith("gap, thermal: 3 transactions aborted while listening, 40 committed; ")
    assert bad(plant(transactions_aborted=5)) == []
    assert good(plant(transactions_aborted=5))[-1].startswith("gap, thermal: 5 transactions aborted so far, none while listening")


def test_records_that_retention_took_are_bad_news_for_as_long_as_they_are_counted() -> None:
    (line,) = bad(plant(lost_by_retention=900))
    assert line.startswith("gap, thermal: 900 records were deleted before they were folded; raise retention_hours")


def test_records_that_come_twice_are_bad_news_where_two_bridges_must_be_reading_the_same() -> None:
    before = plant(repeated=10, bridge_events=1000, bridge_delivered=0)
    few, all_twice = (plant(repeated=10 + repeated, bridge_events=2000) for repeated in (round(1000 * REPEATED_SHARE), 500))
    assert bad(few, before) == []
    assert good(few, before)[-1] == "gap, thermal: 110 records came twice so far, and were left out"
    (line,) = bad(all_twice, before)
    assert line.startswith("gap, thermal: 500 records came twice while listening") and "compare their --nodes" in line


def test_a_node_that_says_its_figures_only_now_has_no_rise() -> None:
    unborn = plant(runners=None, transactions_aborted=None)
    assert bad(plant(transactions_aborted=5), before=unborn) == []
    first = first_look(unborn)
    first.take(plant(transactions_aborted=4))
    assert next(said.text for said in of_log(plant(transactions_aborted=5), first) if not said.good).startswith(
        "gap, thermal: 1 transactions aborted while listening"
    )


def test_counts_that_begin_again_are_no_rise() -> None:
    assert bad(plant(transactions_aborted=1, bridge_dropped=1), before=plant(transactions_aborted=9, bridge_dropped=9)) == []
