"""A consumer that knows how to count, as a process to be killed: `python -m tests.cnctwin.jobs.consumer_on_trial PORT DIR`."""

import logging
import sys
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.jobs.consumer import Consumer, Setting
from cnctwin.jobs.job_queue import Limits
from cnctwin.processes.stopping import stopped_by_signals
from sparkplug.broker import BrokerAddress
from tests.cnctwin.jobs.counting import register

COUNTING = (sys.executable, "-m", "tests.cnctwin.jobs.counting")
QUICK = Limits(pause_s=0.01)


def setting(limits: Limits = QUICK, files: Path | None = None, session_file: Path | None = None) -> Setting:
    """With jobs that count."""
    register()
    return Setting(files=files, limits=limits, session_file=session_file, child=COUNTING)


def main() -> None:
    """See the module."""
    logging.basicConfig(level=logging.INFO)
    port, folder = int(sys.argv[1]), Path(sys.argv[2])
    with stopped_by_signals() as stop:
        try:
            consumer = Consumer(folder, BrokerAddress(port=port), setting(session_file=folder.parent / "twin-jobs.json"))
        except UsageError as error:
            raise SystemExit(str(error)) from None
        consumer.run(stop)


if __name__ == "__main__":
    main()
