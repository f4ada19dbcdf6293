"""TLS with a client certificate, and a user with a password, against a real Mosquitto; certificates made on the spot."""

import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from sparkplug.admission.limits import Limits
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.wire.mosquitto import free_port

pytestmark = [pytest.mark.broker, pytest.mark.usefixtures("way")]
NODE = NodeId("cnc", "edge-tls")
PATIENCE_S = 60.0
LONG = "G01 X" * 20_000  # several TLS records: what the socket still holds is not seen by select


def openssl(*arguments: str, folder: Path) -> None:
    subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[BrokerAddress]:
    """A Mosquitto that lets in only who has our certificate and knows the password `pass word`."""
    if shutil.which("openssl") is None or shutil.which("mosquitto_passwd") is None:
        pytest.skip("needs openssl and mosquitto_passwd to make certificates and users")
    home = tmp_path_factory.mktemp("tls")
    days = ("-days", "2")
    openssl(
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-keyout",
        "ca.key",
        "-out",
        "ca.pem",
        "-subj",
        "/CN=plant",
        *days,
        folder=home,
    )
    for name in ("server", "client"):
        (home / f"{name}.ext").write_text("subjectAltName=IP:127.0.0.1\n")
        openssl(
            "req",
            "-newkey",
            "rsa:2048",
            "-nodes",
            "-keyout",
            f"{name}.key",
            "-out",
            f"{name}.csr",
            "-subj",
            f"/CN={name}",
            folder=home,
        )
        signing = ("-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-extfile", f"{name}.ext")
        openssl("x509", "-req", "-in", f"{name}.csr", "-out", f"{name}.pem", *signing, *days, folder=home)
    subprocess.run(["mosquitto_passwd", "-b", "-c", "users", "edge", "pass word"], cwd=home, check=True, capture_output=True)
    port = free_port()
    (home / "mosquitto.conf").write_text(
        f"listener {port} 127.0.0.1\ncafile {home}/ca.pem\ncertfile {home}/server.pem\nkeyfile {home}/server.key\n"
        f"require_certificate true\nallow_anonymous false\npassword_file {home}/users\nmax_queued_messages 0\nuser root\n"
    )
    with (home / "log").open("wb") as log:
        process = subprocess.Popen([mosquitto_program, "-c", str(home / "mosquitto.conf")], stdout=log, stderr=log)
    deadline_s = time.monotonic() + PATIENCE_S
    while b"running" not in (home / "log").read_bytes():
        assert process.poll() is None and time.monotonic() < deadline_s, (home / "log").read_text()
        time.sleep(0.02)
    files = f"ca_file={home}/ca.pem&certificate_file={home}/client.pem&key_file={home}/client.key"
    yield BrokerAddress.from_url(f"mqtts://edge@127.0.0.1:{port}?{files}").with_password("pass word")
    process.terminate()
    process.wait()


@pytest.mark.parametrize("version", [4, 5])
def test_births_and_long_data_pass_through_tls(secured: BrokerAddress, version: int) -> None:
    address = replace(secured, mqtt_version=version)
    host, edge = HostApplication(address, "tls", limits=Limits(text_bytes_max=200_000)), EdgeNode(address, NODE)
    edge.declare_device("vmc", [MetricSpec("nc_block", DataType.STRING)])
    host.start()
    deadline_s = time.monotonic() + PATIENCE_S
    while not host.online and time.monotonic() < deadline_s:
        host.poll(0.1)
    edge.start()
    seen: list[object] = []
    try:
        while not edge.online and time.monotonic() < deadline_s:
            host.poll(0.05)
        for number in range(30):
            assert edge.publish("vmc", [Change("nc_block", f"{number} {LONG}", number)])
        while len(seen) < 30 and time.monotonic() < deadline_s:
            seen += [event.readings[0].value for event in host.poll(0.2) if event.kind is EventKind.DATA]
    finally:
        edge.stop()
        host.stop()
    assert seen == [f"{number} {LONG}" for number in range(30)], host.last_error


@pytest.mark.parametrize("wrong", ["password", "certificate", "authority"])
def test_who_has_the_wrong_papers_does_not_come_in_and_learns_why(secured: BrokerAddress, wrong: str) -> None:
    address = {
        "password": secured.with_password("wrong"),
        "certificate": replace(secured, certificate_file=None, key_file=None),
        "authority": replace(secured, ca_file=None),
    }[wrong]
    edge = EdgeNode(address, NODE)
    edge.start()
    deadline_s = time.monotonic() + PATIENCE_S
    while not edge.last_error and time.monotonic() < deadline_s:
        time.sleep(0.05)
    online, error = edge.online, edge.last_error
    edge.stop()
    assert not online
    assert error and "pass word" not in error and "wrong" not in error
