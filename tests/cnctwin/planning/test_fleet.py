"""A plan for a fleet: what it holds whatever the figures of the day are."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.errors import UsageError
from cnctwin.planning.calibration import calibrated_us
from cnctwin.planning.fleet import CORE_SHARE, Computer, Fleet, plan_fleet
from cnctwin.planning.measured import MEASURED
from processors.discovery import modules
from processors.running.engine import MACHINES_MAX

ALL = tuple(MEASURED.each_us)
COMPUTER = Computer(cores=2, disk_bytes=1_000_000_000_000)
ROUND = replace(
    MEASURED,
    values=11,
    shared_us=40.0,
    each_us={"thermal": 10.0, "mirror": 50.0, "historian": 30.0},
    broker_us=20.0,
    broker_mirror_us=100.0,
    grows_share=0.5,
    process_mb=100.0,
    machine_mb=1.0,
)
"""Figures to be checked by hand: 40 µs a process, and 10, 50 and 30 µs for the processors."""


def test_every_processor_has_a_figure_and_no_other() -> None:
    assert set(MEASURED.each_us) == set(modules())


def test_a_fleet_that_fits_one_process() -> None:
    made = plan_fleet(Fleet(400, 10.0), ("thermal", "mirror", "historian"), COMPUTER, measured=ROUND)
    (process,) = made.processes
    assert process.processors == ("historian", "mirror", "thermal")
    assert process.cores == pytest.approx(400 * 10 * (40 + 10 + 50 + 30) / 1e6)
    assert process.memory_mb == 100 + 400
    assert made.broker_cores == pytest.approx(400 * 10 * (20 + 100) / 1e6)
    assert made.groups == 1 and made.limits == ()
    assert made.store is not None and made.store.load.basis == "400 machines, 11 signals each, 10 Hz"


def test_what_does_not_fit_one_process_is_spread_and_pays_for_its_own_reception() -> None:
    measured = replace(ROUND, broker_mirror_us=50.0)
    made = plan_fleet(Fleet(600, 10.0), ("thermal", "mirror", "historian"), Computer(8, 10**12), measured=measured)
    assert [one.processors for one in made.processes] == [("mirror", "thermal"), ("historian",)]
    assert [one.cores for one in made.processes] == pytest.approx([0.6, 0.42])
    assert made.limits == ()


def test_machines_that_no_process_can_take_together_are_split_into_groups() -> None:
    made = plan_fleet(Fleet(4000, 10.0), ("mirror",), Computer(64, 10**12), measured=ROUND)
    assert made.groups == 7 and made.broker_cores == pytest.approx(4000 / 7 * 10 * 120 / 1e6)
    assert made.cores == pytest.approx(4000 * 10 * (40 + 50 + 20 + 100) / 1e6)
    assert made.limits == ("one broker with one set of processors does not do: it takes 7 groups",)


def test_a_slower_computer_needs_more_and_holds_less() -> None:
    here = plan_fleet(Fleet(100, 10.0), ALL, COMPUTER)
    slower = plan_fleet(Fleet(100, 10.0), ALL, COMPUTER, slowness=2.0)
    assert slower.cores >= 2 * here.cores and slower.machines_max <= here.machines_max / 2 + 1
    assert "2.00" in slower.basis


@given(machines=st.integers(1, 3000), hz=st.floats(0.1, 20.0), metrics=st.integers(1, 60))
def test_no_process_is_full_and_every_processor_runs_once(machines: int, hz: float, metrics: int) -> None:
    made = plan_fleet(Fleet(machines, hz, metrics), ALL, COMPUTER)
    assert all(one.cores <= CORE_SHARE * (1 + 1e-9) for one in made.processes)
    assert sorted(name for one in made.processes for name in one.processors) == sorted(ALL)
    assert machines / made.groups <= MACHINES_MAX
    assert made.broker_cores <= CORE_SHARE * (1 + 1e-9)
    assert made.limits or made.machines_max >= machines


@pytest.mark.parametrize("fleet", [(0, 10.0, 13), (5, 0.0, 13), (5, float("nan"), 13), (5, 1e9, 13), (5, 10.0, 0)])
def test_a_fleet_that_cannot_be_is_refused(fleet: tuple[int, float, int]) -> None:
    with pytest.raises(UsageError):
        Fleet(*fleet)


def test_one_machine_too_fast_for_a_process_is_refused_with_the_way_out() -> None:
    with pytest.raises(UsageError, match="lower --hz"):
        plan_fleet(Fleet(1, 1000.0, 100_000), ALL, COMPUTER)


def test_the_calibration_runs_the_real_code() -> None:
    assert 1.0 < calibrated_us(0.0) < 1e6
