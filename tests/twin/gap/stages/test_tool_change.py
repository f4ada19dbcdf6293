"""Tool changes are compared by their lengths, from when a control says that one is in progress."""

import numpy as np
import pytest

from tests.twin.gap.stages.produced import MACHINE, run_of
from twin.case import Case, RunAtHand
from twin.gap.diagnose import diagnose
from twin.gap.stages.tool_change import change_runs, lengths_of
from twin.machine import AddedEffect
from twin.machine_toml import machine_to_toml
from twin.runlog import run_log

STATED_S = 6.0


def changes(seed: int, role: str = "fit", extra_s: float = 0.0, period_s: float = 1.0, count: int = 15) -> RunAtHand:
    """Return a run with changes of 6 s and more, each a little different."""
    chance = np.random.default_rng(seed)
    lengths = STATED_S + extra_s + 0.1 * chance.standard_normal(count)
    begins = np.cumsum(np.r_[20.0, lengths[:-1] + chance.uniform(20.0, 50.0, count - 1)])
    t_s = np.arange(0.0, begins[-1] + 60.0, period_s)
    active = ((t_s[:, None] >= begins) & (t_s[:, None] < begins + lengths)).any(axis=1)
    return run_of(run_log({"t_s": t_s, "tool_change_active": active.astype(np.float64)}), role)


def case(extra_s: float, period_s: float = 1.0) -> Case:
    return Case("changes", MACHINE, (changes(1, "fit", extra_s, period_s), changes(2, "check", extra_s, period_s)))


@pytest.mark.parametrize("period_s", [0.1, 1.0])
def test_changes_that_take_longer_are_named(period_s: float) -> None:
    found = diagnose(case(3.5, period_s))
    told = found.diagnosis
    assert [c.effect for c in told.causes] == ["tool_change_time"]
    change = told.causes[0].parameters["change_s"]
    assert change.low <= 3.5 <= change.high
    assert told.gap.by_signal["tool_change_s"].before > 1.5
    assert told.gap.after < 1.5 < told.gap.before
    assert "up_rpm_s" not in machine_to_toml(found.twin), "what the changes do not tell is not in the twin"
    assert "tool change time (change_s" in told.sentence


def test_changes_as_stated_are_healthy() -> None:
    assert diagnose(case(0.2)).diagnosis.verdict.value == "healthy"


def test_a_twin_that_knows_is_healthy() -> None:
    known = AddedEffect(effect="tool_change_time", parameters={"change_s": 2.5})
    known_machine = MACHINE.model_copy(update={"effects": (known,)})
    wrong = case(2.5)
    assert diagnose(Case(wrong.name, known_machine, wrong.runs)).diagnosis.verdict.value == "healthy"


def test_a_change_with_a_person_in_it_does_not_count() -> None:
    run = changes(3)
    active = run.log["tool_change_active"]
    first = int(np.flatnonzero(active)[0])
    active[first : first + 30] = 1.0
    (found,) = change_runs(MACHINE, (run,))
    assert found.lengths_s.max() < 8.0


def test_a_change_with_a_hole_in_it_does_not_count() -> None:
    t_s = np.array([0.0, 1.0, 2.0, 30.0, 31.0, 32.0, 33.0, 34.0])
    active = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0])
    lengths, _ = lengths_of(run_log({"t_s": t_s, "tool_change_active": active}))
    assert lengths.tolist() == [2.0]


def test_a_change_begins_where_the_spindle_stands() -> None:
    t_s = np.arange(12.0)
    active = np.r_[np.zeros(2), np.ones(9), 0.0]
    rpm = np.r_[np.full(4, 3000.0), 1000.0, np.zeros(7)]
    lengths, _ = lengths_of(run_log({"t_s": t_s, "tool_change_active": active, "spindle_rpm": rpm}))
    assert lengths.tolist() == [6.0]


def test_a_machine_without_a_stated_length_says_nothing_of_it() -> None:
    assert change_runs(MACHINE.model_copy(update={"program": None}), (changes(1),)) == ()


def test_rows_too_coarse_for_a_change_do_not_tell_its_length() -> None:
    assert len(change_runs(MACHINE, (changes(1, period_s=1.0), changes(2, period_s=3.0)))) == 1
    assert change_runs(MACHINE, (changes(2, period_s=3.0),)) == ()


def test_in_rows_of_what_changed_a_change_counts_only_where_the_spindle_stood_as_it_began() -> None:
    t_s = np.array([0.0, 4.0, 5.0, 8.2, 9.0, 14.0, 20.0, 21.0, 23.0, 24.2, 25.0, 30.0])
    active = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    rpm = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3000.0, 3000.0, 1000.0, 0.0, 0.0, 0.0, 0.0])
    lengths, _ = lengths_of(run_log({"t_s": t_s, "tool_change_active": active, "spindle_rpm": rpm}))
    assert lengths.round(6).tolist() == [3.2]
