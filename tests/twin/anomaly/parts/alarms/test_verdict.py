"""Verdicts: what each brings about, the order in which they come, and what is refused."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.twin.anomaly.parts.alarms.examples import LOAD, THRESHOLD, alarmed, seen, signature, spoken, verdict
from twin.anomaly.parts.alarms.episodes import Memory, alarm_of, followed, is_excused
from twin.anomaly.parts.alarms.limits import FACTOR_MAX, HALF_LIFE_S, MARGIN, TOLERATED_MAX, limit_factor, limits_of
from twin.anomaly.parts.alarms.signature import Share, Signature, signature_of
from twin.anomaly.parts.alarms.verdict import Verdict, corrected_memory, refused, verdict_of
from twin.anomaly.parts.scales import SCALES

WORDS = st.sampled_from(["true", "false", "known"])


def score_of(given_signature: Signature, memory: Memory, at_s: float) -> float:
    """A score as a chart of several signals has it: the length of what is left, each part by its raised limit."""

    def factor(one: Share) -> float:
        return limit_factor(memory.tolerated, given_signature.operation, one.signal, one.scale, one.side, at_s)

    return math.hypot(*(one.left / factor(one) for one in given_signature.shares))


@given(load=st.floats(2.0, 5.0), vibration=st.floats(-1.0, 1.0))
def test_the_same_size_as_a_false_alarm_does_not_alarm_again(load: float, vibration: float) -> None:
    given_signature = signature(load, vibration)
    score = score_of(given_signature, Memory(), 0.0)
    memory = followed(followed(Memory(), seen(score, given_signature), 1000.0), None, 1010.0)
    memory = spoken(memory, verdict("false"))
    assert score_of(given_signature, memory, 2000.0) < THRESHOLD


def test_a_raised_limit_is_of_its_operation_signal_scale_and_side_only() -> None:
    memory = spoken(alarmed(given=signature(2.5, 1.0)), verdict("false"))
    assert limit_factor(memory.tolerated, "O1|T5|1", LOAD, "cut", 1, 2000.0) == 1.25 * MARGIN
    others = [
        ("O1|T6|1", LOAD, "cut", 1),
        ("O1|T5|1", LOAD, "seconds", 1),
        ("O1|T5|1", LOAD, "cut", -1),
        ("O1|T5|1", "x", "cut", 1),
    ]
    assert [limit_factor(memory.tolerated, *other, 2000.0) for other in others] == [1.0] * 4


def test_a_raised_limit_is_bounded_and_forgotten() -> None:
    memory = spoken(alarmed(given=signature(100.0)), verdict("false"))
    factors = [limit_factor(memory.tolerated, "O1|T5|1", LOAD, "cut", 1, 2000.0 + halves * HALF_LIFE_S) for halves in range(9)]
    assert factors[:3] == [FACTOR_MAX, 1.0 + (FACTOR_MAX - 1.0) / 2.0, 1.0 + (FACTOR_MAX - 1.0) / 4.0]
    assert factors[-1] == 1.0
    assert "call it known" in memory.outcomes[-1].text


def test_many_false_alarms_raise_a_bounded_number_of_limits() -> None:
    memory = Memory()
    for place in range(TOLERATED_MAX):
        at_s = 1000.0 + 100.0 * place
        memory = spoken(alarmed(memory, at_s, given=signature(tool=place)), verdict("false", at_s, at_s + 20.0))
    assert len(memory.tolerated) == TOLERATED_MAX
    assert limits_of(memory.tolerated, f"O1|T{TOLERATED_MAX - 1}|1", 2e4) != {}


def test_the_part_of_a_false_alarm_that_is_on_may_be_learned_and_of_no_other() -> None:
    memory = followed(Memory(), seen(), 1000.0)
    assert [is_excused(spoken(memory, verdict(word))) for word in ("true", "false", "known")] == [False, True, False]
    assert not is_excused(memory)
    assert not is_excused(spoken(alarmed(), verdict("false")))


def test_time_is_the_machine_s_and_not_the_person_s() -> None:
    memory = corrected_memory(alarmed(given=signature(2.5)), verdict("false", at_s=9e9), 2000.0)
    assert limit_factor(memory.tolerated, "O1|T5|1", LOAD, "cut", 1, 2000.0) == 1.25 * MARGIN
    assert alarm_of(corrected_memory(alarmed(), verdict("true", at_s=9e9), 2000.0))


def of(load: float) -> Signature:
    """A signature of load alone."""
    return signature_of([Share(LOAD, "cut", load)], "O1|T5|1", "O1", 5)


def test_a_false_alarm_that_comes_back_in_its_part_is_the_same_one_and_its_limits_grow_with_it() -> None:
    memory = spoken(followed(Memory(), seen(2.2, of(2.2)), 1000.0), verdict("false", at_s=1003.0))
    before = limit_factor(memory.tolerated, "O1|T5|1", LOAD, "cut", 1, 1003.0)
    memory = followed(memory, None, 1005.0)
    memory = followed(memory, seen(2.1, of(2.1 * before)), 1010.0)
    assert (alarm_of(memory), memory.episodes) == (False, ())
    assert memory.running is not None
    assert memory.running.began_s == 1000.0
    assert limit_factor(memory.tolerated, "O1|T5|1", LOAD, "cut", 1, 1010.0) > before
    elsewhere = followed(followed(memory, None, 1020.0), seen(3.0, of(3.0), "O1#8"), 1030.0)
    assert alarm_of(elsewhere)


def test_a_false_alarm_that_grows_beyond_any_limit_is_on_again() -> None:
    memory = spoken(followed(Memory(), seen(2.2, of(2.2)), 1000.0), verdict("false", at_s=1003.0))
    assert not alarm_of(followed(memory, seen(2.0, of(FACTOR_MAX * THRESHOLD)), 1010.0))
    assert alarm_of(followed(memory, seen(2.1, of(1.05 * FACTOR_MAX * THRESHOLD)), 1010.0))
    large = spoken(followed(Memory(), seen(20.0, of(20.0)), 1000.0), verdict("false", at_s=1003.0))
    assert not alarm_of(followed(large, seen(7.0, of(28.0)), 1010.0))
    assert alarm_of(followed(large, seen(8.0, of(32.0)), 1010.0))


def test_what_lasts_raises_the_longer_scales_too_and_a_burst_does_not() -> None:
    def factors(scale: str) -> list[float]:
        cut = signature_of([Share(LOAD, scale, 2.5)], "O1|T5|1", "O1", 5)
        tolerated = spoken(alarmed(given=cut), verdict("false")).tolerated
        return [limit_factor(tolerated, "O1|T5|1", LOAD, one, 1, 2000.0) for one in SCALES]

    assert factors("seconds") == [2.0, 1.0, 1.0, 1.0, 1.0]
    assert factors("cut") == [1.0, 2.0, 2.0, 2.0, 2.0]


def test_limits_rise_in_all_operations_in_which_the_alarm_was_seen() -> None:
    memory = followed(Memory(), seen(3.0, of(3.0)), 1000.0)
    other = signature_of([Share(LOAD, "cut", 3.0)], "O1|T6|1", "O1", 6)
    memory = spoken(followed(memory, seen(3.0, other), 1001.0), verdict("false"))
    factors = [limit_factor(memory.tolerated, f"O1|T{tool}|1", LOAD, "cut", 1, 2000.0) for tool in (5, 6, 7)]
    assert factors == pytest.approx([1.5 * MARGIN, 1.5 * MARGIN, 1.0])


def test_an_alarm_that_is_on_goes_off_by_false_and_by_known_and_stays_by_true() -> None:
    memory = followed(Memory(), seen(), 1000.0)
    assert [alarm_of(spoken(memory, verdict(word))) for word in ("true", "false", "known")] == [True, False, False]


def test_a_person_ends_an_alarm_that_stands() -> None:
    memory = spoken(alarmed(), verdict("true"))
    ended = spoken(memory, verdict("true", at_s=2100.0, ends=True))
    assert (alarm_of(memory), alarm_of(ended)) == (True, False)
    late = spoken(memory, verdict("true", at_s=1900.0, ends=True))
    assert alarm_of(late)


@given(words=st.lists(st.tuples(WORDS, st.integers(2000, 2005), st.sampled_from(["ada", "bob"])), min_size=1, max_size=3))
def test_the_order_in_which_verdicts_come_does_not_matter(words: list[tuple[str, int, str]]) -> None:
    said = [verdict(word, at_s=at_s, by=by) for word, at_s, by in words]
    ends = set()
    for order in itertools.permutations(said):
        memory = alarmed()
        for one in order:
            memory = spoken(memory, one)
        ends.add(memory._replace(outcomes=()))
    assert len(ends) == 1


@given(word=WORDS, key=st.sampled_from(["", "k1"]))
def test_the_same_verdict_again_changes_nothing(word: str, key: str) -> None:
    once = spoken(alarmed(), verdict(word, id=key))
    assert spoken(once, verdict(word, id=key)) is once


def test_a_later_verdict_takes_back_the_limit_that_an_earlier_one_raised() -> None:
    memory = spoken(spoken(alarmed(), verdict("false")), verdict("true", at_s=2001.0))
    assert memory.tolerated == ()
    assert alarm_of(memory)


def test_a_verdict_on_no_alarm_is_answered_and_changes_nothing() -> None:
    memory = spoken(alarmed(), verdict("false", alarm_at_s=999_999.0, id="k"))
    assert memory._replace(outcomes=()) == alarmed()
    assert (memory.outcomes[0].id, memory.outcomes[0].is_done) == ("k", False)
    assert "the last ones: 1000.000" in memory.outcomes[0].text


GOOD = '{"version":1,"alarm_at_s":1000.0,"verdict":"true","label":"dull tool","by":"ada","at_s":2000.0}'
BAD = {
    "no JSON": ("{", "the message"),
    "another word": (GOOD.replace('"true"', '"maybe"'), "verdict"),
    "nobody": (GOOD.replace('"ada"', '""'), "by"),
    "a name of two lines": (GOOD.replace('"ada"', '"a\\nb"'), "by"),
    "no time": (GOOD.replace('"alarm_at_s":1000.0,', ""), "alarm_at_s"),
    "a time that is none": (GOOD.replace("1000.0", "NaN"), "alarm_at_s"),
    "a field too many": (GOOD.replace('"by"', '"colour":1,"by"'), "colour"),
    "a later version": (GOOD.replace('"version":1', '"version":2'), "version"),
    "far too long": (GOOD + " " * 5000, "characters"),
}


def test_a_message_is_a_verdict() -> None:
    assert verdict_of(GOOD) == Verdict(alarm_at_s=1000.0, verdict="true", label="dull tool", by="ada", at_s=2000.0)


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_message_is_refused_in_one_line(case: tuple[str, str]) -> None:
    text, culprit = case
    with pytest.raises(ValueError, match=culprit) as error:
        verdict_of(text)
    assert "\n" not in str(error.value)
    assert refused(Memory(), str(error.value), 1.0).outcomes[0].is_done is False
