"""A command whose package is not installed says so in one line, and which extra brings it, before it looks at any file."""

import subprocess
import sys
from pathlib import Path

import pytest

COMMANDS = {
    "simulate p.nc --machine m.toml": "the twin",
    "identify case": "the twin",
    "identify case --method ga": "the twin",
    "gap diagnose case --out found": "the twin",
    "gap score m.toml case": "the twin",
    "gap check --cases 1": "the twin",
    "optimise p.nc --machine m.toml --out o.nc": "the optimiser",
    "import p.txt --out r.parquet": "the twin",
    "import p.txt --out r.parquet --devices d.xml": "the twin",
    "import store --machine vmc --from 1 --to 2 --out r.parquet": "a run log",
    "store export vmc --from 1 --to 2 --out r.parquet": "a run log",
    "model promote residual vmc abc": "promoting",
    "model golden residual vmc --run r.parquet": "a golden week",
    "model compare residual vmc abc --runs r.parquet": "comparing",
    "validate --machine vmc --runs r.parquet": "validation",
}
WRITE_A_MACHINE = (
    "identify case",
    "identify case --method ga",
    "gap diagnose case --out found",
    "gap check --cases 1",
    "optimise p.nc --machine m.toml --out o.nc",
)
NEEDED = {"numpy": tuple(COMMANDS), "pyarrow": tuple(COMMANDS), "tomli_w": WRITE_A_MACHINE}
WITHOUT = """
import sys
sys.modules[sys.argv[1]] = None
from cnctwin.cli import main
for command in sys.argv[2:]:
    sys.argv = ["cnctwin", *command.split()]
    try:
        main()
    except SystemExit as ended:
        print(ended.code, flush=True)
"""


@pytest.mark.parametrize("package", NEEDED)
def test_a_missing_package_is_one_line_and_exit_code_2(package: str, tmp_path: Path) -> None:
    commands = NEEDED[package]
    asked = [sys.executable, "-c", WITHOUT, package, *commands]
    done = subprocess.run(asked, capture_output=True, text=True, cwd=tmp_path, timeout=120, check=False)
    lines = done.stderr.splitlines()
    assert done.stdout.split() == ["2"] * len(commands), done.stderr
    for command, line in zip(commands, lines, strict=True):
        who = COMMANDS[command]
        assert line.startswith(f"cnctwin: {who} needs the package {package}; pip install 'cnctwin[twin"), command
