"""A Mosquitto with the files of deploy/, certificates by deploy/certificates, and clients that come with every kind of paper."""

from __future__ import annotations

import getpass
import os
import re
import shutil
import socket
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from sparkplug.broker import BrokerAddress
from tests.recordings import PROJECT
from tests.wire.mosquitto import find_mosquitto, free_port

DEPLOY = PROJECT / "deploy"
EDGES, PROCESSORS, PEOPLE, PASSWORD_EDGES, EAR = 8883, 8884, 8885, 8886, 0
BY_CERTIFICATE = ("edge-okuma", "edge-other")
BY_PASSWORD = {"people": ("viewer", "operator", "edge-okuma"), "edges": ("edge-mill", "edge-okuma")}
STARTUP_S_MAX = 60.0
FOR_2_0, FOR_2_1 = "mosquitto.conf", "mosquitto-2.1.conf"
PLUGINS = "/usr/lib/x86_64-linux-gnu/mosquitto"


def certificates(*arguments: object) -> str:
    """Run the script; what it says. Raises CalledProcessError, with its error."""
    command = ["bash", str(DEPLOY / "certificates"), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def password_of(user: str) -> str:
    """The password that a user of the plant has."""
    return f"pass word of {user}"


def plugin_folder() -> Path | None:
    """Return the folder of the plugins of Mosquitto 2.1, by MOSQUITTO_PLUGINS or Debian's habit; None where there are none."""
    folder = Path(os.environ.get("MOSQUITTO_PLUGINS", PLUGINS))
    return folder if (folder / "mosquitto_acl_file.so").exists() else None


class Plant:
    """The authority, the broker, and the addresses of all who may come in. Ports are those of the file, mapped to free ones."""

    def __init__(self, home: Path, shipped: str = FOR_2_0) -> None:
        self.home, self.authority = home, home / "authority"
        self.shipped = DEPLOY / "mosquitto" / shipped
        self.ports = {port: free_port() for port in (EDGES, PROCESSORS, PEOPLE, PASSWORD_EDGES, EAR)}
        self._process: subprocess.Popen[bytes] | None = None

    def build(self) -> None:
        """Certificates, users and configuration, as docs/how-to/security.md says."""
        certificates("init", self.authority)
        certificates("server", self.authority, "broker", "--host", "localhost", "--host", "127.0.0.1")
        for name in (*BY_CERTIFICATE, "processors"):
            certificates("client", self.authority, name)
        etc = self.home / "etc"
        (etc / "certs").mkdir(parents=True)
        for mine, theirs in (
            ("ca.pem", "ca.pem"),
            ("crl.pem", "crl.pem"),
            ("broker.pem", "server.pem"),
            ("broker.key", "server.key"),
        ):
            shutil.copy(self.authority / mine, etc / "certs" / theirs)
        for rules in (DEPLOY / "mosquitto").glob("*.acl"):
            shutil.copy(rules, etc)
        for file, users in BY_PASSWORD.items():
            path = etc / f"{file}.passwords"
            path.write_text("".join(f"{user}:{password_of(user)}\n" for user in users))
            path.chmod(0o600)
            subprocess.run(["mosquitto_passwd", "-U", str(path)], check=True, capture_output=True)
        (etc / "mosquitto.conf").write_text(self._configuration())

    def _configuration(self) -> str:
        """The file as shipped: only where things lie and which ports are free here differ. Last, a listener for the test to
        hear with what really got through."""
        text = self.shipped.read_text().replace(PLUGINS, str(plugin_folder()))
        text = text.replace("/etc/mosquitto/", f"{self.home}/etc/").replace("/var/lib/mosquitto/", f"{self.home}/")
        text, mapped = re.subn(
            r"^listener (\d+)$", lambda found: f"listener {self.ports[int(found[1])]} 127.0.0.1", text, flags=re.M
        )
        assert mapped == len(self.ports) - 1
        # Started as root it would change to a user that may not read the key in this folder.
        return f"{text}\nlistener {self.ports[EAR]} 127.0.0.1\nallow_anonymous true\nuser {getpass.getuser()}\n"

    def start(self) -> None:
        """Start the broker and wait until all its listeners take connections."""
        program = find_mosquitto()
        assert program is not None
        with (self.home / "log").open("ab") as log:
            command = [program, "-c", str(self.home / "etc" / "mosquitto.conf")]
            self._process = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        deadline_s = time.monotonic() + STARTUP_S_MAX
        for port in self.ports.values():
            while True:
                try:
                    socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
                    break
                except OSError:
                    assert self._process.poll() is None, self.log
                    assert time.monotonic() < deadline_s, self.log
                    time.sleep(0.01)

    def stop(self) -> None:
        """End the broker."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._process = None

    def take_new_crl(self) -> None:
        """Give the broker the list of revoked certificates as it is now."""
        shutil.copy(self.authority / "crl.pem", self.home / "etc" / "certs" / "crl.pem")
        self.stop()
        self.start()

    @property
    def log(self) -> str:
        """Return what the broker said."""
        return (self.home / "log").read_text(errors="replace")

    def with_certificate(self, name: str, listener: int = EDGES, authority: Path | None = None) -> BrokerAddress:
        """As who holds this certificate."""
        folder = authority or self.authority
        papers = {"certificate_file": folder / f"{name}.pem", "key_file": folder / f"{name}.key"}
        return BrokerAddress("127.0.0.1", self.ports[listener], tls=True, ca_file=self.authority / "ca.pem", **papers)

    def with_password(self, user: str, listener: int = PEOPLE) -> BrokerAddress:
        """As who knows the password of this user."""
        plain = BrokerAddress("127.0.0.1", self.ports[listener], tls=True, username=user, ca_file=self.authority / "ca.pem")
        return plain.with_password(password_of(user))

    @property
    def ear(self) -> BrokerAddress:
        """The listener of the test: no papers, no rules."""
        return BrokerAddress("127.0.0.1", self.ports[EAR])

    def of(self, who: str) -> BrokerAddress:
        """The address of each user of the plant, by a short name."""
        if who in BY_CERTIFICATE:
            return self.with_certificate(who)
        if who == "processors":
            return self.with_certificate(who, PROCESSORS)
        if who == "edge-mill":
            return self.with_password(who, PASSWORD_EDGES)
        return self.with_password(who)


def with_version(address: BrokerAddress, version: int) -> BrokerAddress:
    """The same with MQTT 3.1.1 (4) or 5."""
    return replace(address, mqtt_version=version)


def need_programs() -> None:
    """Skip the test where what it needs is not there."""
    for program in ("openssl", "mosquitto_passwd"):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine; install the packages openssl and mosquitto")
