"""The place in an operation by progress and signals: what shifts it, what does not, and the recursion beside a plain one."""

import json
import math
import random
from collections.abc import Sequence

import pytest

from twin.anomaly.parts import alignment
from twin.anomaly.parts.alignment import BAND, BEGUN, Moved, Place, aligned, by_progress, course_of, progress_s

TICKS = 400


def operation(seed: int = 1, ticks: int = TICKS) -> list[Moved]:
    """An operation of cuts of 3 to 12 ticks with a load and a feed of their own."""
    chance = random.Random(seed)
    steps: list[Moved] = []
    while len(steps) < ticks:
        load, feed = chance.uniform(10.0, 60.0), chance.choice((300.0, 600.0, 1200.0, 3000.0))
        steps += [Moved(1.0, (load + chance.gauss(0.0, 1.0), feed)) for _ in range(chance.randint(3, 12))]
    return steps[:ticks]


def errors(steps: Sequence[Moved], places: Sequence[float], section_cells: int = 4) -> tuple[float, float]:
    """Mean error of the section without and with alignment; `places`: true cell of each step."""
    course, place = course_of(operation(), section_cells=section_cells), BEGUN
    off, put_right, progress = 0, 0, 0.0
    for step, true in zip(steps, places, strict=True):
        place, section = aligned(course, place, step.values, step.moved)
        progress += step.moved
        section_true = min(int(true), TICKS - 1) // section_cells
        off += abs(by_progress(course, progress) - section_true)
        put_right += abs(section - section_true)
    return off / len(steps), put_right / len(steps)


def test_the_same_part_again_is_in_its_own_sections() -> None:
    steps = operation()
    assert errors(steps, range(1, TICKS + 1)) == (0.0, 0.0)


def test_a_start_that_is_late_is_put_right() -> None:
    steps = operation()
    late = [steps[0]] * 7 + steps
    off, put_right = errors(late, [*([1.0] * 7), *range(1, TICKS + 1)])
    assert off > 1.5
    assert put_right < 0.2


def test_an_override_that_the_control_does_not_tell_is_followed_beyond_the_band() -> None:
    steps = operation()
    slow = [steps[int(at * 0.93)] for at in range(int(TICKS / 0.93))]
    off, put_right = errors(slow, [1.0 + at * 0.93 for at in range(len(slow))])
    assert off * 4 > BAND / 2
    assert put_right < 0.5 < off


@pytest.mark.parametrize("factor", [0.5, 1.5, 3.0])
def test_a_load_that_is_wrong_all_along_shifts_nothing(factor: float) -> None:
    faulty = [step._replace(values=(factor * (step.values[0] or 0.0), step.values[1])) for step in operation()]
    assert errors(faulty, range(1, TICKS + 1))[1] < 0.05


def test_what_is_not_known_counts_neither_way() -> None:
    silent = [step._replace(values=(None, None)) for step in operation()]
    assert errors(silent, range(1, TICKS + 1)) == (0.0, 0.0)


def test_a_hold_does_not_move_the_place() -> None:
    course, place = course_of(operation()), BEGUN
    for step in operation()[:100]:
        place, section = aligned(course, place, step.values, step.moved)
    for _ in range(50):
        assert aligned(course, place, (0.0, 0.0), progress_s(0.0, 100.0, 1.0)) == (place, section)


def test_overrides_and_holds_do_not_shift_the_programmed_seconds() -> None:
    assert sum(progress_s(400.0, 50.0, 1.0) for _ in range(20)) == pytest.approx(10.0)
    assert progress_s(0.0, 50.0, 1.0) == 0.0
    assert progress_s(None, None, 0.5) == 0.5


def test_the_state_is_json_and_bounded() -> None:
    course, place = course_of(operation()), BEGUN
    for step in operation(seed=2, ticks=2000):
        place, section = aligned(course, place, step.values, step.moved)
        assert len(place.costs) == 2 * BAND + 1
        assert 0 <= section < course.sections
    text = json.loads(json.dumps(place, allow_nan=False))
    assert Place(*(tuple(one) if isinstance(one, list) else one for one in text)) == place


def test_the_recursion_is_that_of_a_plain_dynamic_programme(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "STAY", math.inf)  # the band stays about the diagonal
    usual, steps = operation(), operation(seed=3, ticks=60)
    course, place = course_of(usual), BEGUN
    plain = [alignment.SHIFT * abs(offset) for offset in range(-BAND, BAND + 1)]
    for at, step in enumerate(steps):
        place, _ = aligned(course, place, step.values, step.moved)
        ways = [min(plain[k] + alignment.SHIFT * abs(k - o) for k in range(max(o - 1, 0), min(o + 2, 17))) for o in range(17)]
        plain = [0.99 * way + _apart(course, at + o - BAND, step.values) for o, way in enumerate(ways)]
    least = min(plain)
    assert place.costs == pytest.approx([cost - least for cost in plain])


def _apart(course: alignment.Course, cell: int, values: Sequence[float | None]) -> float:
    cell = min(max(cell, 0), len(course.ends) - 1)
    apart = [abs((value or 0.0) - levels[cell]) for value, levels in zip(values, course.levels, strict=True)]
    return sum(min(one / spread, 4.0) for one, spread in zip(apart, course.spreads, strict=True))


def test_an_operation_in_which_nothing_moved_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing moved"):
        course_of([Moved(0.0, (1.0,))])
