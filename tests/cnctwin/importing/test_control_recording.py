"""Seconds from an oscilloscope as a run log: names, lost packets, and what came before an end."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import ColumnMap
from cnctwin.importing.control_recording import record, wanted
from cnctwin.standins.lsv2_server.server import Lsv2Server
from edge.controls.heidenhain.oscilloscope import Oscilloscope
from tests.edge.controls.heidenhain.scope_on_trial import counters, opened, scope_server
from twin.runlog import read_run

TRACE = counters(50_000)


@pytest.fixture
def server() -> Iterator[Lsv2Server]:
    with scope_server(TRACE) as running:
        yield running


@pytest.fixture
def scope(server: Lsv2Server) -> Iterator[Oscilloscope]:
    with opened(server, 5.0) as ready:
        yield ready


def test_a_signal_is_asked_for_by_role_by_column_or_by_the_control_s_name(scope: Oscilloscope) -> None:
    offered = scope.signals()
    found = wanted(offered, ["x_ref", "x_pos_mm", "y_i_nominal", "z_torque"], None)
    assert [(one.signal.name, one.column) for one in found] == [
        ("x_s_nominal", "x_ref_mm"),
        ("x_s_actual", "x_pos_mm"),
        ("y_i_nominal", "y_torque_a"),
        ("z_i_nominal", "z_torque_a"),
    ]
    chosen = ColumnMap.model_validate({"columns": {"x_table_mm": {"from": "x_s_diff"}}})
    assert [one.column for one in wanted(offered, [], chosen)] == ["x_table_mm"]
    for names, message in (
        (["b_pos"], "--signals b_pos: the control has no such signal; it has x_s_actual"),
        (["x_s_diff"], "no column of a run log is known"),
        (["x_pos", "x_s_actual"], "x_pos_mm comes from x_s_actual already"),
        ([], "--signals names none"),
    ):
        with pytest.raises(UsageError, match=message):
            wanted(offered, names, None)


def test_seconds_become_rows_at_the_interval(scope: Oscilloscope, tmp_path: Path) -> None:
    signals = wanted(scope.signals(), ["x_ref", "x_torque"], None)
    account = record(scope, signals, 3.0, 600, tmp_path / "run.parquet", clock=lambda: 0.0)
    run = read_run(tmp_path / "run.parquet")
    assert len(run) == account.written.rows == 157 * 32
    assert np.allclose(np.diff(run.t_s), 0.0006, atol=1e-9)
    assert np.allclose(np.diff(run["x_ref_mm"]), 1e-4, atol=1e-9)
    assert any("3 s of values came in 0 s" in remark for remark in account.remarks)


def test_values_that_come_at_the_pace_that_was_asked_for_need_no_remark(scope: Oscilloscope, tmp_path: Path) -> None:
    arrivals = count(0.0, 32 * 0.0006)
    signals = wanted(scope.signals(), ["x_ref"], None)
    assert record(scope, signals, 3.0, 600, tmp_path / "run.parquet", clock=lambda: next(arrivals)).remarks == ()


def test_a_lost_packet_is_a_gap_in_time(server: Lsv2Server, scope: Oscilloscope, tmp_path: Path) -> None:
    server.answers.packets_lost = frozenset({3, 4, 9})
    signals = wanted(scope.signals(), ["x_pos"], None)
    account = record(scope, signals, 0.4, 600, tmp_path / "run.parquet")
    run = read_run(tmp_path / "run.parquet")
    assert account.remarks[0].startswith("3 of 24 packets were lost")
    # Where values are missing, time and position step by the same number of ticks.
    assert np.allclose(np.diff(run["x_pos_mm"]) / 1e-4, np.diff(run.t_s) / 0.0006, atol=1e-6)
    assert sorted(np.round(np.diff(run.t_s) / 0.0006))[-2:] == [33.0, 65.0]


def test_what_came_before_the_control_went_away_is_kept(server: Lsv2Server, scope: Oscilloscope, tmp_path: Path) -> None:
    def gone(done_s: float) -> None:
        if done_s > 0.1:
            server.drop_clients()

    signals = wanted(scope.signals(), ["x_pos"], None)
    account = record(scope, signals, 10.0, 600, tmp_path / "run.parquet", progress=gone)
    assert "what came before it is kept" in account.remarks[0]
    assert 0.1 < read_run(tmp_path / "run.parquet").t_s[-1] < 0.3


def test_it_ends_when_it_is_asked_to(scope: Oscilloscope, tmp_path: Path) -> None:
    signals = wanted(scope.signals(), ["x_pos"], None)
    account = record(scope, signals, 10.0, 600, tmp_path / "run.csv", is_over=lambda: True)
    assert account.remarks == ("ended after 0.0192 of 10 s; what came is kept",)
    assert len(read_run(tmp_path / "run.csv")) == 32
