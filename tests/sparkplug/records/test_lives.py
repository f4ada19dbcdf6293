"""A record that a log holds twice counts once, whoever wrote it, and wherever the reader was started again."""

import json

from hypothesis import given
from hypothesis import strategies as st

from sparkplug.records.lives import Lives
from sparkplug.records.record import Origin

NODE = "cnc/edge"


@given(st.integers(1, 600), st.data())
def test_of_two_writers_each_message_counts_once(length: int, data: st.DataObject) -> None:
    """Each writes in order; the second one repeats a stretch that the first has written, by no more than half a turn."""
    begin = data.draw(st.integers(0, length - 1))
    end = data.draw(st.integers(begin, min(begin + 127, length)))
    messages = [*range(end), *range(begin, length)]
    cut = data.draw(st.integers(0, len(messages)))
    lives, taken = Lives(), []
    for place, number in enumerate(messages):
        if place == cut:  # a restart
            lives = Lives(json.loads(json.dumps(lives.kept)))
        if lives.is_new(NODE, Origin(0, 1000, number % 256), number):
            taken.append(number)
    assert taken == list(range(length))


def test_an_earlier_life_is_over_and_a_new_one_begins_anywhere() -> None:
    lives = Lives()
    assert lives.is_new(NODE, Origin(0, 1000, 5), 5)
    assert lives.is_new(NODE, Origin(1, 2000, 3), 3)
    assert not lives.is_new(NODE, Origin(0, 1000, 6), 6)
    assert lives.is_new(NODE, Origin(1, 2000, 4), 4)


def test_after_a_hole_any_number_may_come_and_two_nodes_do_not_mix() -> None:
    lives = Lives()
    assert lives.is_new(NODE, Origin(0, 1000, 5), 5)
    assert not lives.is_new(NODE, Origin(0, 1000, 4), 4)
    assert lives.is_new("cnc/other", Origin(0, 1000, 4), 4)
    assert lives.is_new(NODE, Origin(0, 1000, -1), 6, is_hole=True)
    assert lives.is_new(NODE, Origin(0, 1000, 4), 4)
