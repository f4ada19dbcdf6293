"""Real servers on free loopback ports, which keep port and data over `kill` and `start`."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import httpx

from tests.wire.mosquitto import free_port

STARTUP_S_MAX = 20.0
_INFLUX = """
reporting-disabled = true
bind-address = "127.0.0.1:{rpc}"
[meta]
  dir = "{folder}/meta"
[data]
  dir = "{folder}/data"
  wal-dir = "{folder}/wal"
  index-version = "tsi1"
[monitor]
  store-enabled = false
[http]
  bind-address = "127.0.0.1:{port}"
  log-enabled = false
[ifql]
  enabled = false
[logging]
  level = "error"
"""


class ServerProcess:
    """A server's process."""

    name = ""
    package = ""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        folder.mkdir(parents=True, exist_ok=True)
        self._process: subprocess.Popen[bytes] | None = None

    @classmethod
    def missing(cls) -> str:
        """Why it cannot be run here; '' = it can."""
        return "" if shutil.which(cls.name) else f"{cls.name} is not installed (Debian package {cls.package})"

    def start(self) -> None:
        """Start it and wait until it answers."""
        with (self.folder / "log").open("ab") as log:
            self._process = subprocess.Popen(self.command(), stdout=log, stderr=subprocess.STDOUT, cwd=self.folder)
        deadline = time.monotonic() + STARTUP_S_MAX
        while True:
            try:
                if httpx.get(f"http://127.0.0.1:{self.port}{self.sign_of_life}", verify=False).status_code < 300:
                    return
            except httpx.HTTPError:
                pass
            if time.monotonic() > deadline or self._process.poll() is not None:
                raise RuntimeError(f"{self.name} does not start: {(self.folder / 'log').read_text()[-2000:]}")
            time.sleep(0.02)

    def kill(self) -> None:
        """kill -9."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End it."""
        self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait(20)
            self._process = None

    def command(self) -> list[str]:
        raise NotImplementedError

    sign_of_life = "/ping"
    scheme = ""

    def url(self, port: int | None = None) -> str:
        """Its URL as a store; by another port where something is put in front of it."""
        return f"{self.scheme}://127.0.0.1:{port or self.port}"


class VictoriaMetrics(ServerProcess):
    """A single VictoriaMetrics."""

    name, package = "victoria-metrics", "victoria-metrics"
    sign_of_life = "/health"
    scheme = "victoriametrics+http"
    deduplicates = False

    def command(self) -> list[str]:
        flags = ["-dedup.minScrapeInterval=1ms"] if self.deduplicates else []
        return [
            self.name,
            f"-storageDataPath={self.folder / 'data'}",
            f"-httpListenAddr=127.0.0.1:{self.port}",
            "-retentionPeriod=10y",
            "-memory.allowedBytes=200MB",
            "-loggerLevel=ERROR",
            *flags,
        ]

    def flush(self) -> None:
        """Make searchable what was written."""
        httpx.get(f"http://127.0.0.1:{self.port}/internal/force_flush", verify=False).raise_for_status()


class Influxd(ServerProcess):
    """An InfluxDB 1.x."""

    name, package = "influxd", "influxdb"
    scheme = "influx1+http"

    def command(self) -> list[str]:
        config = self.folder / "influxd.conf"
        config.write_text(_INFLUX.format(folder=self.folder, port=self.port, rpc=free_port()))
        return [self.name, "-config", str(config)]

    def flush(self) -> None:
        """Nothing: what is written is searchable."""


def given_influx2() -> str:
    """The URL of a real InfluxDB 2 in $CNCTWIN_INFLUX_URL (with organisation; the token in its own variable), '' = none."""
    return os.environ.get("CNCTWIN_INFLUX_URL", "")
