"""Executions of programs: where they begin and end, and which of them repeat each other."""

from cnctwin.composing.executions import Execution, executions_of, pairs
from cnctwin.composing.history import OVERRIDES, PROGRAM, STATE, Course, History
from sparkplug.values import Value


def history(states: list[tuple[int, str | None]], **others: list[tuple[int, Value]]) -> History:
    """Return a history in which the control says these states, s."""
    told: dict[str, list[tuple[int, Value]]] = {STATE: list(states), PROGRAM: [(0, "O1")], **others}
    courses = {name: Course(tuple(1000 * t for t, _ in some), tuple(v for _, v in some)) for name, some in told.items()}
    return History("vmc", 0, 1_000_000, 1000, courses, tuple(range(0, 1_000_000, 1000)))


READY, ACTIVE, DONE, HOLD = "READY", "ACTIVE", "PROGRAM_COMPLETED", "FEED_HOLD"
TWICE = [(0, READY), (10, ACTIVE), (110, DONE), (120, READY), (130, ACTIVE), (230, DONE)]


def test_a_program_goes_from_active_to_completed() -> None:
    (first, second) = executions_of(history(TWICE))
    assert (first.from_ms, first.to_ms, first.program, first.completed) == (10_000, 110_001, "O1", True)
    assert pairs([first, second]) == {second: first}


def test_what_had_begun_before_the_history_is_not_one() -> None:
    assert executions_of(history([(0, ACTIVE), (100, DONE)])) == []


def test_a_program_that_was_stopped_or_is_still_running_is_not_completed() -> None:
    stopped = [*TWICE, (300, ACTIVE), (400, READY), (500, ACTIVE)]
    assert [e.completed for e in executions_of(history(stopped))] == [True, True, False, False]


def test_a_control_that_never_says_completed_has_ended_where_it_is_ready() -> None:
    assert [e.completed for e in executions_of(history([(0, READY), (10, ACTIVE), (110, READY)]))] == [True]


def test_a_hold_belongs_to_the_program_and_what_was_held_repeats_nothing() -> None:
    held = [(0, READY), (10, ACTIVE), (50, HOLD), (53, ACTIVE), (113, DONE), *((t + 200, s) for t, s in TWICE)]
    first, *others = executions_of(history(held))
    assert first.paused and first.completed and first.to_ms == 113_001
    assert len(pairs([first, *others])) == 1


def test_a_moved_override_repeats_nothing() -> None:
    first, second = executions_of(history(TWICE, **{OVERRIDES[0]: [(0, 100.0), (150, 80.0)]}))
    assert not first.overridden and second.overridden and pairs([first, second]) == {}


def test_another_program_or_another_length_repeats_nothing() -> None:
    one = Execution(0, 100_000, "O1", True, False, False)
    for other in (
        Execution(200_000, 300_000, "O2", True, False, False),
        Execution(200_000, 310_000, "O1", True, False, False),
        Execution(200_000, 300_000, "O1", False, False, False),
    ):
        assert not other.repeats(one)
    assert not Execution(0, 100_000, "", True, False, False).repeats(Execution(200_000, 300_000, "", True, False, False))
