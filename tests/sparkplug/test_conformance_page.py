"""The page that says which statement is held by which test is the one that the tests give."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts" / "conformance"


def _check(*, script: Path = SCRIPT) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(script), "--check"], capture_output=True, text=True, check=False, timeout=60)


def test_the_page_is_up_to_date_and_every_marker_names_a_statement() -> None:
    result = _check()
    assert result.returncode == 0, result.stderr


def test_the_list_has_the_299_statements() -> None:
    groups = tomllib.loads((ROOT / "tests" / "sparkplug" / "tck_ids.toml").read_text())
    statements = [statement for group in groups.values() for statement in group]
    assert len(statements) == len(set(statements)) == 299
    assert all(re.fullmatch(r"tck-id-[A-Za-z0-9-]+", statement) for statement in statements)
    concerns = [concern for group in groups.values() for concern in group.values()]
    assert set(concerns) == {"edge", "host", "edge, host", "broker"}
    assert concerns.count("broker") == 11


def _tree(tmp_path: Path, test: str) -> Path:
    """A small project with one test; hands back its script."""
    for folder in ("scripts", "docs/reference", "tests/sparkplug"):
        (tmp_path / folder).mkdir(parents=True)
    script = tmp_path / "scripts" / "conformance"
    script.write_text(SCRIPT.read_text())
    (tmp_path / "tests" / "sparkplug" / "tck_ids.toml").write_text('["One"]\ntck-id-a = "edge"\ntck-id-b = "host"\n')
    (tmp_path / "tests" / "test_it.py").write_text(test)
    return script


def test_a_marker_with_a_statement_that_does_not_exist_is_an_error(tmp_path: Path) -> None:
    script = _tree(tmp_path, '@pytest.mark.tck("tck-id-a", "tck-id-z")\ndef test_it(): pass\n')
    result = _check(script=script)
    assert result.returncode == 1
    assert "'tck-id-z'" in result.stderr


def test_a_page_that_does_not_fit_the_tests_is_an_error(tmp_path: Path) -> None:
    script = _tree(tmp_path, '@pytest.mark.tck("tck-id-a")\ndef test_it(): pass\n')
    assert _check(script=script).returncode == 1
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True, timeout=60)
    assert _check(script=script).returncode == 0
    assert "1 of the 2 statements" in (tmp_path / "docs" / "reference" / "conformance.md").read_text()


def test_a_statement_whose_test_is_expected_to_fail_is_not_held(tmp_path: Path) -> None:
    test = '@pytest.mark.xfail(strict=True, reason="the reason")\n@pytest.mark.tck("tck-id-a")\ndef test_it(): pass\n'
    script = _tree(tmp_path, test)
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True, timeout=60)
    page = (tmp_path / "docs" / "reference" / "conformance.md").read_text()
    assert "- `tck-id-a` (edge): the reason" in page
    assert "- `tck-id-b` (host): no test names it" in page
