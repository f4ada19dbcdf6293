"""The loop's service as a process to be killed: `python -m tests.cnctwin.loop.service_on_trial PORT MACHINES FILES JOBS [STORE]`.

With a store its children are the real ones.
"""

import logging
import sys
from pathlib import Path

from cnctwin.loop import service
from cnctwin.loop.config import LoopConfiguration
from cnctwin.loop.workshop import CHILD, Places
from cnctwin.processes.stopping import stopped_by_signals
from sparkplug.broker import BrokerAddress

QUICK = {"shadow_s": 0.0, "again_hours": 0.0, "shadow_hours": 0.0}


def main() -> None:
    """See the module."""
    logging.basicConfig(level=logging.INFO)
    port, machines, files, jobs = int(sys.argv[1]), *map(Path, sys.argv[2:5])
    store = sys.argv[5] if len(sys.argv) > 5 else ""
    service.LOOK_S = 0.1
    child = CHILD if store else (sys.executable, "-m", "tests.cnctwin.loop.child_on_trial")
    places = Places(store, files, jobs, machines / "diagnoses", child)
    with stopped_by_signals() as stop:
        service.LoopService(machines, BrokerAddress(port=port), LoopConfiguration(QUICK), places).run(stop)


if __name__ == "__main__":
    main()
