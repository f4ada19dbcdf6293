"""The edge of `benchmarks/edges/cost.py outage`: a control that shows a look each 0.1 s of its own time, as fast as they are
taken.

    python -m benchmarks.edges.outage FOLDER PORT LOOKS ROWS_PER_S

It is the whole edge but for the wire to the control: sweeps, parse, tool change, store, session. Each look changes, and is one
row, so the number of a row is the number of its look plus one, whatever happened in between. Where it is started again it goes on
after the last look that is stored.
"""

import math
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from edge.config import BrokerSection, EdgeConfig, MachineSection, StoreSection
from edge.controls.mtconnect.adapter import ADAPTER
from edge.controls.mtconnect.config import MtconnectConfig
from edge.place import Place
from edge.running.run import edge_runtime
from edge.sample import EdgeSample, Offer, SampleSet
from edge.sweep import Fact, Sweep

ORIGIN_MS = 1_780_000_000_000
SIGNALS = (
    "spindle_rpm",
    "spindle_load_pct",
    "feed_mm_min",
    "axis_x_pos_mm",
    "axis_y_pos_mm",
    "axis_z_pos_mm",
    "axis_x_load_pct",
    "spindle_temp_c",
)
OFFERS = tuple(Offer(name, "simulated") for name in SIGNALS)


def sweep(look: int) -> bytes:
    """Return what the control shows."""
    at_s = look / 10
    facts = [Fact(name, round(50 + 40 * math.sin(at_s / (3 + i)) + look % 7 * 1e-3, 4)) for i, name in enumerate(SIGNALS)]
    return Sweep("life", look, ORIGIN_MS + look * 100, tuple(facts), interval_ms=100).encode()


def parse(_config: Any, cursor: int, raw: bytes) -> tuple[int, SampleSet]:
    """A look becomes one sample of each signal."""
    shown = Sweep.decode(raw)
    samples = tuple(EdgeSample(fact.key, fact.value, shown.t_ms, sequence=shown.number) for fact in shown.facts)
    return shown.number + 1, SampleSet(samples, received=len(samples), offers=OFFERS, newest_ms=shown.t_ms)


class Control:
    """Looks from where the edge stood, to the end of the day as fast as they are taken; from then on at 10 Hz."""

    reconnects, last_error = 0, ""

    def __init__(self, looks: int) -> None:
        self._looks, self._next = looks, 0
        self._closed = threading.Event()

    def follow(self, cursor: int) -> None:
        self._next = cursor

    def frames(self) -> Iterator[bytes]:
        while not self._closed.wait(0.0 if self._next < self._looks else 0.1):
            yield sweep(self._next)

    def silent_s(self) -> float:
        return 0.0

    def close(self) -> None:
        self._closed.set()


def main() -> None:
    folder, port, looks, rows_per_s = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
    adapter = replace(
        ADAPTER,
        start=lambda _config: 0,
        place=lambda cursor: Place("life", cursor),
        resume=lambda _config, kept: kept.next_sequence,
        parse=parse,
        connect=lambda _config: Control(looks),
    )
    config = EdgeConfig(
        source=MtconnectConfig(),
        machine=MachineSection(name="vmc", lost_after_s=1e6),
        broker=BrokerSection(url=f"mqtt://127.0.0.1:{port}", session_file=str(folder / "session"), primary_host="reader"),
        store=StoreSection(history_rows_per_s=rows_per_s, free_bytes_min=0),
    )
    runtime = edge_runtime(config, adapter=adapter)
    runtime.run()


if __name__ == "__main__":
    main()
