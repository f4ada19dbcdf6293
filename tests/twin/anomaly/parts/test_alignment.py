"""The place in an operation without a line: what puts its progress right, what does not, and the recursion beside a plain one."""

import json
import random
from collections.abc import Sequence

import pytest

from twin.anomaly.parts import alignment
from twin.anomaly.parts.alignment import BAND, SHIFT, Costs, put_right
from twin.anomaly.parts.usual import Usual, begun_usual

SECONDS = 400


def course(seed: int = 1) -> Usual:
    """An operation of cuts of 3 to 12 seconds, each with a load and a feed of its own."""
    chance = random.Random(seed)
    starts = [0]
    while starts[-1] < SECONDS - 12:
        starts.append(starts[-1] + chance.randint(3, 12))
    usual = begun_usual(tuple((-1, float(start)) for start in starts), (-1, float(SECONDS)), 2)
    centre = tuple((chance.uniform(2.0, 4.0), chance.choice((6.0, 7.0, 8.0))) for _ in starts)
    return usual._replace(centre=centre, weight=((10.0, 10.0),) * len(starts))


def told(usual: Usual, second: float) -> tuple[float, ...]:
    """The quantities at a second of the operation."""
    place = sum(second >= start for _, start in usual.marks) - 1
    return usual.centre[max(0, place)]


def errors(usual: Usual, truth: Sequence[float], factor: float = 0.0) -> tuple[float, float]:
    """Mean error of the place without and with the signals; truth: the true place in each second; factor: on the load."""
    costs: Costs = ()
    progress = off = put = 0.0
    for second, true in enumerate(truth):
        load, feed = told(usual, true)
        costs, shift_s = put_right(usual, costs, progress, (load + factor, feed))
        progress += shift_s
        off += abs(second - true)
        put += abs(progress - true)
        progress += 1.0
    return off / len(truth), put / len(truth)


def test_the_same_part_again_is_not_moved() -> None:
    assert errors(course(), range(SECONDS)) == (0.0, 0.0)


def test_a_start_that_is_late_is_put_right() -> None:
    off, put = errors(course(), [max(0, second - 7) for second in range(SECONDS)])
    assert off > 6.5
    assert put < 1.0


def test_an_override_that_is_not_told_is_followed_beyond_the_band() -> None:
    off, put = errors(course(), [0.9 * second for second in range(SECONDS)])
    assert off > 2 * BAND
    assert put < 2.0


@pytest.mark.parametrize("factor", [-0.5, 0.3, 1.0])
def test_a_load_that_is_wrong_all_along_moves_nothing(factor: float) -> None:
    assert errors(course(), range(SECONDS), factor)[1] < 0.1


def test_what_is_not_told_moves_nothing() -> None:
    costs: Costs = ()
    for second in range(50):
        costs, shift_s = put_right(course(), costs, float(second), (None, None))
        assert shift_s == 0.0


def test_the_state_is_json_and_bounded() -> None:
    usual, costs = course(), ()
    for second in range(2 * SECONDS):
        costs, _ = put_right(usual, costs, float(second), told(course(2), second % SECONDS))
        assert len(costs) == 2 * BAND + 1
        assert min(costs) == 0.0
    assert tuple(json.loads(json.dumps(costs, allow_nan=False))) == costs


def test_the_recursion_is_that_of_a_plain_dynamic_programme(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "STAY", 1e9)  # the band stays about the diagonal
    usual, other, costs = course(), course(3), ()
    plain = [SHIFT * abs(offset) for offset in range(-BAND, BAND + 1)]
    for second in range(100):
        values = told(other, second)
        costs, _ = put_right(usual, costs, float(second), values)
        ways = [
            min(plain[k] + SHIFT * abs(k - o) for k in range(max(o - 1, 0), min(o + 2, len(plain)))) for o in range(len(plain))
        ]
        beside = [told(usual, second + offset) for offset in range(-BAND, BAND + 1)]
        apart = [sum(min(abs(a - b) * 10.0, 4.0) for a, b in zip(values, centre, strict=True)) for centre in beside]
        plain = [0.99 * way + one for way, one in zip(ways, apart, strict=True)]
        assert costs == pytest.approx([cost - min(plain) for cost in plain])
