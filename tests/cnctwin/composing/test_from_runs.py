"""A case from recordings: what their columns and names tell, what options say, and what cannot be known."""

from dataclasses import replace
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


def strolled(folder: Path, name: str, begins: int, seed: int) -> Recording:
    """Return a recording of one long motion that begins at another row of it, with noise of its own."""
    ticks = np.arange(begins, begins + 2000)
    motion = np.round(40.0 * np.sin(ticks / 300.0) * np.sin(ticks / 1700.0), 4)
    noise = np.random.default_rng(seed).normal(0.0, 1e-4, len(ticks))
    return air(folder, name, motion, x_pos_mm=motion + noise)


def test_recordings_that_began_at_other_moments_of_one_motion_are_lined_up(tmp_path: Path) -> None:
    runs = [strolled(tmp_path, name, begins, n) for n, (name, begins) in enumerate((("a", 300), ("b", 0), ("c", 500)))]
    done = compose_runs(runs, DESCRIPTION, tmp_path / "case")
    assert roles(done) == {"a": ("air", "fit", None), "b": ("air", "fit", "a"), "c": ("air", "check", None)}
    a, b, c = (run.log for run in read_case(tmp_path / "case").runs)
    assert len(a) == len(b) == 1700 and len(c) == 2000
    assert np.array_equal(a["x_ref_mm"], b["x_ref_mm"]) and not np.array_equal(a["x_pos_mm"], b["x_pos_mm"])
    assert any(note.startswith("a, b did not begin at the same moment: they are cut to the 1.7 s") for note in done.notes)
    assert any(note.startswith("c is kept to judge on: another time, but no other motion") for note in done.notes)


def test_all_that_repeat_one_recording_share_one_stretch_of_it(tmp_path: Path) -> None:
    runs = [strolled(tmp_path, name, begins, n) for n, (name, begins) in enumerate((("a", 300), ("b", 0), ("c", 500)))]
    compose_runs([replace(one, role="fit") for one in runs], DESCRIPTION, tmp_path / "case")
    a, b, c = (run.log["x_ref_mm"] for run in read_case(tmp_path / "case").runs)
    assert len(a) == 1500 and np.array_equal(a, b) and np.array_equal(a, c)


def test_what_shares_less_than_its_half_is_no_repeat(tmp_path: Path) -> None:
    runs = [strolled(tmp_path, "a", 0, 1), strolled(tmp_path, "b", 1500, 2)]
    assert roles(compose_runs(runs, DESCRIPTION, tmp_path / "case"))["b"] == ("air", "check", None)
