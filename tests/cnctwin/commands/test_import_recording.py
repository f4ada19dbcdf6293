"""`cnctwin import`: what is printed, and the exit codes."""

import json
import subprocess
import sys
from pathlib import Path

from twin.runlog import read_run

SAMPLES = Path(__file__).parent.parent / "importing" / "dialects" / "samples"
OBSERVED = (
    "2017-02-01T00:00:0{0}.0Z|Program_Status|ACTIVE\n2017-02-01T00:00:0{0}.5Z|Block_Number|12\n"
    "2017-02-01T00:00:0{1}.0Z|Program_Status|PROGRAM_COMPLETED\n"
)


def imported(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cnctwin", "import", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_a_draft_on_standard_output_is_the_map_of_the_second_call(tmp_path: Path) -> None:
    first = imported(SAMPLES / "delimited.csv", "--out", tmp_path / "run.parquet")
    assert (first.returncode, first.stderr.count("\n")) == (2, 1)
    assert "--map columns.toml" in first.stderr
    (tmp_path / "columns.toml").write_text(first.stdout)
    second = imported(SAMPLES / "delimited.csv", "--map", tmp_path / "columns.toml", "--out", tmp_path / "run.parquet", "--json")
    assert (second.returncode, second.stderr) == (0, "")
    assert json.loads(second.stdout)["rows"] == len(read_run(tmp_path / "run.parquet")) == 50


def test_what_is_taken_converted_and_left_out_is_printed(tmp_path: Path) -> None:
    done = imported(SAMPLES / "dynoware.txt", "--out", tmp_path / "run.csv")
    assert (done.returncode, done.stderr) == (0, "")
    assert "Fx [kN] · 1000" in done.stdout
    assert "not taken: Fz" in done.stdout
    assert len(read_run(tmp_path / "run.csv")) == 100


def test_an_override_that_a_part_recording_began_with_holds_in_the_next(tmp_path: Path) -> None:
    (tmp_path / "1.txt").write_text("2017-02-01T00:00:00.0Z|Feed_Override|70\n" + OBSERVED.format(1, 2))
    (tmp_path / "2.txt").write_text(OBSERVED.format(5, 8))
    done = imported(tmp_path / "1.txt", tmp_path / "2.txt", "--out", tmp_path / "run.parquet")
    assert (done.returncode, done.stderr) == (0, "")
    later = read_run(tmp_path / "run-2.parquet")
    assert set(later["feed_override_pct"]) == {70.0}


def test_wrong_input_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "noise.bin").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "empty.csv").write_bytes(b"")
    for arguments, message in (
        ((tmp_path / "none.csv",), "none.csv: cannot be read: No such file"),
        ((tmp_path / "empty.csv",), "empty.csv: is empty"),
        ((tmp_path / "noise.bin",), "is none of the files that can be read"),
        ((SAMPLES / "dynoware.txt", "--map", tmp_path / "none.toml"), "none.toml: cannot be read"),
    ):
        done = imported(*arguments, "--out", tmp_path / "run.parquet")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert message in done.stderr
