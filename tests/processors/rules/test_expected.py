"""The rules beside the twin: a broken tool and a collision are told within two seconds; what is no fault raises nothing."""

from typing import Any

import pytest

from processors.actions import Action
from processors.rules.processor import DETAIL, PROCESSOR, RULES
from processors.running.engine import Engine
from sparkplug.host_session import HostEvent
from tests.processors.rules.test_processor import CUTTING, last, turns
from tests.processors.streams import birth, data, engine_of, fed

BROKEN, OVER = "twin/rule_tool_broken", "twin/rule_load_over_expected"
AIR = {"twin/spindle_cut_load_pct": 0.2, "twin/expected_cut_least_pct": 0.0, "twin/expected_cut_most_pct": 0.0}


def cutting(**table: Any) -> Engine:
    """An engine whose machine has been cutting for 20 s."""
    engine = engine_of(PROCESSOR, **table)
    fed(engine, birth(0.0, **CUTTING), *(data(1.0 * i, spindle_load_pct=40.0 + i % 2) for i in range(1, 21)))
    return engine


def cut(at_s: float, measured: float, least: float = 34.0, most: float = 35.0, **more: Any) -> HostEvent:
    values = {"twin/spindle_cut_load_pct": measured, "twin/expected_cut_least_pct": least, "twin/expected_cut_most_pct": most}
    return data(at_s, **values, **more)


def raised(actions: list[Action], metric: str) -> list[float]:
    return [at_s for at_s, value in turns(actions, metric) if value is True]


@pytest.mark.parametrize("period_s", [0.1, 0.5, 1.0])
def test_a_broken_tool_is_told_within_two_seconds(period_s: float) -> None:
    engine = cutting()
    samples = [cut(20.5 + period_s * (k + 1), 0.5 + 0.1 * (k % 3)) for k in range(int(4.0 / period_s))]
    (at_s,) = raised(fed(engine, *samples), BROKEN)
    assert 1.0 <= at_s - 20.5 <= 2.0
    assert "the cut takes 1 % of spindle load where the twin expects 34 % or more" in str(last(engine)[DETAIL].value)


def test_it_stays_an_alarm_in_air_and_ends_where_the_tool_cuts_again() -> None:
    engine = cutting()
    gone = [cut(21.0 + k, 0.5 + 0.1 * (k % 2)) for k in range(3)]
    air = [data(24.0 + k, **AIR | {"twin/spindle_cut_load_pct": 0.2 + 0.1 * (k % 2)}) for k in range(30)]
    again = [cut(60.0 + k, 35.0 + k % 2) for k in range(4)]
    actions = fed(engine, *gone, *air, *again)
    assert turns(actions, BROKEN) == [(22.0, True), (62.0, False)]


@pytest.mark.parametrize(
    ("case", "samples"),
    [
        ("a cut that begins a second later than expected", [cut(21.0, 0.4), cut(21.9, 30.0), cut(23.0, 34.0)]),
        ("a line that ends early", [cut(21.0, 0.4), *(data(21.9 + k, **AIR) for k in range(5))]),
        ("air", [data(21.0 + k, **AIR) for k in range(9)]),
        ("a feed hold", [cut(21.0 + k, 0.5 + 0.1 * (k % 2), feed_mm_min=0.0) for k in range(9)]),
        ("a cut that is expected to be as small as the noise", [cut(21.0 + k, 0.1 * (k % 2), 1.1, 1.2) for k in range(90)]),
        ("a cut of which only the greatest load is known", [cut(21.0 + k, 0.1 * (k % 2), 0.0, 35.0) for k in range(9)]),
        ("a third less than is expected", [cut(21.0 + k, 22.0 + k % 2) for k in range(9)]),
        ("half as much again", [cut(21.0 + k, 52.0 + k % 2) for k in range(9)]),
    ],
)
def test_what_is_no_fault_raises_nothing(case: str, samples: list[HostEvent]) -> None:
    actions = fed(cutting(), *samples)
    assert (raised(actions, BROKEN), raised(actions, OVER)) == ([], []), case


def test_a_light_cut_is_told_too_and_later() -> None:
    """A cut of 3 % with a usual ratio of 1.7 has an m of 3.06 %; its Λ is a third of what decides in a second."""
    (at_s,) = raised(
        fed(cutting(), *(cut(21.0 + k, 0.1 * (k % 2), 3.0, 3.1, **{"twin/expected_ratio": 1.7}) for k in range(9))), BROKEN
    )
    assert 23.0 <= at_s <= 26.0


def test_a_tool_that_breaks_at_the_end_of_a_pass_is_told_in_the_next() -> None:
    """One sample before the end, none that can be judged for three seconds, one after."""
    unsure = [cut(22.0 + k, 0.1 * (k % 2), 0.0, 35.0) for k in range(3)]
    samples = [cut(21.0, 0.4), *unsure, cut(25.0, 0.3), cut(26.0, 0.4)]
    assert raised(fed(cutting(), *samples), BROKEN) == [25.0]


def test_stock_that_is_smaller_than_stated_raises_nothing() -> None:
    """Each cut begins a second late and ends a second early: the first one shows it, and more is asked for from then on."""
    engine, samples = cutting(), []
    for part in range(20):
        at_s = 21.0 + 10.0 * part
        samples += [cut(at_s, 0.3), *(cut(at_s + k, 33.0 + k % 2) for k in range(1, 7)), cut(at_s + 7.0, 0.4)]
        samples += [data(at_s + 8.0 + k, **AIR) for k in range(2)]
    assert raised(fed(engine, *samples), BROKEN) == []


def test_a_spindle_that_has_stood_begins_anew() -> None:
    """A tool change between two samples: the second is of another tool."""
    stands = [data(22.0 + k, spindle_rpm=0.0, **AIR) for k in range(3)]
    turns_again = [data(25.0 + k, spindle_rpm=CUTTING["spindle_rpm"], **AIR) for k in range(3)]
    assert raised(fed(cutting(), cut(21.0, 0.4), *stands, *turns_again, cut(29.0, 0.4), cut(29.9, 34.0)), BROKEN) == []


def test_a_collision_in_air_is_told_within_two_seconds() -> None:
    engine = cutting()
    fed(engine, *(data(21.0 + k, **AIR) for k in range(5)))
    (at_s,) = raised(fed(engine, *(data(26.0 + k, **AIR | {"twin/spindle_cut_load_pct": 60.0 + k}) for k in range(4))), OVER)
    assert at_s - 26.0 <= 2.0


def test_what_is_usual_of_a_tool_moves_the_limit() -> None:
    """Twice of what is expected, by a quarter that is usual, and 10 %: 97.5 %."""
    worn = {"twin/expected_ratio": 1.25}
    assert raised(fed(cutting(), *(cut(21.0 + k, 90.0 + k % 2, **worn) for k in range(4))), OVER) == []
    assert raised(fed(cutting(), *(cut(21.0 + k, 99.0 + k % 2, **worn) for k in range(4))), OVER) != []


def test_without_an_expectation_both_are_null_with_the_reason_and_the_detail_names_neither() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **{name: value for name, value in CUTTING.items() if not name.startswith("twin/")}))
    for metric in (BROKEN, OVER):
        assert last(engine)[metric].value is None
        assert last(engine)[metric].reason == "twin/spindle_cut_load_pct is not offered"
    assert not any(rule.name in str(last(engine)[DETAIL].value) for rule in RULES if rule.is_of_programs)
