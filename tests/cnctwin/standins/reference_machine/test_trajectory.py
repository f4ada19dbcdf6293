"""Paths of the reference machine keep their ends, their feeds and their dynamics."""

import numpy as np
import pytest

from cnctwin.standins.reference_machine.program import air_program, cut_program, nc_text
from cnctwin.standins.reference_machine.trajectory import PER_MS, Circle, Dwell, Dynamics, Line, path_of
from twin.programs import Linear, interpret

DYNAMICS = Dynamics(2400.0, 0.04)


def test_a_line_ends_where_it_says_at_the_feed_it_says() -> None:
    path = path_of([Dwell(0.1), Line((60.0, None, None), 6000.0)], DYNAMICS)
    x = path.position_mm[0]
    speed = np.diff(x) * PER_MS * 1000.0
    assert x[0] == 0.0 and x[-1] == 60.0
    assert speed.max() == pytest.approx(100.0, rel=1e-6)
    assert speed.min() >= -1e-6
    assert np.abs(np.diff(speed)).max() * PER_MS * 1000.0 < 2400.0 * 1.01


def test_a_short_line_never_reaches_its_feed() -> None:
    path = path_of([Line((0.02, None, None), 6000.0)], DYNAMICS)
    assert path.position_mm[0][-1] == 0.02
    assert np.diff(path.position_mm[0]).max() * PER_MS * 1000.0 < 10.0


def test_a_circle_keeps_its_radius_and_comes_back() -> None:
    path = path_of([Circle((-12.0, 5.0), True, 2000.0)], DYNAMICS)
    radius = np.hypot(path.position_mm[0] + 12.0, path.position_mm[1] - 5.0)
    assert np.ptp(radius) < 1e-9
    assert path.position_mm[:, -1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_a_delay_shows_the_past() -> None:
    path = path_of([Line((60.0, None, None), 6000.0), Dwell(0.1)], DYNAMICS)
    assert path.at_ticks(0, 0.002)[300] == pytest.approx(path.at_ticks(0)[298])


@pytest.mark.parametrize("seed", range(3))
def test_programs_differ_by_seed_and_end_where_their_text_ends(seed: int) -> None:
    for blocks in (air_program(np.random.default_rng(seed)), cut_program(np.random.default_rng(seed), 4, 900.0)):
        end = path_of(blocks, DYNAMICS).position_mm[:, -1]
        *_, last = (move for move in interpret(nc_text(blocks)) if isinstance(move, Linear))
        assert end == pytest.approx(last.end_mm[:3], abs=1e-4)
    assert air_program(np.random.default_rng(seed)) != air_program(np.random.default_rng(seed + 1))


def test_a_program_in_air_takes_about_25_seconds() -> None:
    seconds = [len(path_of(air_program(np.random.default_rng(seed)), DYNAMICS).block) / 1000.0 for seed in range(8)]
    assert min(seconds) > 18.0 and max(seconds) < 34.0
