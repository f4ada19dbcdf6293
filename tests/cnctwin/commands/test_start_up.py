"""The command line before a command is chosen: quick, and with nothing of what the extras bring."""

import subprocess
import sys

HEAVY = (
    "numpy",
    "scipy",
    "numba",
    "pyarrow",
    "duckdb",
    "fastapi",
    "uvicorn",
    "httpx",
    "sklearn",
    "joblib",
    "distributed",
    "asyncua",
)


def test_the_entry_point_loads_no_library_that_only_some_command_needs() -> None:
    text = "import cnctwin.cli, sys; print(*sys.modules, sep='\\n')"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=60)
    loaded = set(done.stdout.split())
    assert {"cnctwin.commands.gap", "typer"} <= loaded
    assert loaded & set(HEAVY) == set()
    services = {
        "cnctwin.api.server",
        "cnctwin.batch.diagnosis",
        "cnctwin.demo.demo",
        "cnctwin.running.edges",
        "twin.gap.diagnose",
    }
    assert loaded & services == set()
