"""The agent's memory: sequence numbers, what is a duplicate, conditions, and how it looked at a moment."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.standins.mtconnect_agent.buffer import ObservationBuffer
from cnctwin.standins.mtconnect_agent.device_model import Component, DataItem
from cnctwin.standins.mtconnect_agent.observation import Observation, observe
from tests.cnctwin.standins.mtconnect_agent.small_machine import at, played

_DEVICE = Component("Device", "d", "d")
EXECUTION = DataItem("exec", None, "EVENT", "EXECUTION", _DEVICE, "d")
TOOL = DataItem("tool", None, "EVENT", "TOOL_NUMBER", _DEVICE, "d")
LOGIC = DataItem("logic", None, "CONDITION", "LOGIC_PROGRAM", _DEVICE, "d")


def _condition(*values: str) -> Observation:
    observation = observe(LOGIC, "t", values, reads_numbers=True)
    assert observation is not None
    return observation


def test_the_oldest_gives_way_and_numbers_go_on() -> None:
    buffer = ObservationBuffer(3)
    for n in range(5):
        buffer.add(Observation(TOOL, "t", str(n)))
    assert (buffer.first_sequence, buffer.next_sequence) == (3, 6)
    assert [o.value for o in buffer.since(3, 10)[0]] == ["2", "3", "4"]


def test_a_filter_looks_on_until_it_has_enough() -> None:
    buffer = ObservationBuffer(10)
    for n in range(3):
        buffer.add(Observation(TOOL, "t", str(n)))
        buffer.add(Observation(EXECUTION, "t", str(n)))
    found, following = buffer.since(1, 2, {EXECUTION})
    assert ([o.value for o in found], following) == (["0", "1"], 5)
    assert buffer.since(following, 2, {EXECUTION})[1] == buffer.next_sequence


def test_an_unchanged_value_is_not_stored_again() -> None:
    buffer = ObservationBuffer(10)
    stored = [buffer.add(Observation(TOOL, f"t{n}", value)) for n, value in enumerate(["1", "1", "", "", "1"])]
    assert [s is not None for s in stored] == [True, False, True, False, True]


@settings(max_examples=50)
@given(st.lists(st.tuples(st.sampled_from([EXECUTION, TOOL]), st.sampled_from("abc")), max_size=40), st.integers(1, 8))
def test_the_buffer_knows_how_it_was_at_each_sequence_it_holds(changes: list[tuple[DataItem, str]], size: int) -> None:
    buffer, history = ObservationBuffer(size), {}
    for item, value in changes:
        buffer.add(Observation(item, "t", value))
        history[buffer.next_sequence - 1] = {o.item: o.value for o in buffer.latest.all()}
    for sequence in range(buffer.first_sequence, buffer.next_sequence):
        assert {o.item: o.value for o in buffer.latest_at(sequence).all()} == history[sequence]


def test_conditions_are_active_together_until_each_is_normal() -> None:
    buffer = ObservationBuffer(20)
    steps = [
        (_condition("Unavailable"), ["Unavailable"]),
        (_condition("Normal", "", "", "", ""), ["Normal"]),
        (_condition("Warning", "406", "", "", "MEMORY PROTECT"), ["Warning 406"]),
        (_condition("Fault", "270", "1", "HIGH", "X AXIS"), ["Warning 406", "Fault 270"]),
        (_condition("Fault", "406", "", "", "MEMORY PROTECT"), ["Fault 270", "Fault 406"]),
        (_condition("Normal", "270", "", "", ""), ["Fault 406"]),
        (_condition("Normal", "406", "", "", ""), ["Normal"]),
        (_condition("Warning", "1", "", "", ""), ["Warning 1"]),
        (_condition("Normal", "", "", "", ""), ["Normal"]),
    ]
    for observation, active in steps:
        assert buffer.add(observation) is not None
        assert [f"{o.level} {o.native_code}".strip() for o in buffer.latest.of(LOGIC)] == active


@pytest.mark.parametrize(
    "values",
    [("Warning", "406", "", "", "MEMORY PROTECT"), ("Normal", "999", "", "", "")],
    ids=["still active", "never active"],
)
def test_a_condition_that_says_nothing_new_is_not_stored(values: tuple[str, ...]) -> None:
    buffer = ObservationBuffer(20)
    buffer.add(_condition("Warning", "406", "", "", "MEMORY PROTECT"))
    assert buffer.add(_condition(*values)) is None


def test_a_level_that_is_none_is_counted_and_not_stored(tmp_path: Path) -> None:
    agent = played(tmp_path, [at(0, "logic|HOT|1||HIGH|text"), at(1, "logic|fault|1||HIGH|text")])
    assert agent.ledger.dropped == {"bad_level": 1}
    assert [o.level for o in agent.agent.buffer.latest.all() if o.item.is_condition] == ["Fault"]
    agent.stop()


@pytest.mark.parametrize("size", [0, -1])
def test_a_buffer_without_room_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=str(size)):
        ObservationBuffer(size)
