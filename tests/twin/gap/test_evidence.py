"""How much better one hypothesis follows the machine than another, and by how many standard errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.gap.diagnosis import Effected
from twin.gap.evidence import Advantage, advantage
from twin.gap.fitting import Left
from twin.gap.null import Null

SAMPLES = 50


def left(rms: float, seed: int = 0, blocks: int = 40) -> Left:
    """A signal whose residual has this rms over the floor, in blocks that differ by chance."""
    squares = rms**2 * np.random.default_rng(seed).chisquare(SAMPLES, (blocks, 1))
    counts = np.full((blocks, 1), float(SAMPLES))
    return Left(("z_pos_mm",), squares, counts, squares.sum(0)[:, None], counts.sum(0)[:, None])


def test_halving_what_is_left_is_the_logarithm_of_two() -> None:
    over = advantage(left(4.0), left(2.0))
    assert over.gain == pytest.approx(np.log(2.0))
    assert over.closes == pytest.approx(left(4.0).rms()[0] ** 2 - left(2.0).rms()[0] ** 2)
    assert over.share == pytest.approx(12.0 / 15.0, abs=0.05)


@given(st.floats(0.1, 30.0), st.integers(0, 20))
def test_a_hypothesis_has_no_advantage_over_itself(rms: float, seed: int) -> None:
    assert advantage(left(rms, seed), left(rms, seed)).gain == 0.0


@given(st.floats(0.1, 30.0), st.floats(0.1, 30.0))
def test_the_advantage_changes_its_sign_with_the_order(one: float, other: float) -> None:
    assert advantage(left(one, 1), left(other, 2)).gain == pytest.approx(-advantage(left(other, 2), left(one, 1)).gain)


def test_chance_is_seldom_three_standard_errors() -> None:
    far = [abs(advantage(left(1.0, seed), left(1.0, seed + 1000)).sigmas) > 3.0 for seed in range(200)]
    assert sum(far) <= 6


def test_blocks_that_differ_far_below_the_floor_do_not_make_an_advantage_doubtful() -> None:
    before = left(6.0, blocks=4)
    after = np.array([0.4, 0.06, 0.05, 0.05])[:, None] ** 2 * before.counts
    over = advantage(before, Left(before.signals, after, before.counts, before.cells, before.cell_counts))
    assert over.gain < 4.0 * over.error
    assert over.sigmas > 10.0


def test_one_block_is_no_evidence() -> None:
    assert advantage(left(5.0, blocks=1), left(1.0, blocks=1)).sigmas == pytest.approx(0.0, abs=1e-6)


def test_no_sample_is_no_evidence() -> None:
    none = Left(("z_pos_mm",), np.zeros((0, 1)), np.zeros((0, 1)), np.zeros((1, 8)), np.zeros((1, 8)))
    assert advantage(none, none).gain == 0.0


def test_an_effect_has_to_close_more_than_on_a_healthy_machine() -> None:
    null = Null(closes={"gravity": 1.0}, closes_any=0.2, sigmas=3.0)
    sure = Advantage(gain=0.5, error=0.05, closes=0.5, share=0.5)
    assert not null.exceeded(Effected("gravity", "z"), sure)
    assert null.exceeded(Effected("payload", "z"), sure)
    assert not null.exceeded(Effected("payload", "z"), Advantage(gain=0.1, error=0.05, closes=0.5, share=0.5))
    assert null.p_value(sure) < null.p_value(Advantage(0.1, 0.05, 0.5, 0.5)) < 0.5


@pytest.mark.parametrize(
    ("closes", "share", "sigmas", "helps"),
    [(120.0, 0.9, 2.1, True), (120.0, 0.9, 1.9, False), (120.0, 0.5, 2.1, False), (5.0, 0.9, 2.1, False), (5.0, 0.9, 3.1, True)],
)
def test_what_takes_away_nearly_all_of_a_large_gap_may_do_so_less_surely(
    closes: float, share: float, sigmas: float, helps: bool
) -> None:
    over = Advantage(gain=sigmas, error=1.0, closes=closes, share=share)
    assert Null().exceeded(Effected("viscous_warmup", "z"), over) is helps
