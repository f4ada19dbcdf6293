"""The readings that a processor takes of a message are found once for all messages that carry the same names."""

from hypothesis import given
from hypothesis import strategies as st

from processors.running import picks
from processors.running.picks import Picks
from tests.processors.streams import reading

NAMES = st.lists(st.sampled_from("abcdef"), max_size=8).map(tuple)


@given(names=NAMES, inputs=st.none() | st.frozensets(st.sampled_from("abcdef")))
def test_the_readings_that_are_taken_are_those_of_the_inputs_in_their_order(
    names: tuple[str, ...], inputs: frozenset[str] | None
) -> None:
    readings = [reading(name, float(place)) for place, name in enumerate(names)]
    pick = Picks(inputs, None).of(names)
    expected = tuple(one for one in readings if inputs is None or one.name in inputs)
    assert tuple(pick.get(readings)) == expected
    assert pick.names == tuple(one.name for one in expected)


def test_it_wakes_for_a_signal_that_is_taken_and_asked_for() -> None:
    some = Picks(frozenset("ab"), frozenset("bc"))
    assert [some.of(names).wakes for names in (("a",), ("a", "b"), ("c",))] == [False, True, False]
    assert Picks(frozenset("ab"), None).of(("a",)).wakes


def test_the_names_that_are_remembered_are_bounded() -> None:
    some = Picks(None, None)
    for number in range(picks.LAYOUTS_MAX + 10):
        some.of((f"signal {number}",))
    assert len(some._known) <= picks.LAYOUTS_MAX
