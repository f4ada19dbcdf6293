"""A day of a real machine through all processors again, twice: seconds, times real time, and whether both are the same bytes.

    .venv/bin/python benchmarks/replay.py RECORDING --devices Devices.xml

The recording goes into a store of its own first (cnctwin/importing/into_store.py). Then each processor alone: what costs
how much.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from cnctwin.importing.into_store import import_recording
from cnctwin.memory.replay import replay
from cnctwin.memory.store.opening import open_store
from processors.discovery import discover

LEFT_OUT = {"historian", "mirror"}


def main() -> int:
    """Print the figures; 1 where the two replays differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--devices", type=Path)
    options = parser.parse_args()
    names = sorted(set(discover()) - LEFT_OUT)
    with tempfile.TemporaryDirectory() as folder:
        store = open_store(Path(folder) / "store", writable=True)
        try:
            imported = import_recording(store, options.recording, options.devices, "machine")
            from_ms, to_ms = imported.from_ms, imported.to_ms + 1
            hours = (to_ms - from_ms) / 3_600_000
            print(f"{options.recording.name}: {hours:.1f} h, {imported.messages} messages, {imported.samples} samples")
            print(f"imported in {imported.seconds:.1f} s")
            both = []
            for _ in range(2):
                cpu_s = time.process_time()
                replayed = replay(store, "machine", from_ms, to_ms, names)
                cpu_s = time.process_time() - cpu_s
                both.append(replayed)
                rate = replayed.samples / replayed.seconds
                print(
                    f"{len(names)} processors: {replayed.seconds:.1f} s ({cpu_s:.1f} s of processor time), "
                    f"{replayed.speed:.0f} times real time, {rate:.0f} samples/s, sha256 {replayed.sha256}"
                )
            print("the same bytes twice" if both[0].sha256 == both[1].sha256 else "NOT the same bytes")
            for name in names:
                one = replay(store, "machine", from_ms, to_ms, [name])
                values = one.processors[0].recomputed
                print(f"  {name:22} {one.seconds:6.2f} s  {one.speed:8.0f} times real time  {values:7} values")
        finally:
            store.close()
    return 0 if both[0].sha256 == both[1].sha256 else 1


if __name__ == "__main__":
    sys.exit(main())
