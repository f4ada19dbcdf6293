"""Processes of a job that are left when its own has ended: found by a variable of their environment, which they inherit.

A pid may belong to somebody else by now; an inherited variable does not. What keeps account of semaphores and shared memory
(multiprocessing's and joblib's resource trackers) is given a moment, in which it clears them away.
"""

import os
import signal
import time
from contextlib import suppress
from pathlib import Path

JOB_VARIABLE = "CNCTWIN_JOB"
TRACKER_S_MAX = 2.0
LEFT_OVER_S_MAX = 10.0
_TRACKER = b"resource_tracker"


def left_over(folder: Path) -> list[int]:
    """Processes of the job in this folder but for the one that asks (Linux; elsewhere none is found)."""
    mark = f"{JOB_VARIABLE}={folder}".encode()
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark in (process / "environ").read_bytes().split(b"\0") and int(process.name) != os.getpid():
                found.append(int(process.name))
    return found


def kill(pids: list[int], *, trackers: bool) -> None:
    """Kill them; `trackers`: also those that would clear away what the others leave."""
    for pid in pids:
        with suppress(OSError):
            if trackers or _TRACKER not in Path(f"/proc/{pid}/cmdline").read_bytes():
                os.kill(pid, signal.SIGKILL)


def end_left_over(folder: Path) -> None:
    """End all processes of the job in this folder, whose own has ended."""
    began_s = time.monotonic()
    while (left := left_over(folder)) and (waited_s := time.monotonic() - began_s) < LEFT_OVER_S_MAX:
        kill(left, trackers=waited_s > TRACKER_S_MAX)
        time.sleep(0.02)
