"""A real Mosquitto on a free loopback port, for tests that kill it and start it again."""

from __future__ import annotations

import getpass
import random
import shutil
import socket
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType

STARTUP_S_MAX = 30.0
START_ATTEMPTS_MAX = 5
PORT_ATTEMPTS_MAX = 100


def find_mosquitto() -> str | None:
    """The path of the broker's program; Debian keeps it in a directory that is not on a user's PATH."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


def free_port() -> int:
    """A loopback port that nobody has at this moment, and that no system gives away by itself.

    Of those that a system gives to whoever connects (above 32767 on Linux), one that is free for the moment of a restart may be
    another connection's when it is wanted again.
    """
    for _ in range(PORT_ATTEMPTS_MAX):
        port = random.SystemRandom().randrange(10_000, 32_768)  # hypothesis seeds the ordinary one alike in all workers
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise RuntimeError("no port is free")


class Mosquitto:
    """A broker that keeps its port over `kill` and `restart`; with `persistent`, its retained messages too."""

    def __init__(self, *, persistent: bool = False, extra: tuple[str, ...] = ()) -> None:
        self.port = 0
        self._persistent = persistent
        self._extra = extra
        self._process: subprocess.Popen[bytes] | None = None
        self._directory: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Mosquitto:
        self._directory = tempfile.TemporaryDirectory(prefix="mosquitto-")
        for attempt in range(START_ATTEMPTS_MAX):
            self.port = free_port()
            try:
                self.start()
                break
            except RuntimeError:
                # Somebody may have taken the port since it was probed.
                if attempt == START_ATTEMPTS_MAX - 1:
                    self._directory.cleanup()
                    raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.stop()
        assert self._directory is not None
        self._directory.cleanup()

    @property
    def address(self) -> tuple[str, int]:
        """Return where clients connect."""
        return ("127.0.0.1", self.port)

    @property
    def log(self) -> str:
        """Return what the broker said since the test began."""
        return (self._home / "log").read_text(errors="replace")

    @property
    def _home(self) -> Path:
        assert self._directory is not None, "Mosquitto is used as a context manager"
        return Path(self._directory.name)

    def start(self) -> None:
        """Start the broker and wait until it takes connections; raises RuntimeError with its log otherwise."""
        program = find_mosquitto()
        if program is None:
            raise RuntimeError("no mosquitto on this machine; install the package mosquitto")
        config = self._home / "mosquitto.conf"
        config.write_text("\n".join(self._config()) + "\n")
        with (self._home / "log").open("ab") as log:
            command = [program, "-c", str(config)]
            self._process = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        deadline = time.monotonic() + STARTUP_S_MAX
        while time.monotonic() < deadline and self._process.poll() is None:
            if self._listens():
                return
            time.sleep(0.01)
        self.stop()
        raise RuntimeError(f"mosquitto did not start on port {self.port}: {self.log}")

    def _listens(self) -> bool:
        try:
            socket.create_connection(self.address, timeout=1.0).close()
        except OSError:
            return False
        return True

    def _config(self) -> list[str]:
        lines = [
            f"listener {self.port} 127.0.0.1",
            "allow_anonymous true",
            "max_queued_messages 0",
            "max_inflight_messages 0",
            # Started as root it would change to a user that may not write into this directory.
            f"user {getpass.getuser()}",
            f"persistence {'true' if self._persistent else 'false'}",
        ]
        if self._persistent:
            lines += [f"persistence_location {self._home}/", "autosave_interval 1", "autosave_on_changes true"]
        return lines + list(self._extra)

    def kill(self) -> None:
        """End the broker as a power cut does (-9)."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def stop(self) -> None:
        """End the broker as an administrator does."""
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(timeout=5.0)
            except subprocess.TimeoutExpired:
                self.kill()
            self._process = None

    def restart(self) -> None:
        """Start the broker again on the same port, after `kill` or `stop` or from running."""
        self.stop()
        self.start()
