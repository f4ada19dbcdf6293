"""Where the gap lies, on made up gaps and on those of the shared cases."""

from itertools import groupby

import numpy as np
import pytest

from tests.twin.gap.traces import MACHINE, noise, shared_case, strokes, trace, traces_of
from twin.gap.diagnosis import Cell
from twin.gap.labels import AXIS, regime_labels
from twin.gap.where import where
from twin.gap.wording import group_of
from twin.identification.identify import identify


def test_a_gap_at_rest_is_found_at_rest() -> None:
    log = strokes()
    trace_ = trace(log, noise(log, 1))
    rest = trace_.regime == AXIS.index("rest")
    gapped = trace(log, noise(log, 1) - 0.12 * rest)
    first, *others = where([gapped, trace(log, noise(log, 2, 0.0003), "x_pos_mm", 0.0003)])
    assert (first.signal, first.regime, first.discovered) == ("x_torque_a", "rest", True)
    assert first.effect_size == pytest.approx(12.0, rel=0.05)
    assert first.share > 0.95
    assert first.sentence.endswith(
        "of the gap in torque is in the X torque at standstill: mean −0.12 A (twin minus recording), 12 × the repeatability"
    )
    assert not any(cell.discovered for cell in others)


def test_shares_add_up_within_a_group() -> None:
    log = strokes()
    names = ("x_torque_a", "x_pos_mm", "x_table_mm", "force_x_n", "spindle_temp_c")
    for size in (0.0, 3.0):
        cells = where([trace(log, noise(log, i) * (1.0 + size * i), name) for i, name in enumerate(names)])
        in_order = sorted(cells, key=lambda cell: group_of(cell.signal))
        groups = {group: list(of) for group, of in groupby(in_order, key=lambda cell: group_of(cell.signal))}
        assert set(groups) == {"torque", "position", "force", "temperature"}
        for of in groups.values():
            assert sum(cell.share for cell in of) == pytest.approx(1.0)


def test_what_repeats_is_no_gap() -> None:
    found: list[Cell] = []
    log = strokes()
    for seed in range(12):
        found += where([trace(log, noise(log, seed)), trace(log, noise(log, 100 + seed, 0.0003), "x_pos_mm", 0.0003)])
    assert np.mean([cell.discovered for cell in found]) < 0.05


def test_an_axis_that_comes_to_rest_elsewhere_each_time_has_chance_not_a_gap() -> None:
    log = strokes()
    names, label = regime_labels(log, "x_torque_a", MACHINE)
    rest = label == names.index("rest")
    number = np.cumsum(np.diff(rest.astype(int), prepend=0) == 1)
    draws = np.random.default_rng(4).standard_normal(number.max() + 1)
    gap = np.where(rest, 0.01 * draws[number], noise(log, 5))
    assert not any(cell.discovered for cell in where([trace(log, gap)]))


def test_after_looks_at_the_twin_with_the_causes() -> None:
    log = strokes()
    traces = [trace(log, noise(log, 1) + 0.1)]
    assert all(cell.discovered for cell in where(traces))
    assert not any(cell.discovered for cell in where(traces, after=True))


def test_samples_that_are_not_there_are_left_out() -> None:
    log = strokes()
    gap = noise(log, 1) + 0.1
    holes = gap.copy()
    holes[::3] = np.nan
    whole, holed = where([trace(log, gap)]), where([trace(log, holes)])
    assert [cell.regime for cell in whole] == [cell.regime for cell in holed]
    assert all(np.isfinite([cell.share, cell.effect_size, cell.rms, cell.significance]).all() for cell in holed)
    assert where([trace(log, np.full(len(log), np.nan))]) == ()
    assert where([trace(log, gap, floor=0.0)]) == ()
    assert where([]) == ()


def test_gravity_is_found_in_the_torque_of_z_at_rest_too() -> None:
    case = shared_case("case_01")
    cells = where(traces_of(case, case.machine)[0])
    torque = [cell for cell in cells if cell.signal.endswith("torque_a")]
    assert (torque[0].signal, torque[0].regime) == ("z_torque_a", "rest")
    assert {cell.regime for cell in torque if cell.signal == "z_torque_a" and cell.effect_size > 20} > {"rest", "acceleration"}


def test_backlash_is_found_in_the_table_position_of_x() -> None:
    case = shared_case("case_03")
    cells = [cell for cell in where(traces_of(case, case.machine)[0]) if cell.signal.endswith("_mm") and cell.discovered]
    assert {cell.signal for cell in cells[:2]} == {"x_table_mm"}
    assert sum(cell.share for cell in cells if cell.signal == "x_table_mm") > 0.8


@pytest.mark.parametrize("name", ["case_13", "case_14", "case_15"])
def test_heat_is_found_in_the_temperature(name: str) -> None:
    case = shared_case(name)
    cells = where(traces_of(case, identify(case).machine)[0])
    assert {cell.signal for cell in cells if cell.discovered} == {"spindle_temp_c"}


def test_a_healthy_machine_has_few_discoveries() -> None:
    case = shared_case("case_18")
    cells = where(traces_of(case, identify(case).machine)[0])
    assert len(cells) > 30
    assert np.mean([cell.discovered for cell in cells]) < 0.05
