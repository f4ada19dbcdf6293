"""Verdicts on the stream over several parts: a false alarm's size alarms no more, the like of a known one is held back."""

import json
from typing import Any

import pytest

from processors.joint_anomaly.member import ADJUSTED, ALARM
from processors.joint_anomaly.parts_member import VERDICTS, WHY
from tests.processors.joint_anomaly.test_parts import PART_S, cell, heard, said, spoken, told
from tests.processors.joint_anomaly.test_processor import metric
from tests.processors.streams import fed
from tests.twin.anomaly.parts.milled import parts

LOAD = 1.2
SECOND = 9
ROWS = parts(2, 13, {4: LOAD, SECOND: LOAD})


def rises(actions: list[Any]) -> list[int]:
    """The parts in which the alarm came on."""
    return [int(at_s // PART_S) for at_s, on in metric(actions, ALARM) if on]


def after_a(word: str, **more: Any) -> list[Any]:
    """All that is published after a verdict on the first alarm, given while it is on."""
    stream, engine = told("a", ROWS), cell("a")
    came_s = next(at_s for at_s, on in metric(fed(cell("a"), *stream), ALARM) if on)
    place = round(came_s) + 4
    actions = fed(engine, *stream[:place])
    assert rises(actions) == [4]
    return heard(engine, "a", spoken(word, came_s, **more), came_s + 5.0) + fed(engine, *stream[place:])


def test_without_a_word_each_part_of_that_load_alarms() -> None:
    assert {4, SECOND} <= set(rises(fed(cell("a"), *told("a", ROWS))))


@pytest.mark.parametrize("word", ["false", "known"])
def test_after_a_word_none_does(word: str) -> None:
    actions = after_a(word, label="harder material")
    assert rises(actions) == []


def test_a_false_alarm_raises_limits_that_are_told_and_lowers_the_score() -> None:
    actions = after_a("false")
    (_, text, _) = said("a", VERDICTS, actions)[-1]
    limits = json.loads(text)["limits"]
    assert {one["signal"] for one in limits} >= {"spindle_load_pct"}
    assert all(1.0 < one["factor"] <= 6.0 and one["by"] == "ada" for one in limits)
    silent = max(score for at_s, score in metric(fed(cell("a"), *told("a", ROWS)), ADJUSTED) if at_s > SECOND * PART_S)
    assert max(score for at_s, score in metric(actions, ADJUSTED) if at_s > SECOND * PART_S) < 0.8 * silent


def test_a_known_alarm_is_held_back_with_its_score_and_its_reason_and_what_it_looks_like() -> None:
    actions = after_a("known", label="harder material")
    whys = [json.loads(text) for at_s, text, _ in said("a", WHY, actions) if text and at_s > SECOND * PART_S]
    assert whys
    assert {one["label"] for why in whys for one in why["like"]} == {"harder material"}
    assert max(one["likeness"] for why in whys for one in why["like"]) >= 0.8
    assert max(score for at_s, score in metric(actions, ADJUSTED) if at_s > SECOND * PART_S) > 2.0


def test_another_fault_alarms_all_the_same() -> None:
    """A load far below the usual still alarms after the first alarm was called false and limits of load have risen."""
    rows = parts(2, 13, {4: LOAD, SECOND: 0.3})
    stream, engine = told("a", rows), cell("a")
    came_s = next(at_s for at_s, on in metric(fed(cell("a"), *stream), ALARM) if on)
    place = round(came_s) + 4
    fed(engine, *stream[:place])
    actions = heard(engine, "a", spoken("false", came_s), came_s + 5.0) + fed(engine, *stream[place:])
    assert SECOND in rises(actions)
