"""The notebooks of docs/notebooks: kept clean, and every cell of them runs, with warnings as errors.

They share one kernel, whose imports take longer than most cells; before each, every name of the one before it is forgotten.
"""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

nbformat = pytest.importorskip("nbformat", reason="no nbformat in this Python; scripts/setup test brings it")
nbclient = pytest.importorskip("nbclient", reason="no nbclient in this Python; scripts/setup test brings it")

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "docs" / "notebooks"
NAMES = ("diagnose", "optimise", "run-logs", "simulate", "store", "watch")
STRICT = "import warnings\nwarnings.simplefilter('error')\nwarnings.filterwarnings('ignore', module='ipykernel')"
FORGET = "%reset -f"
PATIENCE_S = 300
"""For a cell; the first simulation on a computer compiles for a minute."""


def cells_of(name: str) -> list[Any]:
    return list(nbformat.read(FOLDER / f"{name}.ipynb", as_version=4).cells)


@pytest.fixture(scope="module")
def executed(mosquitto_program: str) -> Mapping[str, list[Any]]:
    """The code cells of each notebook with their outputs."""
    new = nbformat.v4.new_code_cell
    cells, ends = [], {}
    for name in NAMES:
        code = [cell.source for cell in cells_of(name) if cell.cell_type == "code"]
        cells += [new(source) for source in (FORGET, STRICT, *code)]  # with ids of their own
        ends[name] = len(cells)
    # An error ends its own notebook's test and no other's.
    client = nbclient.NotebookClient(
        nbformat.v4.new_notebook(cells=cells),
        timeout=PATIENCE_S,
        kernel_name="python3",
        allow_errors=True,
        extra_arguments=["--log-level=ERROR"],
        resources={"metadata": {"path": str(FOLDER)}},
    )
    done = client.execute().cells
    begins = dict(zip(NAMES, [0, *ends.values()], strict=False))
    return {name: done[begins[name] : ends[name]] for name in NAMES}


def test_these_are_all_of_them_and_they_are_clean() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)
    done = subprocess.run(
        [sys.executable, ROOT / "scripts" / "notebooks", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", NAMES)
def test_each_says_who_it_is_for_and_what_one_sees(name: str) -> None:
    first = cells_of(name)[0]
    assert first.cell_type == "markdown" and first.source.startswith("# ")
    assert "For whoever" in first.source and "What you will see:" in first.source
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert f"notebooks/{name}.ipynb)" in page


@pytest.mark.broker
@pytest.mark.parametrize("name", NAMES)
def test_every_cell_of_a_notebook_runs(executed: Mapping[str, list[Any]], name: str) -> None:
    for cell in executed[name]:
        outputs = cell.outputs
        faults = ["\n".join(one.traceback) for one in outputs if one.output_type == "error"]
        assert faults == [], cell.source
        assert [one.text for one in outputs if one.output_type == "stream" and one.name == "stderr"] == [], cell.source
    assert sum(len(cell.outputs) for cell in executed[name]) >= 5
