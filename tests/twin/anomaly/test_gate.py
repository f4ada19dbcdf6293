"""The gate: tail from the falling edge, look-back, what is not known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.anomaly.gate import gate, held

CASES = {
    # active, tail s, look-back s: gated (tick 1 s)
    "no change": ("......", 2, 2, "......"),
    "the change itself": ("..##..", 0, 0, "..##.."),
    "the tail runs from the falling edge": ("..####....", 2, 0, "..######.."),
    "a long change outlasts any tail from its start": (".#########..", 1, 0, ".##########."),
    "look-back": (".....#...", 0, 3, "..####..."),
    "look-back over the start of the recording": (".#..", 0, 3, "##.."),
    "two changes within tail and look-back are one": ("#....#....", 2, 2, "########.."),
    "a change until the end": ("...##", 5, 0, "...##"),
    "half a tick of tail gates a tick": ("#...", 0.5, 0, "##.."),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_what_is_gated(case: tuple) -> None:
    active, tail_s, look_back_s, expected = case
    gated = gate(np.array([mark == "#" for mark in active]), 1.0, tail_s, look_back_s)
    assert "".join("#" if mark else "." for mark in gated) == expected


def test_a_tail_of_8_s_at_10_hz_is_80_ticks() -> None:
    active = np.zeros(200, dtype=bool)
    active[10:20] = True
    assert np.flatnonzero(gate(active, 0.1, 8.0)).tolist() == list(range(10, 100))


def test_a_value_that_is_not_sent_again_is_as_it_was() -> None:
    unknown = np.nan
    assert held(np.array([unknown, 1, unknown, unknown, 0, unknown])).tolist() == [False, True, True, True, False, False]
    assert gate(np.array([unknown, 1, unknown, 0, 0]), 1.0, 1.0).tolist() == [False, True, True, True, False]


def test_machines_are_gated_each_by_itself() -> None:
    active = np.array([[True, False], [False, False], [False, True], [False, False]])
    assert gate(active, 1.0, 1.0).T.astype(int).tolist() == [[1, 1, 0, 0], [0, 0, 1, 1]]


@given(active=st.lists(st.booleans(), min_size=1, max_size=40), tail=st.integers(0, 9), back=st.integers(0, 9))
def test_the_gate_is_what_its_sentence_says(active: list[bool], tail: int, back: int) -> None:
    gated = gate(np.array(active), 1.0, float(tail), float(back))
    for tick, is_gated in enumerate(gated):
        assert is_gated == any(active[max(0, tick - tail) : tick + back + 1])


@pytest.mark.parametrize("given_s", [(0.0, 1.0, 1.0), (1.0, -1.0, 0.0), (1.0, 0.0, -1.0)])
def test_durations_that_mean_nothing_are_refused(given_s: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="has to be above 0"):
        gate(np.zeros(3, dtype=bool), *given_s)
