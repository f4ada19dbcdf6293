"""Pieces of a job for the tests of how they are spread: quick, slow, faulty, deadly."""

import json
import os
import signal
import time
from pathlib import Path

from twin.errors import MachineError, PartProgramError

TOGETHER_S_MAX = 60.0


def squared(text: str) -> str:
    """`[3]` → `{"square": 9, "process": …}`; `[3, folder, 0.2]` leaves a mark there and works for so many seconds.

    `[3, folder, 0.2, 2]`: and until two processes have left marks; one may be there long before the other.
    """
    number, *more = json.loads(text)
    if more:
        folder, seconds, processes = (*more, 1)[:3]
        Path(folder, f"{number}-{os.getpid()}").touch()
        end_s, give_up_s = time.process_time() + seconds, time.monotonic() + TOGETHER_S_MAX
        while time.process_time() < end_s:
            pass
        while len({mark.name.partition("-")[2] for mark in Path(folder).iterdir()}) < processes and time.monotonic() < give_up_s:
            time.sleep(0.01)
    return json.dumps({"square": number**2, "process": os.getpid()})


def refused(text: str) -> str:
    """Blames the input, with an error whose arguments are not its text."""
    raise PartProgramError(7, "G2", f"a bow without {json.loads(text)}")


def unknown_machine(text: str) -> str:
    """Blames the input too."""
    raise MachineError(f"machine.toml: {text}")


def broken(text: str) -> str:
    """A fault of our own."""
    return str(1 / len(json.loads(text)))


def deadly(text: str) -> str:
    """Kills its worker; so often as the second element says, each time leaving a mark in the folder."""
    folder, times = json.loads(text)
    marks = len(list(Path(folder).iterdir()))
    if marks < times:
        Path(folder, str(marks)).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return json.dumps(marks)
