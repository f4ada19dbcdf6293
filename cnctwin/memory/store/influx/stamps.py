"""Tells a sample that comes again, and numbers the different ones of one millisecond.

A sample is known by machine, node, signal, millisecond and what it says. What was told of a millisecond is remembered for
`AGE_MS`, in the ring's file; the newest of each signal and milliseconds with more than one sample for `NUMBERED_AGE_MS`, since
forgetting those would let a later one take the place of an earlier one. What comes again after that is written again, with the
same stamp: the server has it once all the same.
"""

from collections import OrderedDict
from dataclasses import dataclass, field
from hashlib import blake2b

from cnctwin.memory.store.influx.sample_row import SeriesKey
from cnctwin.memory.store.influx.spool import Spool

AGE_MS = 15 * 60_000
NUMBERED_AGE_MS = 7 * 86_400_000
NUMBERED_MAX = 1000
"""Different samples of one signal in one millisecond: more have no stamp."""
DIGEST_BYTES = 8
_REMEMBERED = 32
_SERIES_MAX = 200_000


def digest(told: str) -> bytes:
    """Return what a sample says, in eight bytes."""
    return blake2b(told.encode(), digest_size=DIGEST_BYTES).digest()


@dataclass(slots=True)
class _Recent:
    """The last milliseconds of a signal; `newest` is the greatest one that was ever told, `is_stale` what it said."""

    number: int
    newest: int
    is_stale: bool
    told: "OrderedDict[int, bytes]" = field(default_factory=OrderedDict)


class Stamps:
    """The memory of one ring; one thread. After a failed commit call `forget`: what it holds is then read from the file again."""

    def __init__(self, spool: Spool) -> None:
        self._spool = spool
        self._recent: dict[SeriesKey, _Recent] = {}
        self.changed: dict[tuple[int, int], tuple[bytes, bool]] = {}

    def number(self, key: SeriesKey, t_ms: int, told: bytes, *, is_stale: bool, is_live: bool) -> int | None:
        """The how-manieth sample of its millisecond this is; None = it is known. ValueError past NUMBERED_MAX.

        A live one that differs from the last of the same millisecond is new (A, B, A are three); what is told again, by a birth
        or as history, is compared with all of them.
        """
        recent = self._recent.get(key) or self._load(key)
        known = recent.told.get(t_ms)
        if known is None:
            known = b"" if t_ms > recent.newest else self._stored(recent.number, t_ms)
        places = range(0, len(known), DIGEST_BYTES)
        is_next = is_live and t_ms == recent.newest and not known.endswith(told)
        if not is_next and any(known[i : i + DIGEST_BYTES] == told for i in places):
            return None
        if len(places) >= NUMBERED_MAX:
            raise ValueError(f"more than {NUMBERED_MAX} different values in one millisecond")
        recent.told[t_ms] = known + told
        if len(recent.told) > _REMEMBERED:
            recent.told.popitem(last=False)
        if t_ms >= recent.newest:
            recent.newest, recent.is_stale = t_ms, is_stale
        self.changed[recent.number, t_ms] = (known + told, is_stale)
        return len(places)

    def stale_since(self, key: SeriesKey) -> int | None:
        """When the signal's last sample was told, where that was a stale one."""
        recent = self._recent.get(key) or self._load(key)
        return recent.newest if recent.is_stale else None

    def take_changed(self) -> list[tuple[int, int, bytes, bool]]:
        """Return what is to be committed."""
        taken = [(*place, *told) for place, told in self.changed.items()]
        self.changed.clear()
        if len(self._recent) > _SERIES_MAX:
            self._recent.clear()
        return taken

    def forget(self) -> None:
        """Drop what is in memory."""
        self._recent.clear()
        self.changed.clear()

    def prune(self) -> None:
        """Forget what is old; AGE_MS is counted from the newest sample of each signal."""
        for (number,) in self._spool.ask("SELECT id FROM series"):
            newest = self._spool.ask("SELECT max(ms) FROM stamps WHERE series = ?", (number,))[0][0]
            if newest is None:
                continue
            forget = "DELETE FROM stamps WHERE series = ? AND ms < ? AND length(told) <= ?"
            self._spool.write(forget, (number, newest - AGE_MS, DIGEST_BYTES))
            self._spool.write("DELETE FROM stamps WHERE series = ? AND ms < ?", (number, newest - NUMBERED_AGE_MS))

    def _stored(self, number: int, t_ms: int) -> bytes:
        if (number, t_ms) in self.changed:
            return self.changed[number, t_ms][0]
        found = self._spool.ask("SELECT told FROM stamps WHERE series = ? AND ms = ?", (number, t_ms))
        return bytes(found[0][0]) if found else b""

    def _load(self, key: SeriesKey) -> _Recent:
        asked = "SELECT id FROM series WHERE machine = ? AND node = ? AND signal = ?"
        found = self._spool.ask(asked, key)
        if not found:
            self._spool.write("INSERT INTO series(machine, node, signal) VALUES (?, ?, ?)", key)
            found = self._spool.ask(asked, key)
        number = int(found[0][0])
        last = self._spool.ask("SELECT ms, is_stale FROM stamps WHERE series = ? ORDER BY ms DESC LIMIT 1", (number,))
        newest, is_stale = last[0] if last else (-(2**62), False)
        recent = self._recent[key] = _Recent(number, int(newest), bool(is_stale))
        return recent
