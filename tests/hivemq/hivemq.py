"""HiveMQ Community Edition with the files of deploy/hivemq, in a Java process that ends with the tests. Built once by Maven."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import pytest

from sparkplug.broker import BrokerAddress
from tests.deploy.plant import certificates, password_of
from tests.recordings import PROJECT
from tests.wire import maven
from tests.wire.mosquitto import free_port

HERE = Path(__file__).parent
DEPLOY = PROJECT / "deploy" / "hivemq"
START_S_MAX = 120.0
MACHINES, PEOPLE, LOOPBACK, OPEN = 8883, 8885, 1883, 0
USERS = {"edge-okuma": "edge", "edge-other": "edge", "processors": "processors", "viewer": "viewer", "operator": "operator"}
KEYSTORE_PASSWORD = "of the key stores"
# In the test all start together, and only for a while: a quick start counts more than quick code.
JAVA_OPTIONS = ("-Xmx384m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-Djava.awt.headless=true")


def built() -> Path:
    """The folder with our classes and HiveMQ's; skips the test where it cannot be made."""
    return maven.built(HERE, "HiveMQ")


def hashed(password: str) -> str:
    """A password as deploy/hivemq/password prints it; in few rounds, since here hundreds of clients log in."""
    command = [sys.executable, str(DEPLOY / "password"), "100"]
    return subprocess.run(command, input=password + "\n", check=True, capture_output=True, text=True).stdout.strip()


class HiveMQ:
    """See the module. `port` and `address` are those of a listener without papers and rules, for tests of the session itself."""

    def __init__(self, home: Path) -> None:
        self.home, self.authority = home, home / "authority"
        self.ports = {port: free_port() for port in (MACHINES, PEOPLE, LOOPBACK, OPEN)}
        self.port = self.ports[OPEN]
        self._process: subprocess.Popen[str] | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Return where clients connect that bring nothing."""
        return ("127.0.0.1", self.port)

    def __enter__(self) -> HiveMQ:
        configuration, data = self.home / "conf", self.home / "data"
        for folder in (configuration, data):
            folder.mkdir()
        self._papers(configuration)
        (configuration / "config.xml").write_text(self._configuration(configuration))
        (configuration / "credentials.xml").write_text(self._credentials())
        self._start()
        return self

    def _start(self) -> None:
        classes, configuration, data = built(), self.home / "conf", self.home / "data"
        command = ["java", *JAVA_OPTIONS, "-cp", f"{classes}/classes:{classes}/lib/*", "cnctwin.Broker"]
        with (self.home / "log").open("ab") as log:
            self._process = subprocess.Popen(
                [*command, str(configuration), str(data), str(configuration / "credentials.xml")],
                cwd=self.home,
                env={**os.environ, "KEYSTORE_PASSWORD": KEYSTORE_PASSWORD},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        overdue = threading.Timer(START_S_MAX, self._process.kill)
        overdue.start()
        said: list[str] = []
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said.append(line)
            if line.strip() == "ready":
                break
        overdue.cancel()
        assert said and said[-1].strip() == "ready", f"HiveMQ did not start: {''.join(said)[-2000:]}"
        # What it says from now on must not fill the pipe.
        self._reader = threading.Thread(target=self._process.stdout.read)
        self._reader.start()

    def restart(self) -> None:
        """End it as a power cut does (-9) and start it again on the same ports."""
        self._kill()
        self._start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._kill()

    def _kill(self) -> None:
        assert self._process is not None and self._process.stdin is not None and self._process.stdout is not None
        self._process.kill()  # it has nothing to save, and takes its time to end
        self._process.wait()
        self._reader.join()
        self._process.stdin.close()
        self._process.stdout.close()

    def _papers(self, configuration: Path) -> None:
        certificates("init", self.authority)
        certificates("server", self.authority, "broker", "--host", "127.0.0.1")
        for name in ("edge-okuma", "processors"):
            certificates("client", self.authority, name)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KEYSTORE_PASSWORD", KEYSTORE_PASSWORD)
            certificates("keystore", self.authority, "broker")
        for store in ("broker.p12", "trust.p12"):
            shutil.copy(self.authority / store, configuration)

    def _configuration(self, configuration: Path) -> str:
        """The file as shipped: only where things lie and which ports are free here differ, and there is one listener more."""
        text = (
            (DEPLOY / "config.xml").read_text().replace("/opt/hivemq/conf/", f"{configuration}/").replace("0.0.0.0", "127.0.0.1")
        )
        text, mapped = re.subn(r"<port>(\d+)</port>", lambda found: f"<port>{self.ports[int(found[1])]}</port>", text)
        assert mapped == len(self.ports) - 1
        name = f"<name>session-tests</name><port>{self.port}</port><bind-address>127.0.0.1</bind-address>"
        return text.replace("</listeners>", f"<tcp-listener>{name}</tcp-listener></listeners>")

    def _credentials(self) -> str:
        """The file as shipped, with the users of the test in place of the examples that cannot log in."""
        users = "".join(
            f"<user><name>{name}</name><password>{hashed(password_of(name))}</password><roles>"
            f"{'<id>viewer</id>' if role == 'operator' else ''}<id>{role}</id></roles></user>"
            for name, role in USERS.items()
        )
        text = (DEPLOY / "credentials.xml").read_text()
        return re.sub(r"<users>.*</users>", lambda _: f"<users>{users}</users>", text, flags=re.DOTALL)

    def of(self, who: str) -> BrokerAddress:
        """The address of a user: machines come with a certificate and a password, people with a password."""
        ca_file = self.authority / "ca.pem"
        if who in ("viewer", "operator"):
            address = BrokerAddress("127.0.0.1", self.ports[PEOPLE], tls=True, username=who, ca_file=ca_file)
        else:
            paper = "processors" if who == "processors" else "edge-okuma"
            papers = {"certificate_file": self.authority / f"{paper}.pem", "key_file": self.authority / f"{paper}.key"}
            address = BrokerAddress("127.0.0.1", self.ports[MACHINES], tls=True, username=who, ca_file=ca_file, **papers)
        return replace(address.with_password(password_of(who)), mqtt_version=5)

    def on_loopback(self, who: str) -> BrokerAddress:
        """The address of a user on the broker's own machine, where there is no TLS; the rules are the same."""
        address = BrokerAddress("127.0.0.1", self.ports[LOOPBACK], username=who, mqtt_version=5)
        return address.with_password(password_of(who))

    @property
    def open(self) -> BrokerAddress:
        """The listener of the test: no papers, no rules."""
        return BrokerAddress("127.0.0.1", self.port)
