"""A peer's program in a process of its own, which speaks with a test by lines.

A pairing's lines are JSON. To an edge node: first `{"node": […], "device": […]}`, the metrics of the node and of its one
device, `lathe`; then `{"do": "data", "metrics": […]}` sends one DDATA, `{"do": "run", "count": n, "metric": …}` sends n of them
with the values 1 to n, `{"do": "device death"}` and `{"do": "device birth"}` take the device off and on, `{"do": "stop"}` ends
it. It writes `{"event": "started"}` and `{"event": "command", "device": …, "metrics": […]}`.

To a host application: `{"do": "rebirth" | "write", "node": …, "device": …, "metrics": […]}` sends a command, `{"do": "stop"}`
ends it. It writes `started`, and `birth`, `data`, `death` with `device` and `metrics`.

A metric is `{"name", "type", "value", "alias", "unit"}`: the type as the specification spells it, the value as a text (whole
numbers and DateTime in digits, bytes in hex, a DataSet as a table, a Template as its metrics) or null.
"""

from __future__ import annotations

import queue
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

ANSWER_S_MAX = 90.0  # a runtime itself needs seconds to start beside other tests


class PeerProcess:
    """The process; its lines are read by a thread, so that waiting for one can end."""

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        self._name = " ".join(command)[:200]
        self._process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.kill()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.strip())
        self._lines.put(None)  # it has ended: who waits is told at once

    def tell(self, line: str) -> None:
        """Write a line to the program."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")

    def hear(self, timeout_s: float = ANSWER_S_MAX) -> str:
        """Return the next line of the program."""
        try:
            line = self._lines.get(timeout=timeout_s)
        except queue.Empty:
            raise TimeoutError(f"{self._name} said nothing for {timeout_s} s, and runs") from None
        if line is None:
            raise EOFError(f"{self._name} has ended with exit code {self._process.wait()}")
        return line

    def ended(self, timeout_s: float) -> bool:
        """Return True where the program ends by itself in time."""
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        """End it as a power cut does (-9)."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()
