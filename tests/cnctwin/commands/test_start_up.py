"""The command line before a command is chosen: quick, and with nothing of what the extras bring."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

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


ALL_COMMANDS = """
import sys
from typer.main import get_command
from typer import Context
from cnctwin.cli import app
group = get_command(app)
for name in group.list_commands(Context(group)):
    assert group.get_command(Context(group), name).name == name
print(*sys.modules, sep="\\n")
"""


def _modules_after(text: str) -> set[str]:
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


def test_the_entry_point_loads_no_command_before_it_is_asked_for() -> None:
    loaded = _modules_after("import cnctwin.cli, sys; print(*sys.modules, sep='\\n')")
    assert "typer" in loaded
    assert not [name for name in loaded if name.startswith(("cnctwin.commands.", "sparkplug.host", "pydantic"))]


def test_the_commands_load_no_library_that_only_some_of_them_need() -> None:
    loaded = _modules_after(ALL_COMMANDS)
    assert {"cnctwin.commands.twin.gap", "cnctwin.commands.run.process", "typer"} <= loaded
    assert loaded & set(HEAVY) == set()
    services = {
        "cnctwin.api.server",
        "cnctwin.batch.diagnosis",
        "cnctwin.demo.demo",
        "cnctwin.running.edges",
        "twin.gap.diagnose",
    }
    assert [name for name in services if importlib.util.find_spec(name) is None] == []
    assert loaded & services == set()


RUN = """
import sys, threading
from pathlib import Path

import pytest
from cnctwin.running import processors
from processors.running.runtime import configured
from sparkplug.broker import BrokerAddress

name, config, folder = sys.argv[1], sys.argv[2] or None, Path(sys.argv[3])
recorders = []
processors.run = lambda *_, recorder, **__: recorders.append(type(recorder).__name__)
pairs = configured([name], config and Path(config))
processors.process(pairs, BrokerAddress("127.0.0.1", 9), threading.Event(), group="cnc", state_dir=folder)
print(*recorders, *sys.modules, sep="\\n")
"""
"""`cnctwin process`, without a broker."""


def _loaded_by(name: str, folder: Path, table: str = "") -> tuple[str, set[str]]:
    """The recorder's type, and what is loaded where a processor runs."""
    config = folder / "processors.toml"
    config.write_text(table)
    asked = [sys.executable, "-c", RUN, name, str(config) if table else "", str(folder)]
    recorder, *loaded = subprocess.run(asked, capture_output=True, text=True, check=True, timeout=60).stdout.split()
    return recorder, set(loaded)


def test_a_processor_that_runs_loads_neither_alerts_nor_the_store(tmp_path: Path) -> None:
    recorder, loaded = _loaded_by("thermal", tmp_path, "[alerts]\n[historian]\n[thermal]\n")
    assert recorder == "NoneType"
    ours = {name for name in loaded if name.startswith(("processors.", "cnctwin.memory"))}
    assert "processors.thermal" in ours
    assert not [name for name in ours if name.startswith(("processors.historian", "processors.alerts", "cnctwin.memory"))]
    assert loaded & set(HEAVY) == set()


def test_the_historian_brings_its_store_and_nothing_that_computes(tmp_path: Path) -> None:
    recorder, loaded = _loaded_by("historian", tmp_path, f"[historian]\nstore = '{tmp_path / 'store'}'\n")
    assert recorder == "StoreRecorder"
    assert loaded & {"scipy", "numba", "sklearn", "httpx", "fastapi"} == set()


def test_alerts_without_receivers_bring_no_courier(tmp_path: Path) -> None:
    recorder, loaded = _loaded_by("alerts", tmp_path)
    assert recorder == "NoneType"
    assert "processors.alerts.courier.thread" not in loaded
    assert loaded & set(HEAVY) == set()


def test_a_runner_on_kafka_claims_its_name_before_the_folds_are_loaded() -> None:
    pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")
    loaded = _modules_after("import cnctwin.kafka.claim, sys; print(*sys.modules, sep='\\n')")
    assert "cnctwin.kafka.transaction" in loaded
    assert not [name for name in loaded if name.startswith(("twin.", "processors.running", "processors.contract", "sparkplug."))]
