"""A process that appends, and says on stdout up to which message everything is there, until it is killed.

`python -m tests.cnctwin.memory.store.writes_until_killed FOLDER`: for each number that comes on stdin a child begins there; its
process id is told first, and `ended` when it is dead.
"""

import os
import sys
from pathlib import Path

from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.sealed import sealing
from cnctwin.memory.store.sealed import tier as sealed_tier
from tests.cnctwin.memory.store.told import HOUR_MS, T0_MS, steady

EVERY_MS, BATCH = 10_000, 200
assert sealed_tier  # imported here, so that no child has to


def write(folder: Path, first: int) -> None:
    """Batches of a machine, each followed by what is due; time goes with the messages, so that hours are sealed."""
    sealing.SAMPLES_MIN = 1000  # each hour is a file
    store = EmbeddedStore(folder, writable=True)
    while first < 500_000:
        store.append(steady(first * EVERY_MS, BATCH, every_ms=EVERY_MS, start=first))
        first += BATCH
        say(str(first))
        store.tidy(T0_MS + first * EVERY_MS + HOUR_MS // 6)


def say(text: str) -> None:
    """One line, at once."""
    os.write(1, f"{text}\n".encode())


def main() -> None:
    """One child after the other."""
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            write(Path(sys.argv[1]), int(line))
            os._exit(1)
        say(f"process {child}")
        os.waitpid(child, 0)
        say("ended")


if __name__ == "__main__":
    main()
