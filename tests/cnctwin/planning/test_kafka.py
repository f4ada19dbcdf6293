"""A plan past one computer: what it holds whatever the figures of the day are."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.errors import UsageError
from cnctwin.planning.fleet import CORE_SHARE, Fleet, chosen
from cnctwin.planning.kafka import plan_kafka
from cnctwin.planning.measured import MEASURED, ON_KAFKA, Each
from processors.discovery import modules

ALL = tuple(MEASURED.each_us)
ROUND = replace(
    ON_KAFKA,
    bridge_us=Each(70.0, 140.0, 0.0),
    kafka_us=Each(100.0, 0.0, 0.0),
    mosquitto_us=Each(20.0, 50.0, 0.0),
    log_bytes=Each(300.0, 200.0, 50.0),
    state_bytes=1000.0,
    read_us=50.0,
    fold_us={"thermal": 20.0, "mirror": 40.0},
    state_us=500.0,
    live_factor=2.0,
    results_a_machine_s=1.0,
)
"""Figures to be checked by hand."""
ON_ONE = replace(MEASURED, values=11, grows_share=0.0)


def test_every_processor_but_the_historian_has_a_figure_on_kafka() -> None:
    assert set(ON_KAFKA.fold_us) == set(modules()) - {"historian"}


def test_one_group() -> None:
    made = plan_kafka(Fleet(1000, 2.0), ("thermal",), measured=ROUND, on_one=ON_ONE)
    assert made.groups == 1
    assert made.bridges == 1  # 1000 · (2 · 70 + 140) µs = 0.28 cores
    assert made.runners == 1  # 1000 · (2 · 2 · 70 + 500 / 5) µs = 0.38 cores
    assert made.partitions == 12 and made.historians == 0
    assert made.broker_cores == pytest.approx(3 * 1000 * 2 * 100e-6) and made.brokers == 3
    log_s, states_s = 1000 * (2 * 300 + 200), 1000 * 1000 / 5
    assert made.disk_bytes == pytest.approx(3 * (48 * 3600 * log_s + 3600 * states_s))
    assert made.in_mbit_s == pytest.approx(8e-6 * (log_s + states_s))
    assert made.out_mbit_s == pytest.approx(8e-6 * (2 * (log_s + states_s) + log_s))


def test_a_broker_that_is_full_makes_another_group() -> None:
    quick = replace(ROUND, bridge_us=Each(70.0, 50.0, 0.0))
    # 7777 · (2 · 20 + 50) µs are 0.7 cores.
    assert plan_kafka(Fleet(7777, 2.0), ("thermal",), measured=quick, on_one=ON_ONE).groups == 1
    two = plan_kafka(Fleet(7778, 2.0), ("thermal",), measured=quick, on_one=ON_ONE)
    assert two.groups == 2 and "2 Mosquitto, one a group of 3889 machines" in [need.need for need in two.needs]


def test_results_of_one_processor_that_no_bridge_can_publish_make_another_group() -> None:
    busy = replace(ROUND, bridge_us=Each(0.0, 700.0, 0.0))
    assert plan_kafka(Fleet(1000, 2.0), ("thermal",), measured=busy, on_one=ON_ONE).groups == 1
    assert plan_kafka(Fleet(1001, 2.0), ("thermal",), measured=busy, on_one=ON_ONE).groups == 2


def test_the_historian_is_planned_beside_the_folds() -> None:
    made = plan_kafka(Fleet(5000, 2.0), ("historian",), measured=ROUND, on_one=replace(ON_ONE, each_us={"historian": 50.0}))
    assert made.historians == 2 and made.runners == 0  # 10,000 · 100 µs = 1 core
    assert [need.what for need in made.needs if need.what in ("runners", "historians")] == ["historians"]


@given(machines=st.integers(1, 3000), hz=st.floats(0.1, 10.0), metrics=st.integers(1, 30), slowness=st.floats(0.5, 2.0))
def test_more_machines_never_need_less_and_no_part_is_full(machines: int, hz: float, metrics: int, slowness: float) -> None:
    made = plan_kafka(Fleet(machines, hz, metrics), ALL, slowness=slowness)
    more = plan_kafka(Fleet(2 * machines, hz, metrics), ALL, slowness=slowness)
    assert made.groups <= more.groups and made.disk_bytes < more.disk_bytes and made.broker_cores < more.broker_cores
    assert made.bridges * made.groups <= more.bridges * more.groups
    assert made.runners * made.groups <= more.runners * more.groups
    for plan in (made, more):
        assert plan.partitions >= 2 * plan.runners and plan.partitions % 12 == 0
        assert plan.broker_cores <= CORE_SHARE * 8 * plan.brokers
    assert all(need.basis for need in made.needs)


def test_what_no_run_was_as_large_as_is_named_an_extrapolation() -> None:
    needs = {need.what: need for need in plan_kafka(Fleet(5000, 10.0), ALL).needs}
    assert {what for what, need in needs.items() if not need.is_extrapolated} == {"partitions"}
    assert "not measured" in needs["historians"].basis


def test_a_machine_that_no_broker_can_take_is_refused_with_the_way_out() -> None:
    with pytest.raises(UsageError, match="lower --hz"):
        plan_kafka(Fleet(1, 1000.0, 100_000), ALL)


def test_a_processor_without_figures_is_named() -> None:
    with pytest.raises(UsageError, match="nobody"):
        plan_kafka(Fleet(1, 1.0), ("nobody",))


def test_processors_by_number_are_the_dearest() -> None:
    assert chosen("all") == ALL and chosen("thermal,gap") == ("thermal", "gap")
    three = chosen("3")
    assert min(MEASURED.each_us[name] for name in three) >= max(MEASURED.each_us[name] for name in ALL if name not in three)
    for wrong in ("0", str(len(ALL) + 1)):
        with pytest.raises(UsageError, match="from 1 to"):
            chosen(wrong)
