"""A law is tried on the same examples in every clone, whatever ran before it (tests/conftest.py)."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LAW = """
import sys
from hypothesis import given, strategies as st
import tests.conftest

for name in sys.argv[1:]:
    __import__(name)

@given(st.lists(st.integers() | st.floats() | st.text() | st.binary()))
def law(values):
    tried.append(values)

runs = []
for _ in range(2):
    tried = []
    law()
    runs.append(repr(tried))
for run in runs:
    print(run)
"""


def examples(folder: Path, full: str, seed: str, *imported: str) -> tuple[str, str]:
    """Return what two runs of the law are tried on, in a process with those modules `imported` and hashes seeded by `seed`."""
    (folder / "law.py").write_text(LAW)
    environment = os.environ | {"CI": "true", "CNCTWIN_FULL": full, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "law.py", *imported], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    return first, second


def test_the_examples_do_not_depend_on_the_folder_on_hashes_or_on_what_is_imported(tmp_path: Path) -> None:
    first, second = examples(tmp_path, "", "0")
    (other := tmp_path / "other").mkdir()
    assert first == second
    assert examples(other, "", "1", "processors.config", "edge.config", "sparkplug.topics") == (first, second)


def test_the_full_run_draws_new_ones_each_time(tmp_path: Path) -> None:
    first, second = examples(tmp_path, "1", "0")
    assert first != second
