"""Pushes by hand are reconstructed over time: when they came, how long, how hard."""

import numpy as np
from numpy.typing import NDArray

from tests.twin.gap.learned.pushed import refitted, stage_with
from twin.gap.learned.over_time import reconstructed
from twin.gap.learned.pushes import pushes_of, time_sentence
from twin.learned.words import LearnedSite

PUSHED_S = ((0.6, 150.0), (1.7, 220.0), (2.2, 180.0))
FOR_S = 0.2


def _pushes(t_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sum([np.where((t_s >= at) & (t_s < at + FOR_S), force, 0.0) for at, force in PUSHED_S], axis=0)


def test_pushes_are_found_where_they_were() -> None:
    stage = stage_with(LearnedSite.AXIS_FORCE, {"t_s": np.arange(0.0, 8.0, 0.02)}, _pushes)
    seen = 0
    for run in reconstructed(stage, refitted(stage)):
        in_motion = [p for p in PUSHED_S if np.abs(run.at_s[run.force != 0.0] - p[0] - FOR_S / 2).min() < 0.05]
        found = [p for p in pushes_of(run.at_s, run.force, run.at_s) if p.for_s > 0.1]
        for at_s, force in in_motion:
            push = min(found, key=lambda p, at_s=at_s: abs(p.at_s - at_s))
            assert abs(push.at_s - at_s) < 0.08
            assert abs(push.height - force) < 0.2 * force
            seen += 1
        if in_motion:  # what is above the floor goes
            assert np.nanmean(run.after**2) - 1.0 < 0.3 * (np.nanmean(run.before**2) - 1.0)
    assert seen >= len(PUSHED_S) - 1


def test_a_swing_is_no_push() -> None:
    at_s = np.arange(0.0, 20.0, 0.04)
    said = time_sentence("z", "N", [(at_s, 20.0 * np.sin(2.0 * np.pi * 2.1 * at_s) + 0.01, at_s)])
    assert said.startswith("a force on Z that swings by ±20 N 2.1 times a second")


def test_pushes_are_counted_and_placed() -> None:
    at_s = np.arange(0.0, 20.0, 0.04)
    force = np.where(np.mod(at_s, 5.0) < 0.2, 35.0, 0.0)
    said = time_sentence("z", "N", [(at_s, force, 10.0 * at_s)])
    assert said.startswith("four pushes on Z of about 35 N, 0.20 s each, at no place in particular")
