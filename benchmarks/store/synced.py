"""The price of a store that outlives a power cut: SQLite's `synchronous` NORMAL and FULL, in turn, in one run.

    python -m benchmarks.store.synced [--machines 200] [--turns 40]

Each turn appends the batches of some seconds of so many machines at 10 Hz, half a second a batch as the historian takes them,
with one setting, then with the other. CPU is of the process, which leaves out what the disk does; wall is with it.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.store.fleet import EVERY_MS, T0_MS, event_of
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.embedded import EmbeddedStore

TICKS_A_BATCH, BATCHES_A_TURN = 5, 4
SETTINGS = ("NORMAL", "FULL")


def batch_of(machines: int, first: int) -> list[Message]:
    """Half a second."""
    return [
        Message(T0_MS + tick * EVERY_MS + 30, event_of(machine, tick))
        for tick in range(first, first + TICKS_A_BATCH)
        for machine in range(machines)
    ]


def main() -> int:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--turns", type=int, default=40)
    parser.add_argument(
        "--folder", type=Path, default=None, help="On the disk that is asked about; else where temporary files go"
    )
    asked = parser.parse_args()
    walls: dict[str, list[float]] = {setting: [] for setting in SETTINGS}
    cpus: dict[str, list[float]] = {setting: [] for setting in SETTINGS}
    with tempfile.TemporaryDirectory(dir=asked.folder) as folder:
        store = EmbeddedStore(Path(folder), writable=True)
        tick = 0
        for turn in range(asked.turns):
            for setting in SETTINGS if turn % 2 else SETTINGS[::-1]:
                store._writer.db.execute(f"PRAGMA synchronous = {setting}")
                for _ in range(BATCHES_A_TURN):
                    batch = batch_of(asked.machines, tick)
                    tick += TICKS_A_BATCH
                    wall, cpu = time.perf_counter(), time.process_time()
                    store.append(batch)
                    walls[setting].append(1000 * (time.perf_counter() - wall))
                    cpus[setting].append(1000 * (time.process_time() - cpu))
        store.close()
    messages = asked.machines * TICKS_A_BATCH
    for setting in SETTINGS:
        wall, cpu = walls[setting], cpus[setting]
        p95, median_ms = statistics.quantiles(wall, n=20)[18], statistics.median(cpu)
        sys.stdout.write(
            f"{setting:6}  CPU {median_ms:5.1f} ms a batch ({1000 * median_ms / messages:4.1f} µs a message)   "
            f"wall {statistics.median(wall):5.1f} ms, 95 % {p95:5.1f}, longest {max(wall):5.1f}   "
            f"{len(wall)} batches of {messages}\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
