"""A process that appends numbered samples to a store until it is killed, and says after each append how far it is.

python -m tests.cnctwin.memory.store.influx.writer URL RING MACHINE FIRST LAST T0_MS
"""

import sys
from pathlib import Path

from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.influx.opening import open_influx
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

EVERY_MS = 10


def main() -> None:
    """Samples FIRST to LAST - 1 of `spindle_rpm`, whose values are their numbers, twenty at a time."""
    url, ring, machine, first, last, t0_ms = sys.argv[1:]
    store = open_influx(url, writable=True, spool=Path(ring))
    for begin in range(int(first), int(last), 20):
        numbers = range(begin, min(begin + 20, int(last)))
        messages = []
        for n in numbers:
            t_ms = int(t0_ms) + n * EVERY_MS
            told = Reading("spindle_rpm", n, t_ms, Quality.GOOD, "rev/min", None, False)
            messages.append(Message(t_ms, HostEvent(EventKind.DATA, NodeId("cnc", "hall"), machine, t_ms, (told,))))
        store.append(messages)
        sys.stdout.write(f"{numbers[-1] + 1}\n")
        sys.stdout.flush()
    store.close()


if __name__ == "__main__":
    main()
