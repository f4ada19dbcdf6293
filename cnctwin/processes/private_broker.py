"""A Mosquitto of our own on loopback, for when no broker is given. It ends with the program.

Its limits are set so that nothing is dropped silently: by default Mosquitto throws away what a slow reader has not fetched
after 1,000 messages. Here it queues, up to a limit of memory, past which it refuses clients, which they notice.
"""

import os
import shutil
import socket
import time
from collections.abc import Sequence
from pathlib import Path

from cnctwin.errors import BrokerStartError, UsageError
from cnctwin.processes.child import Child
from cnctwin.processes.port import free_port, is_free
from sparkplug.broker import BrokerAddress

DEFAULT_PORT = 1883
MEMORY_BYTES_MAX = 512 * 1024 * 1024
START_S_MAX = 5.0

CONFIGURATION = """\
# Written by cnctwin for its private broker; loopback only.
listener {port} 127.0.0.1
allow_anonymous true
set_tcp_nodelay true
# 0 = no limit by number; memory_limit is the bound, and reaching it disconnects clients instead of dropping messages.
max_queued_messages 0
max_queued_bytes 0
max_inflight_messages 0
memory_limit {memory}
# Retained messages (snapshots, the plain mirror) survive a kill of the broker but for the last second.
persistence true
persistence_location {folder}/
autosave_interval 1
log_dest stderr
log_type error
log_type warning
log_type notice
"""


class PrivateBroker:
    """One Mosquitto on 127.0.0.1. `port` None takes 1883 where it is free, else any free port. `extra`: lines of its file."""

    def __init__(self, folder: Path, port: int | None = None, *, extra: Sequence[str] = ()) -> None:
        program = find_mosquitto()
        if port is not None and not is_free(port):
            raise UsageError(f"port {port} of 127.0.0.1 is in use; name another one with --port")
        self.port = port or (DEFAULT_PORT if is_free(DEFAULT_PORT) else free_port())
        folder = folder.resolve()
        folder.mkdir(parents=True, exist_ok=True)
        configuration = folder / "mosquitto.conf"
        written = CONFIGURATION.format(port=self.port, memory=MEMORY_BYTES_MAX, folder=folder)
        configuration.write_text(written + "".join(f"{line}\n" for line in extra))
        command = [program, "-c", str(configuration)]
        self.child = Child("mosquitto", command, folder / "mosquitto.log")
        if os.geteuid() == 0:
            # Mosquitto gives up root for the user of its package, who may not write into our folder.
            configuration.write_text(configuration.read_text() + "user root\n")

    @property
    def address(self) -> BrokerAddress:
        """The address at which clients find it."""
        return BrokerAddress("127.0.0.1", self.port)

    def start(self) -> None:
        """Start it and wait until it answers; raises BrokerStartError with its own words where it does not."""
        self.child.start()
        deadline_s = time.monotonic() + START_S_MAX
        while time.monotonic() < deadline_s:
            if not self.child.running:
                break
            if answers("127.0.0.1", self.port):
                return
            time.sleep(0.02)
        words = self.child.last_words()
        self.child.stop()
        raise BrokerStartError(f"Mosquitto does not answer on 127.0.0.1:{self.port} after {START_S_MAX:g} s: {words}")

    def watch(self) -> bool:
        """Start it again if it was killed; True where that was needed."""
        return self.child.watch()

    def stop(self) -> None:
        """End it."""
        self.child.stop()


def find_mosquitto() -> str:
    """The path of the program; raises BrokerStartError where it is not installed."""
    found = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
    if found is None:
        raise BrokerStartError("Mosquitto is not installed; run scripts/setup, or apt-get install mosquitto, or give --broker")
    return found


def answers(host: str, port: int) -> bool:
    """Return True if something accepts TCP connections there."""
    try:
        with socket.create_connection((host, port), timeout=0.5):
            return True
    except OSError:
        return False
