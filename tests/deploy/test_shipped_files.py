"""The files of deploy/ are what the programs that read them take."""

import shutil
import subprocess
from pathlib import Path

import pytest

from edge.config_file import load
from edge.running.run import broker_addresses
from tests.deploy.plant import DEPLOY

UNITS = sorted((DEPLOY / "systemd").glob("*.service"))
EXPOSURE_MAX = 2.0  # of 10, by systemd's own measure


@pytest.mark.parametrize("path", sorted((DEPLOY / "edges").glob("*.toml")), ids=lambda path: path.stem)
def test_an_edge_of_the_plant_is_configured_as_its_certificate_says(path: Path) -> None:
    config = load(path)
    (address,) = broker_addresses(config.broker, path)
    assert (config.node, address.port, address.tls, address.mqtt_version) == (f"edge-{path.stem}", 8883, True, 5)
    assert str(address.key_file) == f"/run/credentials/cnctwin-edge@{path.stem}.service/key"
    assert "LoadCredential=key:" in (DEPLOY / "systemd" / "cnctwin-edge@.service").read_text()


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_systemd_knows_every_line_of_a_unit_and_finds_it_hardened(unit: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze on this machine")
    verified = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    ours = [line for line in verified.stderr.split("\n") if unit.stem.split("@")[0] in line and "is not executable" not in line]
    assert ours == [], "only the program itself is not installed here"
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={EXPOSURE_MAX * 10:.0f}", str(unit)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_no_secret_stands_in_any_of_them() -> None:
    for path in DEPLOY.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            text = path.read_text()
            assert "PRIVATE KEY" not in text and "changeme" not in text, path
