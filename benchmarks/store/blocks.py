"""Measure what vibration costs: blocks of a second of three axes at 1 kHz, noise of some least significant bits, sealed; bytes
a sample.

python -m benchmarks.store.blocks
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.sealed.manifest import DAY_MS, HOUR_MS
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

T0_MS, NODE, HZ, AXES, SECONDS = 1_790_000_000_000 // DAY_MS * DAY_MS, NodeId("cnc", "edge-vmc"), 1000, "xyz", 600
RMS_LSB = (5, 30, 200)


def blocks(rms_lsb: int) -> list[Message]:
    """Ten minutes of a machine."""
    chance = np.random.default_rng(rms_lsb)
    told = []
    for second in range(SECONDS):
        t = T0_MS + second * 1000
        values = [tuple(np.rint(chance.normal(0, rms_lsb, HZ)).astype(int).tolist()) for _ in AXES]
        readings = [
            Reading(f"vibration_{a}_raw", v, t, Quality.GOOD, "LSB", None, False) for a, v in zip(AXES, values, strict=True)
        ]
        told.append(Message(t + 20, HostEvent(EventKind.DATA, NODE, "vmc", t, tuple(readings))))
    return told


def main() -> int:
    """One line for each amount of noise."""
    for rms_lsb in RMS_LSB:
        folder = Path(tempfile.mkdtemp())
        try:
            store = EmbeddedStore(folder, writable=True)
            messages = blocks(rms_lsb)
            began = time.process_time()
            for at in range(0, SECONDS, 10):
                store.append(messages[at : at + 10])
            appended = time.process_time() - began
            began = time.process_time()
            store.tidy(T0_MS + DAY_MS + HOUR_MS)
            sealed = time.process_time() - began
            size = sum(path.stat().st_size for path in folder.rglob("cnc_raw_blocks/**/*.parquet"))
            same = list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == messages
            store.close()
            samples = SECONDS * HZ * len(AXES)
            rates = f"appended at {samples / appended / 1e6:.1f} M samples/s, sealed at {samples / sealed / 1e6:.1f}"
            sys.stdout.write(f"rms {rms_lsb:>3} LSB: {size / samples:.2f} bytes a sample, {rates}, the same again: {same}\n")
        finally:
            shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
