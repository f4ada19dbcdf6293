"""One attempt at a job: a process of its own, with all that it starts, so that what becomes of it harms nobody else.

Its standard input is a pipe from us: when that closes, because we ended in whatever way, it ends with all its own processes.
"""

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from cnctwin.jobs.left_over import JOB_VARIABLE, end_left_over
from cnctwin.processes.given_broker import PASSWORD_VARIABLE

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Small matrices: threads of linear algebra would only fight for the cores, with those that are live too."""


class Attempt:
    """Begins when it is made. Raises OSError where it cannot be started."""

    def __init__(self, command: Sequence[str], folder: Path, attempt: int) -> None:
        self._folder = folder
        self._began_s = time.monotonic()
        environment = {**ONE_THREAD, **{key: value for key, value in os.environ.items() if key != PASSWORD_VARIABLE}}
        with (folder / "child.log").open("ab" if attempt > 1 else "wb") as log:
            self._process = subprocess.Popen(
                [*command, str(folder), "--attempt", str(attempt)],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**environment, JOB_VARIABLE: str(folder)},
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """The id of the process."""
        return self._process.pid

    @property
    def seconds(self) -> float:
        """The seconds it has run."""
        return time.monotonic() - self._began_s

    def ended(self) -> str | None:
        """Return how it ended; None while it runs.

        >>> how_ended(-9), how_ended(1)
        ('killed by SIGKILL', 'ended with exit code 1')
        """
        code = self._process.poll()
        if code is None:
            return None
        self.kill()
        return how_ended(code)

    def kill(self) -> None:
        """End it and all that it started."""
        self._process.kill()
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        end_left_over(self._folder)


def how_ended(code: int) -> str:
    """An exit code in words."""
    if code >= 0:
        return f"ended with exit code {code}"
    with suppress(ValueError):
        return f"killed by {signal.Signals(-code).name}"
    return f"killed by signal {-code}"
