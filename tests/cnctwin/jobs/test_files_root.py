"""Files that a request names lie below one folder, whatever the request, a link or a case.toml says."""

from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.jobs.files_root import FilesRoot

CASE = "[case]\nname = 'c'\nmachine = '{machine}'\n[[runs]]\nfile = '{run}'\nkind = 'air'\nrole = 'fit'\n"


@pytest.fixture
def root(tmp_path: Path) -> FilesRoot:
    """With a case and a link to each side."""
    inside = tmp_path / "files"
    (inside / "case").mkdir(parents=True)
    (inside / "part.nc").write_text("G0 X1")
    (inside / "case/machine.toml").write_text("[machine]\nname = 'vmc'")
    (inside / "case/run.csv").write_text("t_s\n0\n")
    (tmp_path / "secret.toml").write_text("[machine]\nname = 'secret'")
    (inside / "out.toml").symlink_to(tmp_path / "secret.toml")
    (inside / "same.nc").symlink_to(inside / "part.nc")
    (inside / "up").symlink_to(tmp_path)
    (inside / "ring").symlink_to(inside / "ring")
    return FilesRoot(inside)


@pytest.mark.parametrize(
    "name",
    [
        "../secret.toml",
        "case/../../secret.toml",
        "out.toml",
        "up/secret.toml",
        "/etc/passwd",
        "ring",
        "a\0b",
        "",
        ".",
        "case",
        "no.nc",
    ],
)
def test_what_lies_outside_or_is_no_file_is_refused_by_name(root: FilesRoot, name: str) -> None:
    with pytest.raises(UsageError) as refused:
        root.file(name, "program")
    assert str(refused.value).startswith(f"program = {name!r}: ")
    assert "secret" not in str(refused.value).replace(name, "")


@pytest.mark.parametrize("name", ["part.nc", "./part.nc", "case/../part.nc", "same.nc"])
def test_what_lies_inside_is_read(root: FilesRoot, name: str) -> None:
    assert root.text(name, "program") == "G0 X1"


def test_a_text_that_is_too_long_is_not_read(root: FilesRoot) -> None:
    with pytest.raises(UsageError, match="has more than 4 bytes"):
        root.text("part.nc", "program", 4)


@pytest.mark.parametrize(
    ("machine", "run"), [("../../secret.toml", "run.csv"), ("machine.toml", "/etc/passwd"), ("../out.toml", "run.csv")]
)
def test_a_case_that_names_files_outside_is_refused(root: FilesRoot, machine: str, run: str) -> None:
    assert root.folder is not None
    (root.folder / "case/case.toml").write_text(CASE.format(machine=machine, run=run))
    with pytest.raises(UsageError, match="leads out of the consumer's files folder"):
        root.case("case", "case")


def test_a_case_inside_is_found_with_the_text_of_its_machine(root: FilesRoot) -> None:
    assert root.folder is not None
    (root.folder / "case/case.toml").write_text(CASE.format(machine="machine.toml", run="run.csv"))
    folder, machine = root.case("case", "case")
    assert folder == root.folder / "case"
    assert "vmc" in machine


@pytest.mark.parametrize("text", ["[case", "runs = 3", "case = 3\nruns = [1]", "[case]\nmachine = 7"])
def test_a_case_toml_of_any_shape_is_refused_in_one_line(root: FilesRoot, text: str) -> None:
    assert root.folder is not None
    (root.folder / "case/case.toml").write_text(text)
    with pytest.raises(UsageError) as refused:
        root.case("case", "case")
    assert "\n" not in str(refused.value)


def test_without_a_folder_no_file_can_be_named() -> None:
    with pytest.raises(UsageError, match="this consumer knows no files; start it with --files"):
        FilesRoot().file("part.nc", "program")
