"""Rows that the store lacks after the broker was killed for a while: the whole stack, four machines, edges as by default.

    python -m benchmarks.store.broker_away [--away 15] [--without]

--without: edges that wait for no receipts, as they did by default before. Rows are told by their number (`edge_sequence`): what
lies between the lowest and the highest of a machine, and is not in the store, is missing.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.stack import MACHINES, Stack
from cnctwin.memory.row_numbers import holes_text, saved_holes
from cnctwin.memory.store.contract import Query
from cnctwin.memory.store.opening import open_store
from edge.running.forwarder import SEQUENCE


def numbers_in(folder: Path) -> dict[str, set[int]]:
    """The numbers of rows that the store has, by machine."""
    store = open_store(folder / "store")
    now_ms = time.time_ns() // 1_000_000
    try:
        asked = {machine: store.query(Query(machine, (SEQUENCE,), 0, now_ms + 1))[0] for machine in MACHINES}
        sys.stdout.write(f"named: {holes_text(saved_holes(store, now_ms)) or 'none'}\n")
    finally:
        store.close()
    return {machine: {value for value in column.value if isinstance(value, int)} for machine, column in asked.items()}


def main() -> int:
    """Measure, and print; 0 where nothing is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--away", type=float, default=15.0, help="Seconds without a broker")
    parser.add_argument("--around", type=float, default=30.0, help="Seconds before it and after it")
    parser.add_argument("--without", action="store_true", help="Edges that wait for no receipts")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        stack = Stack(Path(folder))
        try:
            stack.start()
            for file in Path(folder, "edges").glob("*.toml") if asked.without else ():
                file.write_text(file.read_text() + "[store]\nawait_receipt = false\n")
            time.sleep(asked.around)
            assert stack.broker.child.pid is not None
            os.kill(stack.broker.child.pid, signal.SIGKILL)
            time.sleep(asked.away)
            stack.broker.child.stop()
            stack.broker.start()
            time.sleep(asked.around)
        finally:
            stack.stop()
        missing = 0
        for machine, numbers in numbers_in(Path(folder)).items():
            lacks = sorted(set(range(min(numbers), max(numbers) + 1)) - numbers)
            missing += len(lacks)
            spans = f", {lacks[0]} to {lacks[-1]}" if lacks else ""
            sys.stdout.write(f"{machine}: {len(numbers)} rows in the store, {len(lacks)} missing{spans}\n")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
