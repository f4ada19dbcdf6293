"""The public surface of `import cnctwin`: these names, no more; the same for a type checker; and light until one is asked for."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import cnctwin

SURFACE = {
    "ApplicationError",
    "BrokerError",
    "CaseError",
    "Diagnosis",
    "LimitsError",
    "MachineError",
    "MachineFile",
    "MissingPackageError",
    "Optimised",
    "ProgramError",
    "Row",
    "Run",
    "RunError",
    "Signal",
    "Simulated",
    "Store",
    "StoreError",
    "StoredSignal",
    "UsageError",
    "Watch",
    "diagnose",
    "open_store",
    "optimise",
    "read_machine",
    "read_run",
    "simulate",
    "watch",
    "write_run",
}
PAGE = Path(__file__).parents[3] / "docs" / "reference" / "python.md"


def loaded_after(text: str) -> set[str]:
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


def test_these_names_are_public_and_no_other() -> None:
    assert set(cnctwin.__all__) == SURFACE
    assert [name for name in SURFACE if getattr(cnctwin, name).__name__ != name] == []
    assert set(dir(cnctwin)) >= SURFACE
    with pytest.raises(AttributeError, match="no attribute 'optimize'"):
        _ = cnctwin.optimize  # type: ignore[attr-defined]


def test_a_type_checker_sees_the_names_where_they_are() -> None:
    tree = ast.parse(Path(cnctwin.__file__).read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    seen = {alias.asname: node.module for node in imports for alias in node.names if alias.asname}
    assert seen == cnctwin._PLACE_OF


def test_importing_it_loads_nothing_and_a_name_loads_only_what_it_needs() -> None:
    listed = (
        "import importlib, sys; before = set(sys.modules); import cnctwin; {}; print(*(set(sys.modules) - before), sep='\\n')"
    )
    assert loaded_after(listed.format("pass")) == {"cnctwin"}
    after_watch = loaded_after(listed.format("cnctwin.watch"))
    assert "cnctwin.interface.watching" in after_watch
    assert after_watch & {"numpy", "scipy", "numba", "pyarrow", "pandas", "typer"} == set()
    assert loaded_after(listed.format("cnctwin.open_store")) & {"scipy", "numba", "pandas"} == set()


WITHOUT = """
import sys

class Lacking:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Lacking())
import cnctwin
try:
    cnctwin.Run.of({"t_s": [0.0]}).frame()
except ImportError as error:
    print(type(error).__name__, error, sep="\\n")
"""


@pytest.mark.parametrize(("missing", "who"), [("pyarrow", "cnctwin.Run"), ("pandas", "a frame")])
def test_a_missing_package_is_one_line_with_the_extra_that_brings_it(missing: str, who: str) -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT, missing], capture_output=True, text=True, check=True, timeout=60)
    kind, line = done.stdout.splitlines()
    assert kind == "MissingPackageError"
    assert line == f"{who} needs the package {missing}; pip install 'cnctwin[notebook]' brings it"


def test_the_page_names_all_of_it() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert [name for name in sorted(SURFACE) if name not in page] == []
