"""The things that machines of a hall feel alike: a floor that shakes, and a lubricant that fails."""

import pytest

from twin.anomaly.parts.own import NEVER, Own
from twin.anomaly.parts.shared import NOISE_LN, felt, gain_of, harder, harder_after, shaken, shift_of

SHAKES_G2 = 0.15**2


def shaking(usual_g: float, energy_g2: float, told_at: int = 100) -> Own:
    """Return a machine that has felt so much energy for half a minute."""
    now = (0.0, 0.0)
    for _ in range(30):
        now = felt(now, 0.22, (usual_g**2 + energy_g2) ** 0.5, usual_g)
    return Own(tick=100, felt=(now,), told_at=(told_at,))


def cutting(change_ln: float, told_at: int = 100) -> Own:
    """Return a machine whose cut has been so much harder for half a minute."""
    now = (0.0, 0.0)
    for _ in range(60):
        now = harder_after(now, 0.12, 0.8 * change_ln, 0.8)
    return Own(tick=100, felt=(now,), told_at=(told_at,))


def test_a_machine_that_stands_tells_of_a_floor_that_shakes() -> None:
    peers = [shaking(0.012, SHAKES_G2, NEVER)._replace(felt_at=99), shaking(0.6, 0.0)]
    assert shaken(peers, 0, 95) == pytest.approx(SHAKES_G2, rel=0.2)


def test_a_machine_that_mills_hard_has_little_to_say_of_it() -> None:
    """Its own noise is larger than what shakes a quiet one."""
    loud = shaking(0.6, 0.05)
    assert shaken([loud, shaking(0.05, 0.0), shaking(0.05, 0.0)], 0, 95) < 0.001


def test_a_bearing_of_one_peer_is_no_floor() -> None:
    assert shaken([shaking(0.1, 0.06), shaking(0.1, 0.0), shaking(0.1, 0.0)], 0, 95) < 0.01


def test_what_was_felt_long_ago_says_nothing() -> None:
    assert shaken([shaking(0.05, SHAKES_G2, told_at=80)], 0, 95) == 0.0
    assert harder([cutting(0.4, told_at=80)], 0, 95) == 0.0


@pytest.mark.parametrize(
    ("changes", "shared"),
    [
        ([0.3, 0.3, 0.0], 0.3),
        ([0.3, 0.0, 0.0], 0.0),
        ([0.3, 0.1], 0.2),
        ([0.3], 0.3),
        ([0.04, 0.04, 0.04], 0.0),
        ([-0.3, -0.3, 0.1], -0.3),
    ],
)
def test_a_change_of_the_cut_is_shared_where_most_feel_it(changes: list[float], shared: float) -> None:
    """One of three with a fault of its own explains nothing; what chance does is taken off."""
    peers = [cutting(one) for one in changes]
    least = max(0.0, abs(shared) - NOISE_LN)
    assert abs(harder(peers, 0, 95)) == pytest.approx(least, abs=0.05)


def test_the_same_shaking_is_more_to_a_quiet_machine() -> None:
    assert shift_of(SHAKES_G2, 0.05, 0.05) > 3.0 * shift_of(SHAKES_G2, 0.5, 0.05) > 0.0


def test_the_gain_of_a_machine_that_stands_near_is_larger() -> None:
    assert gain_of([(0.16, 0.01)] * 50) == 4.0
    assert gain_of([(0.001, 0.01)] * 50) == 1.5
