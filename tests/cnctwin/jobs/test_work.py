"""What a job leaves behind: the files of the command of the same name, and a summary; or one line that says why not."""

import json
from pathlib import Path

import pytest

from cnctwin.jobs.child import attempt
from cnctwin.jobs.files_root import FilesRoot
from tests.cnctwin.commands.test_gap import SECOND, written
from tests.cnctwin.jobs.counting import register
from tests.twin.gap.small_case import warm_case
from twin.machine import read_machine

MACHINE = """
[machine]
name = "small"
[tool]
diameter_mm = 6.0
teeth = 2
tangential_coefficient_n_per_mm2 = 1230.0
radial_ratio = 0.5
[limits]
feed_mm_min = [100.0, 500.0]
spindle_rpm = [1000.0, 8000.0]
[stock]
min_mm = [-20.0, -50.0, -20.0]
max_mm = [200.0, 50.0, 0.4]
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> FilesRoot:
    """With a case, and one that is none."""
    root = tmp_path_factory.mktemp("files")
    written(warm_case(SECOND), root / "warm")
    (written(warm_case(), root / "broken") / "case.toml").write_text("[case]\nname = 'b'\nmachine = 'machine.toml'\n")
    return FilesRoot(root)


def done(folder: Path, files: FilesRoot, **asked: object) -> dict[str, object]:
    """Return what the process of a job says in the end."""
    folder.mkdir(exist_ok=True)
    (folder / "request.json").write_text(json.dumps({"id": "a", **asked}))
    return attempt(folder, files, 1, None)


def test_identify_leaves_the_machine_and_how_well_it_is_known(tmp_path: Path, files: FilesRoot) -> None:
    (tmp_path / "result").mkdir()
    (tmp_path / "result/of-an-earlier-attempt").touch()
    told = done(tmp_path, files, job="identify", case="warm")
    assert told["state"] == "done", told
    summary = told["result"]
    assert isinstance(summary, dict)
    assert (
        set(summary["files"])
        == {"machine.toml", "identification.json"}
        == {file.name for file in (tmp_path / "result").iterdir()}
    )
    estimates = json.loads((tmp_path / "result/identification.json").read_text())["estimates"]
    known = sum(one["identifiable"] for one in estimates)
    assert (summary["constants"], summary["identifiable"]) == (len(estimates), known)
    assert str(summary["sentence"]).startswith(f"{known} of {len(estimates)} constants of small are known by the recordings")
    assert read_machine(tmp_path / "result/machine.toml").uncertainty
    progress = json.loads((tmp_path / "progress.json").read_text())
    assert 0.0 < progress["fraction"] < 1.0


def test_diagnose_leaves_answer_page_and_twin(tmp_path: Path, files: FilesRoot) -> None:
    told = done(tmp_path, files, job="diagnose", case="warm")
    assert told["state"] == "done", told
    answer = json.loads((tmp_path / "result/diagnosis.json").read_text())
    summary = told["result"]
    assert isinstance(summary, dict)
    assert set(summary["files"]) == {"diagnosis.json", "report.html", "twin.toml"}
    assert (
        (summary["verdict"], summary["sentence"]) == (answer["verdict"], answer["sentence"]) == ("explained", answer["sentence"])
    )
    assert summary["causes"][0].startswith("second_thermal_mass on ")
    assert read_machine(tmp_path / "result/twin.toml").effects[0].effect == "second_thermal_mass"


def test_optimise_leaves_program_answer_and_page_of_what_it_read_first(tmp_path: Path) -> None:
    root = tmp_path / "files"
    root.mkdir()
    (root / "slot.nc").write_bytes(b"G21 G90 (N\xfcrnberg)\r\nS6000 M3\r\nG1 X5 F300\r\nG1 X40\r\nM30\r\n")
    (root / "m.toml").write_text(MACHINE)
    asked = {
        "job": "optimise",
        "program": "slot.nc",
        "machine": "m.toml",
        "force_limit_n": 60.0,
        "evolutions": 2,
        "population": 8,
        "speed_changes": "in_air",
    }
    told = done(tmp_path / "job", FilesRoot(root), **asked)
    assert told["state"] == "done", told
    summary = told["result"]
    assert isinstance(summary, dict)
    assert set(summary["files"]) == {"optimised.nc", "optimisation.json", "report.html"}
    answer = json.loads((tmp_path / "job/result/optimisation.json").read_text())
    assert summary["sentence"] == f"slot.nc: {answer['sentence']}"
    assert answer["speed_changes"] == "in_air"
    assert summary["after"]["seconds"] == answer["after"]["seconds"] < summary["before"]["seconds"]
    assert (tmp_path / "job/result/optimised.nc").read_bytes().startswith(b"G21 G90 (N\xfcrnberg)\r\n")
    (root / "slot.nc").write_text("G1 X9 F100")  # edited while an attempt was killed
    assert (again := done(tmp_path / "job", FilesRoot(root), **asked)["result"])
    assert again["after"] == summary["after"]  # type: ignore[index]


def test_a_text_goes_back_in_the_encoding_of_the_file_that_it_came_from(tmp_path: Path) -> None:
    text = "G21 G90 (Nürnberg)\r\nS6000 M3\r\nG1 X5 F300\r\nG1 X40\r\nM30\r\n"
    asked = {"job": "optimise", "program_text": text, "encoding": "latin-1", "machine_toml": MACHINE, "force_limit_n": 60.0}
    assert done(tmp_path, FilesRoot(), evolutions=2, population=8, **asked)["state"] == "done"
    assert (tmp_path / "result/optimised.nc").read_bytes().startswith(b"G21 G90 (N\xfcrnberg)\r\n")


@pytest.mark.parametrize(
    ("fail", "state", "reason"),
    [
        ("input", "failed", "to = 7: is no number that can be counted to; take 8"),
        ("bug", "failed", "a fault of ours: ZeroDivisionError: of ours; child.log in its folder says where"),
        ("memory", "interrupted", "the memory was not enough"),
        ("cluster", "interrupted", "piece 1 of 2 is lost"),
    ],
)
def test_what_fails_says_why_in_one_line_and_whether_to_try_again(tmp_path: Path, fail: str, state: str, reason: str) -> None:
    register()
    assert done(tmp_path, FilesRoot(), job="count", to=1, fail=fail) == {"state": state, "reason": reason}


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"job": "diagnose", "case": "broken"}, "broken/case.toml: runs is missing"),
        ({"job": "diagnose", "case": "gone"}, "case = 'gone': is no folder with a case.toml below the consumer's files folder"),
        ({"job": "nothing"}, "request: job = 'nothing': is none of optimise, identify, diagnose"),
    ],
)
def test_wrong_input_fails_with_its_line_and_without_our_paths(
    tmp_path: Path, files: FilesRoot, asked: dict[str, object], said: str
) -> None:
    told = done(tmp_path, files, **asked)
    assert told["state"] == "failed"
    assert str(told["reason"]).startswith(said)
    assert str(files.folder) not in str(told["reason"])
