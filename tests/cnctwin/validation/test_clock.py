"""Where a truth file lies on the machine's clock."""

import numpy as np
import pytest

from cnctwin.validation.clock import Clock, Pair, placed
from cnctwin.validation.track import Track


def wandering(count: int, seed: int, every_s: float = 1.0) -> Track:
    """Something that changes on its own, with a memory of 20 samples."""
    noise = np.random.default_rng(seed).standard_normal(count + 40)
    return Track(np.arange(count) * every_s, np.convolve(noise, np.ones(20), mode="valid")[:count])


def part_of(track: Track, start: int, end: int, begins_s: float, noise: float = 0.0) -> Track:
    """As another clock tells it, which reads `begins_s` at the first sample."""
    t_s, value = track.t_s[start:end], track.value[start:end]
    return Track(t_s - t_s[0] + begins_s, value + noise * np.random.default_rng(5).standard_normal(end - start))


@pytest.mark.parametrize("begins_s", [0.0, -500.0, 12_345.5])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_a_part_of_it_is_put_where_it_was(begins_s: float, noise: float) -> None:
    machine = wandering(4000, 1)
    found = placed([Pair("speed", part_of(machine, 1500, 2500, begins_s, noise), machine)], 0.0, 4000.0, 1.0, (-2e4, 2e4))
    assert isinstance(found, Clock)
    assert found.offset_s == pytest.approx(1500.0 - begins_s, abs=0.5)
    assert found.r > 0.85 and found.rival < 0.7 and found.by.endswith("speed")


def test_something_else_is_put_nowhere() -> None:
    for seed in range(20):
        found = placed([Pair("speed", wandering(1000, 100 + seed), wandering(4000, seed))], 0.0, 4000.0, 1.0, (-2e4, 2e4))
        assert isinstance(found, str) and "the best correlation is" in found


def test_a_part_that_is_made_again_and_again_fits_itself_every_cycle() -> None:
    one = wandering(400, 1).value
    machine = Track(np.arange(4000.0), np.tile(one, 10))
    cut = part_of(machine, 900, 1300, 0.0, 0.05)
    ambiguous = placed([Pair("load", cut, machine)], 0.0, 4000.0, 1.0, (0.0, 4000.0))
    assert (
        isinstance(ambiguous, str)
        and "two offsets fit equally well" in ambiguous
        and "give t_s in seconds since 1970" in ambiguous
    )
    near = placed([Pair("load", cut, machine)], 0.0, 4000.0, 1.0, (850.0, 950.0))
    assert isinstance(near, Clock) and near.offset_s == pytest.approx(900.0, abs=0.5)


def test_the_offset_is_known_to_a_part_of_a_sample() -> None:
    t_s = np.arange(0.0, 2000.0, 0.25)
    fine = np.convolve(np.random.default_rng(3).standard_normal(len(t_s) + 200), np.hanning(120), mode="valid")[: len(t_s)]
    machine, truth = Track(t_s, fine), Track(t_s[2000:4000] - t_s[2000] + 0.4, fine[2000:4000])
    found = placed([Pair("load", truth, machine)], 0.0, 2000.0, 1.0, (-3000.0, 3000.0))
    assert isinstance(found, Clock) and found.offset_s == pytest.approx(499.6, abs=0.15)


def test_what_does_not_change_tells_no_time() -> None:
    flat = Track(np.arange(1000.0), np.full(1000, 21.5))
    found = placed([Pair("temperature", flat, wandering(4000, 1))], 0.0, 4000.0, 1.0, (0.0, 4000.0))
    assert isinstance(found, str) and "does not change" in found


def test_the_pair_that_tells_it_best_counts() -> None:
    machine = wandering(4000, 1)
    noisy = Pair("load", part_of(machine, 1500, 2500, 0.0, 6.0), machine)
    clear = Pair("speed", part_of(machine, 1500, 2500, 0.0), machine)
    found = placed([noisy, clear], 0.0, 4000.0, 1.0, (0.0, 4000.0))
    assert isinstance(found, Clock) and found.by.endswith("speed")


def test_no_pair_is_said_to_be_none() -> None:
    assert "no signal that the machine or its twin tells too" in str(placed([], 0.0, 10.0, 1.0, (0.0, 1.0)))
