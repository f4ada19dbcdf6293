"""A spindle's speed is steady once it has been within its band for long enough, and not before."""

import random

from twin.live.speed import POINTS_MAX, SpindleSpeed


def seen(told: list[tuple[float, float]], command_rpm: float | None = None) -> SpindleSpeed:
    speed = SpindleSpeed()
    for at_s, rpm in told:
        speed = speed.seen(at_s, rpm, command_rpm, 1.0)
    return speed


def test_it_is_steady_a_second_after_the_last_change_that_counts() -> None:
    speed = seen([(0.0, 3000.0), (10.0, 3061.0), (10.4, 3500.0)])
    for at_s, steady in ((10.5, False), (11.3, False), (11.5, True)):
        assert speed.seen(at_s, 3500.0, None, 1.0).is_steady(at_s, 1.0) is steady


def test_two_percent_or_25_rev_min_are_no_change() -> None:
    for rpm, other, steady in ((6000.0, 6110.0, True), (6000.0, 6140.0, False), (100.0, 124.0, True), (100.0, 126.0, False)):
        speed = seen([(0.0, rpm), (10.0, other)])
        assert speed.is_steady(10.0, 1.0) is steady


def test_steps_that_are_small_each_add_up() -> None:
    ramp = [(10.0 + 0.1 * number, 3000.0 + 20.0 * number) for number in range(20)]
    assert not seen([(0.0, 3000.0), *ramp]).is_steady(ramp[-1][0], 1.0)


def test_what_was_commanded_has_to_stand_still_too_and_may_differ_for_good() -> None:
    speed = seen([(0.0, 3000.0), (9.0, 3000.0)], 5000.0)
    assert speed.is_steady(9.0, 1.0)
    assert not speed.seen(10.0, 3000.0, 2500.0, 1.0).is_steady(10.0, 1.0)
    assert speed.seen(10.0, 3000.0, 2500.0, 1.0).seen(11.0, 3000.0, 2500.0, 1.0).is_steady(11.0, 1.0)


def test_nothing_new_is_the_same_state_and_noise_is_bounded() -> None:
    speed = seen([(0.0, 3000.0), (5.0, 3000.0)])
    assert speed.seen(6.0, 3001.0, None, 1.0) is speed
    chance = random.Random(1)
    wild = seen([(0.001 * number, chance.uniform(0.0, 8000.0)) for number in range(2000)])
    assert len(wild.told) <= POINTS_MAX + 1
    assert not wild.is_steady(2.0, 1.0)
