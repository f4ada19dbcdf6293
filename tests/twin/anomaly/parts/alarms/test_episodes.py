"""The memory of alarms: when one begins, is over and is gone, what is held back, and how much is kept."""

from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from tests.twin.anomaly.parts.alarms.examples import alarmed, seen, signature, spoken, verdict
from twin.anomaly.parts.alarms.episodes import (
    GONE_S,
    LABELLED_MAX,
    OPEN_MAX,
    Memory,
    Seen,
    alarm_of,
    followed,
    nearest,
    part_ended,
)

MEMORY = TypeAdapter(Memory)


def test_an_alarm_is_on_until_it_is_over_and_is_remembered_at_its_largest() -> None:
    memory = followed(Memory(), seen(2.5), 10.0)
    assert alarm_of(memory)
    memory = followed(followed(memory, seen(9.0, signature(9.0)), 11.0), seen(3.0, part="O1#8"), 12.0)
    over = followed(memory, None, 20.0)
    assert not alarm_of(over)
    assert (over.episodes[0].score, over.episodes[0].began_s, over.episodes[0].parts) == (9.0, 10.0, ("O1#7", "O1#8"))
    assert over.episodes[0].signature == signature(9.0)


def test_a_tick_that_brings_nothing_new_gives_the_same_object() -> None:
    memory = followed(Memory(), seen(3.0), 10.0)
    assert followed(memory, seen(2.9), 11.0) is memory
    assert followed(Memory(), None, 1.0) == Memory()


def test_silence_changes_nothing_for_the_alarms_to_come() -> None:
    memory = Memory()
    for place in range(20):
        memory = part_ended(alarmed(memory, 1000.0 * place), "O1", "O1#7", 1000.0 * place + 500.0)
    assert (memory.standing, memory.known, memory.tolerated) == ((), (), ())
    assert alarm_of(followed(memory, seen(), 1e6))


def test_an_alarm_that_was_called_true_stands_until_a_part_has_run_without_it() -> None:
    memory = spoken(alarmed(), verdict("true"))
    assert alarm_of(memory)
    assert alarm_of(part_ended(memory, "O1", "O1#7", 2100.0))  # the part that it was in
    assert alarm_of(part_ended(memory, "O2", "O2#1", 2100.0))  # another program does not show it
    assert not alarm_of(part_ended(memory, "O1", "O1#8", 2100.0))


def test_it_stands_on_where_the_next_part_shows_it_too() -> None:
    memory = spoken(alarmed(), verdict("true"))
    memory = followed(followed(memory, seen(part="O1#8"), 3000.0), None, 3010.0)
    assert alarm_of(part_ended(memory, "O1", "O1#8", 3100.0))
    assert not alarm_of(part_ended(memory, "O1", "O1#9", 3200.0))


def test_a_verdict_on_what_has_gone_long_ago_lets_nothing_stand() -> None:
    gone = part_ended(alarmed(), "O1", "O1#8", 1500.0)
    assert not alarm_of(spoken(gone, verdict("true")))
    assert not alarm_of(spoken(alarmed(), verdict("true", at_s=1000.0 + 2.0 * GONE_S)))


def test_the_like_of_a_known_alarm_is_held_back_until_it_is_gone() -> None:
    memory = spoken(alarmed(), verdict("known", label="dull tool"))
    again = followed(memory, seen(3.5, part="O1#8"), 3000.0)
    assert not alarm_of(again)
    assert again.held is not None
    assert (again.held.label, again.held.by, again.held.since_s) == ("dull tool", "ada", 2000.0)
    for part in range(20, 25):
        memory = part_ended(memory, "O1", f"O1#{part}", 4000.0)
    assert alarm_of(followed(memory, seen(3.5), 5000.0))


def test_a_known_alarm_that_has_become_much_larger_alarms() -> None:
    memory = spoken(alarmed(), verdict("known"))
    memory = followed(memory, seen(3.5, signature(3.5, 1.0)), 3000.0)
    assert not alarm_of(memory)
    assert alarm_of(followed(memory, seen(6.0, signature(6.0, 2.0)), 3001.0))


def test_the_like_of_a_known_alarm_in_another_operation_alarms() -> None:
    memory = spoken(alarmed(), verdict("known"))
    assert alarm_of(followed(memory, seen(3.0, signature(tool=6)), 3000.0))


def test_another_kind_of_alarm_is_not_held_back() -> None:
    memory = spoken(alarmed(), verdict("known"))
    assert alarm_of(followed(memory, seen(3.0, signature(0.1, 3.0)), 3000.0))


def test_the_nearest_have_a_label_and_each_label_once() -> None:
    memory = alarmed(alarmed(alarmed(), 3000.0), 5000.0)
    memory = spoken(memory, verdict("true", label="packed chips"))
    memory = spoken(memory, verdict("true", 3000.0, label="packed chips"))
    found = nearest(memory, signature(6.0, 2.0))
    assert [(like.label, like.likeness, like.at_s) for like in found] == [("packed chips", 1.0, 3000.0)]
    assert nearest(memory, signature(-3.0, -1.0)) == ()


def test_the_memory_is_bounded_and_keeps_what_is_in_use() -> None:
    memory = spoken(alarmed(), verdict("known"))
    for place in range(1, 2 * OPEN_MAX):
        memory = alarmed(memory, 1000.0 + 100.0 * place, given=signature(0.1, 3.0))
    assert len([one for one in memory.episodes if one.said is None]) == OPEN_MAX
    for place in range(LABELLED_MAX + 10):
        at_s = 1e6 + 100.0 * place
        memory = spoken(alarmed(memory, at_s, given=signature(0.1, 3.0)), verdict("false", at_s, at_s))
    assert len([one for one in memory.episodes if one.said is not None]) == LABELLED_MAX
    assert memory.episodes[0].began_s == 1000.0


@given(
    ticks=st.lists(st.one_of(st.none(), st.tuples(st.floats(2, 20), st.sampled_from(["O1#1", "O1#2"]))), max_size=30),
    cut=st.integers(0, 30),
)
def test_a_restart_in_the_middle_changes_nothing(ticks: list[tuple[float, str] | None], cut: int) -> None:
    straight = again = spoken(alarmed(), verdict("known"))
    for place, tick in enumerate(ticks):
        given_now = None if tick is None else Seen(tick[0], 2.0, signature(), tick[1])
        straight = part_ended(followed(straight, given_now, 3000.0 + place), "O1", "O1#1", 3000.0 + place)
        if place == cut:
            again = MEMORY.validate_json(MEMORY.dump_json(again))
        again = part_ended(followed(again, given_now, 3000.0 + place), "O1", "O1#1", 3000.0 + place)
    assert again == straight
