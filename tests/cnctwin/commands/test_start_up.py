"""The command line before a command is chosen: quick, and with nothing of what the extras bring."""

import importlib.util
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

import cnctwin.commands
from cnctwin.cli import GROUPS

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
    groups = {group.folder for group in GROUPS}
    ours = {name for name in loaded if name.startswith(("cnctwin.commands.", "sparkplug.host", "pydantic"))}
    assert ours == {"cnctwin.commands.group", *groups}


NO_COMMAND = """
import os, sys
sys.argv = ["cnctwin", *sys.argv[1:]]
from cnctwin.cli import main
try:
    main()
except SystemExit:
    pass
print()
print(*sys.modules, sep="\\n")
"""


@pytest.mark.parametrize(
    ("words", "environment", "expected"),
    [
        (["--help"], {}, "Connect controls and recordings"),
        (["--version"], {}, f"cnctwin {version('cnctwin')}\n"),
        (["docter"], {}, ""),
        ([], {"_CNCTWIN_COMPLETE": "complete_bash", "COMP_WORDS": "cnctwin do", "COMP_CWORD": "1"}, "doctor\n"),
    ],
)
def test_help_version_and_completion_load_no_command(words: list[str], environment: dict[str, str], expected: str) -> None:
    command = [sys.executable, "-c", NO_COMMAND, *words]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=60, env=os.environ | {"COLUMNS": "80"} | environment
    )
    text, _, loaded = done.stdout.rpartition("\n\n")
    assert expected in text + "\n"
    groups = {group.folder for group in GROUPS}
    assert {name for name in loaded.split() if name.startswith("cnctwin.commands.")} == {"cnctwin.commands.group", *groups}


def test_the_help_lists_each_command_under_its_folder_in_one_line() -> None:
    command = [Path(sys.executable).with_name("cnctwin"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, env=os.environ | {"COLUMNS": "80"})
    _, *panels = done.stdout.split("\n╭─ ")
    shown = {panel.split(" ─")[0]: [line.strip("│ ") for line in panel.split("\n")[1:-1]] for panel in panels}
    for group in GROUPS:
        lines = [f"{name:<16}  {summary}" for name, (_, summary) in group.commands.items()]
        assert [line for line in shown[group.title] if line and not line.startswith("╰")] == lines


def test_the_groups_are_the_folders() -> None:
    folders = {path.parent for path in Path(cnctwin.commands.__file__).parent.glob("*/__init__.py")}
    assert {group.folder.rpartition(".")[2] for group in GROUPS} == {folder.name for folder in folders}
    names = [name for group in GROUPS for name in group.commands]
    assert len(names) == len(set(names))


BASH = """
eval "$(cnctwin --show-completion)"
COMP_WORDS=({words})
COMP_CWORD={at}
_cnctwin_completion cnctwin
echo "${{COMPREPLY[@]}}"
"""


@pytest.mark.parametrize(
    ("words", "at", "expected"),
    [
        ("cnctwin do", 1, "doctor"),
        ("cnctwin gap ''", 2, "case diagnose score check"),
        ("cnctwin gap diagnose --o", 3, "--out"),
    ],
)
def test_bash_completes_commands_subcommands_and_options(words: str, at: int, expected: str) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = BASH.format(words=words, at=at)
    environment = os.environ | {"PATH": path}
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, timeout=60, env=environment)
    assert done.stdout.split() == expected.split(), done.stderr


def test_a_mistyped_command_finds_its_neighbour() -> None:
    done = subprocess.run(
        [Path(sys.executable).with_name("cnctwin"), "docter"], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (2, "cnctwin: No such command 'docter'. Did you mean 'doctor'? See cnctwin --help\n")


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
