"""Healthy runs say what is no gap."""

from dataclasses import replace

import numpy as np

from tests.twin.gap.stages.produced import MACHINE, case_with, produced
from twin.case import Case, RunAtHand
from twin.gap.diagnose import diagnose
from twin.gap.stages.plan import ground_of

LOAD = "spindle_load_pct"


def rough(run: RunAtHand, size_pct: float) -> RunAtHand:
    """Return the run with a load that wanders from minute to minute."""
    wander = size_pct * np.random.default_rng(5).standard_normal(len(run.log) // 40 + 1)
    run.log.columns[LOAD][:] += np.repeat(wander, 40)[: len(run.log)]
    return run


def healthy(run: RunAtHand) -> RunAtHand:
    """Return the run as one of a day on which nothing was wrong."""
    return replace(run, entry=run.entry.model_copy(update={"file": "healthy", "healthy": True}))


def case(*more: RunAtHand) -> Case:
    return Case("rough", MACHINE, (*(rough(run, 0.7) for run in case_with().runs if isinstance(run, RunAtHand)), *more))


def test_what_a_healthy_day_does_too_is_no_gap() -> None:
    assert diagnose(case()).diagnosis.verdict.value != "healthy", "a wandering load is a gap where nothing says that it is usual"
    told = diagnose(case(healthy(rough(produced(7), 0.7)))).diagnosis
    assert told.verdict.value == "healthy"


def test_a_quiet_healthy_day_leaves_the_floors_as_they_are() -> None:
    with_it, bare = (ground_of(c, frozenset()).floors for c in (case(healthy(produced(7))), case()))
    log = case().runs[0].log
    assert np.allclose(with_it.of(log, LOAD), bare.of(log, LOAD), rtol=0.05)


def test_a_gap_above_the_healthy_floor_is_named() -> None:
    wrong = Case("wrong", MACHINE, (*case_with(slope_pct=8.0).runs, healthy(rough(produced(7), 0.5))))
    assert [c.effect for c in diagnose(wrong).diagnosis.causes] == ["idle_speed_power"]
