"""Connections that stay silent, and log-ins that never end, against `cnctwin serve`: its memory, and how soon it answers others.

.venv/bin/python benchmarks/page/silent.py
"""

import http.client
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SILENT, UNFINISHED, BODY_BYTES = 305, 60, 7_900_000
HEAD = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"


def memory_mb(pid: int) -> int:
    """The resident memory of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) // 1024


def answered_ms(port: int, source: str) -> str:
    """Return how long somebody at this address waits for an answer."""
    began_s = time.monotonic()
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0, source_address=(source, 0))
    connection.request("GET", "/livez")
    status = connection.getresponse().status
    connection.close()
    return f"{status} after {(time.monotonic() - began_s) * 1000.0:.0f} ms"


def tell(what: str, port: int, pid: int) -> None:
    """One line."""
    others, same = answered_ms(port, "127.0.0.2"), answered_ms(port, "127.0.0.1")
    print(f"{what}: {memory_mb(pid)} MB; another address {others}, the same one {same}")


def attack(port: int, pid: int) -> None:
    """Both attacks, one after the other."""
    tell("before", port, pid)
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(SILENT)]
    tell(f"{SILENT} silent connections", port, pid)
    poured = [socket.create_connection(("127.0.0.1", port), timeout=1.0) for _ in range(UNFINISHED)]
    for one in poured:
        try:
            one.sendall(HEAD % BODY_BYTES + b'{"token": "' + b"x" * (BODY_BYTES - 1000))
        except OSError:
            continue
    tell(f"{UNFINISHED} log-ins of {BODY_BYTES / 1e6} MB that do not end", port, pid)
    for one in (*silent, *poured):
        one.close()


def main() -> None:
    """A server with a token and no broker, attacked."""
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder) / "state.json"
        options = (
            "--no-open",
            "--port",
            "0",
            "--broker",
            "mqtt://127.0.0.1:1",
            "--store",
            f"{folder}/none",
            "--state-file",
            str(state),
        )
        environment = {**os.environ, "CNCTWIN_PAGE_TOKEN": "a-token-of-more-than-sixteen", "CNCTWIN_STATE_DIR": folder}
        program = (sys.executable, "-m", "cnctwin", "serve", *options)
        with subprocess.Popen(program, env=environment, stdout=subprocess.DEVNULL) as server:
            try:
                while not state.exists():
                    time.sleep(0.1)
                attack(json.loads(state.read_text())["port"], server.pid)
            finally:
                server.terminate()


if __name__ == "__main__":
    main()
