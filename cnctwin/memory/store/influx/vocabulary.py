"""Texts that a server without texts keeps as labels: those of signals that say few different short ones.

Each text is a series of its own there, so block texts (`nc_block`) would make millions of them. A signal that says more than
TEXTS_MAX different texts, or a longer one than TEXT_CHARACTERS_MAX, is not kept from then on, and that is counted and said.
"""

from collections import defaultdict

from cnctwin.memory.store.influx.spool import Spool

TEXTS_MAX = 500
TEXT_CHARACTERS_MAX = 120
NEVER = frozenset({"nc_block"})


class UnkeptTextError(ValueError):
    """A text that this server does not keep."""


class Vocabulary:
    """The texts of each signal so far, over restarts."""

    def __init__(self, spool: Spool) -> None:
        self._spool = spool
        self._texts: dict[str, set[str]] = defaultdict(set)
        for signal, text in spool.ask("SELECT signal, text FROM texts"):
            self._texts[signal].add(text)

    def admit(self, signal: str, text: str) -> None:
        """UnkeptTextError where the text is not kept."""
        known = self._texts[signal]
        if signal in NEVER or len(known) > TEXTS_MAX:
            raise UnkeptTextError(f"this server keeps no texts, and {signal} says too many different ones to be labels")
        if text in known:
            return
        if len(text) > TEXT_CHARACTERS_MAX:
            raise UnkeptTextError(f"this server keeps no texts, and one of {len(text)} characters is too long for a label")
        known.add(text)
        self._spool.write("INSERT OR IGNORE INTO texts VALUES (?, ?)", (signal, text))
