"""A case from recordings: what their columns and names tell, what options say, and what cannot be known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cnctwin.composing.from_runs import Recording, compose_runs
from cnctwin.errors import UsageError
from tests.cnctwin.composing.made_up import DESCRIPTION, day
from twin.case import RunKind, read_case
from twin.errors import RunLogError
from twin.runlog import run_log, write_run

T_S = np.arange(2000) * 0.001
MOTION = np.sin(2.0 * np.pi * T_S)


def air(folder: Path, name: str, motion: Any = MOTION, **more: Any) -> Recording:
    """Return a recording of the X axis at the servo period."""
    columns = {"t_s": T_S + 5.0, "x_ref_mm": motion, "x_pos_mm": motion - 0.01, "x_torque_a": 2.0 * motion} | more
    return written(folder, name, columns)


def warm_up(folder: Path, name: str, seed: int = 1) -> Recording:
    """Return a recording of a spindle that warms up."""
    said = {n: np.asarray(v, dtype=float) for n, v in day(seed).items() if n.startswith(("spindle", "ambient"))}
    return written(folder, name, {"t_s": np.arange(2700.0)} | said)


def written(folder: Path, name: str, columns: dict[str, Any]) -> Recording:
    write_run(run_log(columns), folder / f"{name}.parquet")
    return Recording(folder / f"{name}.parquet")


def roles(composed: Any) -> dict[str, tuple[str, str, str | None]]:
    """Return kind, role and repeat of each run, by its name."""
    short = {run.file: Path(run.file).stem for run in composed.runs}
    return {short[r.file]: (r.kind.value, r.role, None if r.repeats is None else short[r.repeats]) for r in composed.runs}


def test_columns_tell_kinds_and_courses_tell_repeats(tmp_path: Path) -> None:
    runs = [air(tmp_path, "a"), air(tmp_path, "b"), air(tmp_path, "c", 2.0 * MOTION), warm_up(tmp_path, "morning")]
    done = compose_runs(runs, DESCRIPTION, tmp_path / "case")
    assert roles(done) == {
        "a": ("air", "fit", None),
        "b": ("air", "fit", "a"),
        "c": ("air", "check", None),
        "morning-fit": ("warmup", "fit", None),
        "morning-check": ("warmup", "check", None),
    }
    assert {note.split(":")[0] for note in done.notes} >= {"a is taken for kind air", "b repeats a", "c is kept to judge on"}
    case = read_case(tmp_path / "case")
    assert [len(run.log) for run in case.runs] == [r.rows for r in done.runs] and case.runs[0].log.t_s[0] == 0.0


def test_what_nothing_repeats_is_the_judge_before_what_something_does(tmp_path: Path) -> None:
    runs = [air(tmp_path, "c", 2.0 * MOTION), air(tmp_path, "a"), air(tmp_path, "b")]
    assert roles(compose_runs(runs, DESCRIPTION, tmp_path / "case"))["c"] == ("air", "check", None)


def test_a_name_tells_a_role_and_fit_never_repeats_check(tmp_path: Path) -> None:
    runs = [air(tmp_path, "air_check"), air(tmp_path, "air_fit"), air(tmp_path, "air_fit_2")]
    assert roles(compose_runs(runs, DESCRIPTION, tmp_path / "case")) == {
        "air_check": ("air", "check", None),
        "air_fit": ("air", "fit", None),
        "air_fit_2": ("air", "fit", "air_fit"),
    }


def test_what_is_said_counts_more_than_what_is_guessed(tmp_path: Path) -> None:
    one = air(tmp_path, "air_fit")
    other = air(tmp_path, "other", 3.0 * MOTION)
    said = [
        Recording(one.path, kind=RunKind.CUT, role="check"),
        Recording(other.path, kind=RunKind.CUT, role="fit", repeats="air_fit"),
    ]
    assert roles(compose_runs(said, DESCRIPTION, tmp_path / "case")) == {
        "air_fit": ("cut", "check", None),
        "other": ("cut", "fit", "air_fit"),
    }


def test_a_repeat_of_what_is_fitted_is_no_judge(tmp_path: Path) -> None:
    runs = [Recording(air(tmp_path, "a").path, role="fit"), air(tmp_path, "b")]
    done = compose_runs(runs, DESCRIPTION, tmp_path / "case")
    assert roles(done) == {"a": ("air", "fit", None), "b": ("air", "fit", "a")} and not done.has_check


def test_forces_are_a_cut_and_lines_are_a_program(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text("G1 X1 F100\n")
    lines = written(tmp_path, "lines", {"t_s": T_S, "line": np.floor(T_S)})
    runs = [air(tmp_path, "cut", force_x_n=MOTION), Recording(lines.path, program=tmp_path / "part.nc")]
    done = compose_runs(runs, DESCRIPTION, tmp_path / "case")
    assert {name: kind for name, (kind, _, _) in roles(done).items()} == {"cut": "cut", "lines": "program"}
    assert (tmp_path / "case" / "runs" / "lines.nc").read_text() == "G1 X1 F100\n"


def test_a_healthy_run_is_marked_and_never_the_judge(tmp_path: Path) -> None:
    healthy = Recording(warm_up(tmp_path, "before", 2).path, healthy=True)
    done = compose_runs([warm_up(tmp_path, "after"), healthy], DESCRIPTION, tmp_path / "case")
    assert [(Path(r.file).stem, r.role, r.healthy) for r in done.runs] == [
        ("after-fit", "fit", False),
        ("after-check", "check", False),
        ("before", "fit", True),
    ]


def test_what_cannot_be_told_is_asked_for_in_one_line(tmp_path: Path) -> None:
    nothing = written(tmp_path, "nothing", {"t_s": T_S, "vibration_rms_g": T_S})
    with pytest.raises(UsageError, match="say --kind nothing=air, cut, warmup or program"):
        compose_runs([nothing], DESCRIPTION, tmp_path / "case")
    with pytest.raises(UsageError, match="two recordings have this name"):
        compose_runs([nothing, Recording(tmp_path / "b" / "nothing.parquet")], DESCRIPTION, tmp_path / "case")
    with pytest.raises(UsageError, match="is said to repeat z, which is none of nothing"):
        compose_runs([Recording(nothing.path, repeats="z")], DESCRIPTION, tmp_path / "case")
    with pytest.raises(RunLogError, match="there is no such file"):
        compose_runs([Recording(tmp_path / "gone.parquet")], DESCRIPTION, tmp_path / "case")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["nothing.parquet"]
