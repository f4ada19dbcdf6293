"""Constants of machines in processors.toml still count, and the log tells where each of them belongs."""

import logging
import subprocess
import sys
from pathlib import Path

import pytest

from processors.running.runtime import configured
from tests.wire.mosquitto import free_port

OLD = """
[thermal]
ambient_temp_c = 21.0
resistance_k_per_w = 0.2

[thermal.machines.okuma]
ambient_temp_c = 23.0
capacity_j_per_k = 8000.0

[cutting_force.machines.okuma]
tool_diameter_mm = 10.0

[gap]
rated_power_kw = 7.5
"""
LINES = [
    "[thermal] resistance_k_per_w belongs in machines/<name>.toml, [thermal]; it is used until a machine has a file",
    "[thermal.machines.okuma] capacity_j_per_k belongs in machines/okuma.toml, [thermal]; it is used until okuma has a file",
    "[cutting_force.machines.okuma] tool_diameter_mm belongs in machines/okuma.toml, [tool]; it is used until okuma has a file",
]


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A configuration as it was before machines had a description."""
    file = tmp_path / "processors.toml"
    file.write_text(OLD)
    return file


def test_each_constant_of_a_processor_that_runs_is_one_warning(old: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        pairs = configured(["thermal", "cutting_force"], old)
    assert caplog.messages == [f"{old}: {line}" for line in LINES]
    of_thermal = pairs[0][1]
    assert (of_thermal.of("okuma").resistance_k_per_w, of_thermal.of("mazak").capacity_j_per_k) == (0.2, None)  # type: ignore[attr-defined]


def test_a_configuration_without_constants_is_silent(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[thermal]\nambient_temp_c = 21.0\n\n[cutting_force.machines.okuma]\nsettle_s = 2.0\n")
    configured(["thermal", "cutting_force", "gap"], file)
    assert caplog.messages == []


def test_the_command_tells_them_on_stderr(old: Path, tmp_path: Path) -> None:
    """Its broker is not there, so it goes on trying until it is ended."""
    command = [sys.executable, "-m", "cnctwin", "process", "thermal", "cutting_force", "--config", str(old)]
    command += ["--broker", f"mqtt://127.0.0.1:{free_port()}", "--state-dir", str(tmp_path / "state")]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            told = [process.stderr.readline().strip() for _ in LINES]
        finally:
            process.terminate()
    assert [line.partition("processors.toml: ")[2] for line in told] == LINES
