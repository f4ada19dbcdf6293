"""Stretches that outlive the buckets: their samples are copied to the bucket `cnc_pinned`, which has no end.

A pin concerns what was there before it and what is still to come. What comes is put into both buckets as it comes; what was there
is copied by `copy`, a slice at a time, as soon as the ring has handed over all that it held when the pin was set.
"""

from collections.abc import Callable, Iterable

from cnctwin.memory.store.contract import DERIVED, RAW, Pinned, merged
from cnctwin.memory.store.influx.address import PINNED
from cnctwin.memory.store.influx.line_protocol import fields, influx_line, tags
from cnctwin.memory.store.influx.sample_row import SampleRow
from cnctwin.memory.store.influx.spool import Batch, PinnedCopy, Spool

PINS = "SELECT machine, from_ms, to_ms, reason FROM pins WHERE ?1 IS NULL OR machine = ?1"
SLICE_MS = 60_000
SLICES_AT_ONCE = 30
Samples = Callable[[str, str, int, int], list[SampleRow]]


class Pins:
    """The pins of one ring's folder; one thread but for `all`."""

    def __init__(self, spool: Spool) -> None:
        self._spool = spool
        self._stretches: dict[str, list[tuple[int, int]]] = {}
        for pinned in self.all():
            self._stretches.setdefault(pinned.machine, []).append((pinned.from_ms, pinned.to_ms))

    def all(self, machine: str | None = None) -> list[Pinned]:
        """Return all pins, oldest first; those of a machine that overlap are one, with all their reasons."""
        return merged(Pinned(*row) for row in self._spool.ask(PINS, (machine,)))

    def add(self, pinned: Pinned) -> None:
        """Keep a stretch; twice the same is once."""
        put = "INSERT OR IGNORE INTO pins VALUES (?, ?, ?, ?, ?, ?)"
        if self._spool.write(put, (*pinned, self._spool.last, pinned.from_ms)):
            self._stretches.setdefault(pinned.machine, []).append((pinned.from_ms, pinned.to_ms))

    def holds(self, machine: str, t_ms: int) -> bool:
        """Return True if a sample lies in a pinned stretch."""
        if not self._stretches:
            return False
        return any(from_ms <= t_ms < to_ms for from_ms, to_ms in reversed(self._stretches.get(machine, ())))

    def copy(self, samples: Samples, passed: int, now_ms: int) -> int:
        """Copy what was there before, some slices of it; how many pins are whole now that were not."""
        asked = (
            "SELECT machine, from_ms, to_ms, reason, after_sequence, copied_ms FROM pins WHERE copied_ms < to_ms ORDER BY from_ms"
        )
        slices, finished = SLICES_AT_ONCE, 0
        for row in self._spool.ask(asked):
            copy = PinnedCopy(Pinned(*row[:4]), row[4], row[5])
            if passed < copy.after_sequence:
                continue
            copied_ms = copy.copied_ms
            while copied_ms < copy.pinned.to_ms and slices > 0:
                # What is not yet due comes through `holds`; nothing of it was there before the pin.
                to_ms = min(copied_ms + SLICE_MS, copy.pinned.to_ms) if copied_ms < now_ms else copy.pinned.to_ms
                if copied_ms < now_ms:
                    for name in (RAW, DERIVED):
                        self._spool.put(list(_batches(samples(copy.pinned.machine, name, copied_ms, to_ms))))
                    slices -= 1
                copied_ms = to_ms
                self._spool.write(
                    "UPDATE pins SET copied_ms = ? WHERE machine = ? AND from_ms = ? AND to_ms = ? AND reason = ?",
                    (copied_ms, *copy.pinned),
                )
            finished += copied_ms >= copy.pinned.to_ms
        return finished


def _batches(rows: Iterable[SampleRow]) -> Iterable[Batch]:
    lines, oldest_ms = [], 2**62
    for row in rows:
        lines.append(influx_line(tags(row.key, row.unit), row, fields(row)))
        oldest_ms = min(oldest_ms, row.t_us // 1000)
    if lines:
        yield Batch(PINNED, len(lines), oldest_ms, "".join(lines).encode())
