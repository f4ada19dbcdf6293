"""The cost of the historian for a fleet: so many machines at 10 Hz, eleven readings a message, into the embedded store.

    python -m benchmarks.store.fleet                          # 200 machines, 20 s of them
    python -m benchmarks.store.fleet --machines 20 --seal      # and an hour of three machines, sealed

Processor time a message: of `keep`, which the loop of the processors pays, and of all with the thread that writes. `wait` is how
late a thread that sleeps a millisecond at a time wakes up while the store is written, which is what the loop would feel.
"""

import argparse
import json
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from cnctwin.memory import historian
from cnctwin.memory.historian import StoreRecorder
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.embedded import EmbeddedStore
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

HOUR_MS = 3_600_000
T0_MS = 1_790_000_000_000 // HOUR_MS * HOUR_MS
SIGNALS = (
    ("axis_x_pos_mm", "mm"), ("axis_y_pos_mm", "mm"), ("axis_z_pos_mm", "mm"), ("spindle_rpm", "rev/min"),
    ("spindle_load_pct", "%"), ("feed_mm_min", "mm/min"), ("axis_x_load_pct", "%"), ("axis_y_load_pct", "%"),
    ("spindle_temp_c", "°C"), ("line", None), ("exec_state", None),
)  # fmt: skip
EVERY_MS = 100


def event_of(machine: int, tick: int) -> HostEvent:
    """One message of a machine: nine figures, a line number and a text."""
    t_ms = T0_MS + tick * EVERY_MS + machine % EVERY_MS
    values: list[Any] = [round((tick * (i + 1) + machine) * 0.037 % 500, 3) for i in range(9)]
    values += [tick // 7, "ACTIVE" if tick // 300 % 4 else "READY"]
    told = zip(SIGNALS, values, strict=True)
    readings = tuple(Reading(name, value, t_ms, Quality.GOOD, unit, None, False) for (name, unit), value in told)
    return HostEvent(EventKind.DATA, NodeId("cnc", f"edge-{machine}"), f"vmc-{machine}", t_ms, readings)


def second_of(machines: int, second: int) -> list[Message]:
    """All messages of a second."""
    return [
        Message(T0_MS + tick * EVERY_MS + 30, event_of(machine, tick))
        for tick in range(10 * second, 10 * second + 10) for machine in range(machines)
    ]  # fmt: skip


class Wakes:
    """A thread that notes how late it wakes up."""

    def __init__(self) -> None:
        self.late_ms: list[float] = []
        self.cpu_s = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            began = time.perf_counter()
            time.sleep(0.001)
            self.late_ms.append(1000 * (time.perf_counter() - began) - 1)
        self.cpu_s = time.thread_time()

    def stop(self) -> dict[str, float]:
        """The 99th percentile and the longest."""
        self._ended.set()
        self._thread.join()
        p99_ms = statistics.quantiles(self.late_ms, n=100)[98]
        return {"wait_p99_ms": round(p99_ms, 2), "wait_longest_ms": round(max(self.late_ms), 2)}


def recorded(folder: Path, machines: int, seconds: int) -> dict[str, float]:
    """The recorder at the pace of the plant."""
    events = [[event_of(machine, tick) for machine in range(machines)] for tick in range(seconds * 1000 // EVERY_MS)]
    recorder = StoreRecorder(EmbeddedStore(folder, writable=True))
    recorder.start()
    wakes = Wakes()
    kept_s, began, began_cpu = 0.0, time.perf_counter(), time.process_time()
    for tick, some in enumerate(events):
        time.sleep(max(0.0, began + tick * EVERY_MS / 1000 - time.perf_counter()))
        received_ms = T0_MS + tick * EVERY_MS + 30
        before = time.thread_time()
        for event in some:
            recorder.keep(event, received_ms)
        kept_s += time.thread_time() - before
    waits = wakes.stop()
    recorder.stop()
    cpu_s, messages = time.process_time() - began_cpu - wakes.cpu_s, machines * len(events)
    assert recorder.health()["store_samples"] == messages * len(SIGNALS)
    return {
        "keep_us": round(1e6 * kept_s / messages, 2),
        "recorder_us_a_message": round(1e6 * cpu_s / messages, 1),
        **waits,
    }


def appended(folder: Path, machines: int, seconds: int, gather_s: float) -> dict[str, float]:
    """`append` alone, as many messages at once as come within `gather_s`."""
    ticks = max(round(1000 * gather_s / EVERY_MS), 1)
    store = EmbeddedStore(folder, writable=True)
    took = longest = 0.0
    messages = 0
    for first in range(0, seconds * 1000 // EVERY_MS, ticks):
        batch = [
            Message(T0_MS + tick * EVERY_MS + 30, event_of(machine, tick))
            for tick in range(first, first + ticks) for machine in range(machines)
        ]  # fmt: skip
        began, wall = time.process_time(), time.perf_counter()
        store.append(batch)
        took += time.process_time() - began
        longest = max(longest, time.perf_counter() - wall)
        messages += len(batch)
    hot_bytes = (folder / "store.sqlite").stat().st_size + (folder / "store.sqlite-wal").stat().st_size
    store.close()
    return {
        "append_us_a_message": round(1e6 * took / messages, 1),
        "append_us_a_sample": round(1e6 * took / messages / len(SIGNALS), 2),
        "append_longest_ms": round(1000 * longest, 1),
        "hot_bytes_a_sample": round(hot_bytes / messages / len(SIGNALS), 1),
    }


def sealed(folder: Path, machines: int) -> dict[str, float]:
    """An hour of some machines, sealed."""
    store = EmbeddedStore(folder, writable=True)
    for second in range(3600):
        store.append(second_of(machines, second))
    wakes = Wakes()
    began, hours_sealed, longest = time.process_time(), 0, 0.0
    while hours_sealed < machines:
        wall = time.perf_counter()
        hours_sealed += store.tidy(T0_MS + HOUR_MS + 900_000).sealed
        longest = max(longest, time.perf_counter() - wall)
    took = time.process_time() - began
    waits = wakes.stop()
    samples = machines * 36_000 * len(SIGNALS)
    size = sum(path.stat().st_size for path in folder.rglob("*.parquet"))
    store.close()
    return {
        "seal_us_a_sample": round(1e6 * took / samples, 2),
        "seal_us_a_message": round(1e6 * took / samples * len(SIGNALS), 1),
        "tidy_longest_ms": round(1000 * longest),
        "sealed_bytes_a_sample": round(size / samples, 2),
        **{f"seal_{name}": value for name, value in waits.items()},
    }


def main() -> int:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--seal", action="store_true", help="an hour of three machines, too")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    told: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="store-fleet-") as place:
        told |= appended(Path(place) / "append", options.machines, options.seconds, historian.GATHER_S)
        told |= recorded(Path(place) / "record", options.machines, options.seconds)
        if options.seal:
            told |= sealed(Path(place) / "seal", 3)
    if options.json:
        sys.stdout.write(json.dumps(told) + "\n")
        return 0
    for name, value in told.items():
        sys.stdout.write(f"{name:28} {value:>10}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
