"""Messages that are alike become chunks; whatever is unusual in a message is left to the way reading by reading (`intake`).

Usual is a DATA message of numbers, truth values and texts, each newer than all that is known of its signal. Nearly all are, and
they cost a few comparisons of tuples: names, units, qualities and reasons are those of the message before.
"""

import sqlite3
from collections.abc import Sequence
from itertools import chain
from typing import Any

from cnctwin.memory.store.chunk import CHUNK_MS, KINDS, LETTERS, Alike, packed
from cnctwin.memory.store.database import insert
from cnctwin.memory.store.series_table import HISTORY_BIT, RANK, REASON_SHIFT, SeriesTable, Signal, Source, class_of
from cnctwin.memory.store.value_form import INT_MAX
from sparkplug.host_session import HostEvent

LAYOUTS_MAX = 256
"""The most layouts of one source: reasons that carry figures make new ones all the time."""
COLUMNS_MAX = 1_000
STAMP_MS_MAX = 253_402_300_799_999
"""The end of the year 9999; a stamp beyond it, or before 1970, is none."""
AHEAD_MS_MAX = 10 * 366 * 86_400_000
"""A control's clock may be years ahead, not centuries."""
FLAG_MAX = 2**32 - 1
_CHUNK = "INSERT INTO chunks VALUES"


class Layout:
    """Messages that are alike, and those of them that wait to be a chunk. `letters` empty: they are none for chunks."""

    __slots__ = (
        "flags", "is_begun", "is_single", "key", "letters", "messages", "minute", "node_machine", "rows", "sids", "signals",
        "source", "stamps", "stored_class", "text_places", "texts", "whole_places",
    )  # fmt: skip

    def __init__(self, source: Source, key: tuple[Any, ...]) -> None:
        self.source, self.key = source, key
        self.letters = ""
        self.is_single: bool = key[-1]
        self.is_begun = False
        self.signals: list[Signal] = []
        self.sids: list[int] = []
        self.flags: list[int] = []
        self.stored_class = 0
        self.whole_places: list[int] = []
        self.text_places: list[int] = []
        self.minute = -1
        self.texts: dict[str, int] = {}
        self.messages: list[tuple[int, int, int]] = []
        self.stamps: list[Any] = []
        self.rows: list[Any] = []

    def settle(self, values: tuple[Any, ...], stamps: tuple[int, ...]) -> None:
        """Tell the signals of the last message."""
        for signal, sid, flag, value, stamp_ms in zip(self.signals, self.sids, self.flags, values, stamps, strict=True):
            if stamp_ms > signal.last_ms:
                signal.last_ms, signal.last_us = stamp_ms, stamp_ms * 1000
                signal.last, signal.last_sid, signal.last_flag = value, sid, flag

    def begin(self, stamps: tuple[int, ...]) -> None:
        """Tell the signals of the first message ever; a later one is newer."""
        self.is_begun = True
        for signal, stamp_ms in zip(self.signals, stamps, strict=True):
            if signal.first_us < 0:
                signal.first_us = stamp_ms * 1000


def stamp_ms_max(received_ms: int) -> int:
    """Return the latest stamp that is kept of what was received then: a later one would be its signal's newest for ever."""
    return min(received_ms + AHEAD_MS_MAX, STAMP_MS_MAX)


class ChunkWriter:
    """The chunks of one batch, within one transaction. stored: samples in them; changed: signals with new last samples."""

    def __init__(self, db: sqlite3.Connection, table: SeriesTable) -> None:
        self._db, self._table = db, table
        self._chunks: list[tuple[Any, ...]] = []
        self._open: dict[Layout, None] = {}
        self._unsettled: dict[Source, None] = {}
        self.changed: dict[Signal, None] = {}
        self.stored = 0

    def take(self, source: Source, number: int, received_ms: int, event: HostEvent) -> bool:
        """Take a DATA message with readings, as the one with this number; False where it is not for a chunk."""
        names, values, stamps, qualities, units, reasons, history = zip(*event.readings, strict=True)
        oldest_ms, newest_ms = (event.oldest_ms, event.newest_ms) if event.names else (min(stamps), max(stamps))
        key = (names, tuple(map(type, values)), qualities, units, reasons, history, oldest_ms == newest_ms)
        layout = source.last_layout
        if layout is None or key != layout.key:
            layout = source.last_layout = source.layouts.get(key) or self._layout(source, key)
        minute = oldest_ms // CHUNK_MS
        if not layout.letters or newest_ms // CHUNK_MS != minute or not 0 <= oldest_ms <= newest_ms <= stamp_ms_max(received_ms):
            return False
        if oldest_ms <= source.newest_ms:
            self.settle(source)
            if any(stamp_ms <= signal.last_ms for signal, stamp_ms in zip(layout.signals, stamps, strict=True)):
                return False
        row: Sequence[Any] = values
        if layout.whole_places and any(not -INT_MAX <= values[place] <= INT_MAX for place in layout.whole_places):
            return False
        if layout.minute != minute or not layout.rows:
            self._close(layout)
            layout.minute = minute
            self._open[layout] = None
        if layout.text_places:
            told = self._with_places(layout, values)
            if told is None:
                return False
            row = told
        layout.messages.append((number, received_ms, event.timestamp_ms))
        layout.stamps.append(oldest_ms if layout.is_single else stamps)
        layout.rows.append(row)
        source.newest_ms = max(source.newest_ms, newest_ms)
        if not layout.is_begun:
            layout.begin(stamps)
        source.unsettled[layout] = values, stamps
        self._unsettled[source] = None
        self.stored += len(values)
        return True

    def _layout(self, source: Source, key: tuple[Any, ...]) -> Layout:
        if len(source.layouts) >= LAYOUTS_MAX:
            self.settle(source)
            for layout in source.layouts.values():
                self._close(layout)
            source.layouts.clear()
        made = source.layouts[key] = Layout(source, key)
        names, types, qualities, units, reasons, history, _ = key
        letters = [LETTERS.get(of, "") for of in types]
        if not all(letters) or len(set(names)) < len(names) or len(names) > COLUMNS_MAX:
            return made
        table = self._table
        classes = {class_of(name, KINDS[letter]) for name, letter in zip(names, letters, strict=True)}
        try:
            made.signals = [source.signals.get(name) or table.signal(source, name) for name in names]
            told = zip(made.signals, units, letters, strict=True)
            made.sids = [table.series(signal, unit, KINDS[letter]) for signal, unit, letter in told]
            numbers = [0 if reason is None else table.reasons.get(reason) or table.reason(reason) for reason in reasons]
        except UnicodeEncodeError:
            return made
        marks = zip(qualities, history, numbers, strict=True)
        made.flags = [RANK[quality] + HISTORY_BIT * old + (number << REASON_SHIFT) for quality, old, number in marks]
        if len(classes) == 1 and max(*made.flags, *made.sids) <= FLAG_MAX:
            made.stored_class = int(classes.pop())
            made.whole_places = [place for place, letter in enumerate(letters) if letter == "q"]
            made.text_places = [place for place, letter in enumerate(letters) if letter == "I"]
            made.letters = "".join(letters)
        return made

    def _with_places(self, layout: Layout, values: tuple[Any, ...]) -> list[Any] | None:
        """The values with texts as their places among the chunk's; None where one is no Unicode."""
        row, texts = list(values), layout.texts
        for place in layout.text_places:
            text = row[place]
            number = texts.get(text)
            if number is None:
                try:
                    text.encode()
                except UnicodeEncodeError:
                    return None
                number = texts[text] = len(texts)
            row[place] = number
        return row

    def settle(self, source: Source) -> None:
        """Tell the signals of a source what their last samples are."""
        for layout, (values, stamps) in source.unsettled.items():
            layout.settle(values, stamps)
            self.changed.update(dict.fromkeys(layout.signals))
        source.unsettled.clear()

    def write(self, source: Source, minute: int) -> bool:
        """Write what waits of a source's minute, so that it can be asked for; True if that was anything."""
        for layout in [layout for layout in source.layouts.values() if layout.messages and layout.minute == minute]:
            self._close(layout)
        return self._insert()

    def write_all(self) -> None:
        """Write all that waits, and settle."""
        for source in self._unsettled:
            self.settle(source)
        for layout in list(self._open):
            self._close(layout)
        self._insert()

    def _insert(self) -> bool:
        if not self._chunks:
            return False
        insert(self._db, _CHUNK, self._chunks)
        self._chunks.clear()
        return True

    def _close(self, layout: Layout) -> None:
        """Make a chunk of the messages that wait."""
        self._open.pop(layout, None)
        messages = layout.messages
        if not messages:
            layout.texts.clear()
            return
        first, last = messages[0][0], messages[-1][0]
        received = [message[1] for message in messages]
        stamps = layout.stamps if layout.is_single else chain.from_iterable(zip(*layout.stamps, strict=True))
        told = [(number - first, received_ms, stamp_ms) for number, received_ms, stamp_ms in messages]
        alike = Alike(layout.letters, layout.sids, layout.flags, is_single=layout.is_single)
        body = packed(alike, told, stamps, layout.rows, layout.texts)
        samples = len(messages) * len(layout.sids)
        source = layout.source
        about = (source.machine, layout.minute, layout.stored_class, source.node)
        self._chunks.append((first, *about, last, min(received), max(received), samples, body))
        layout.messages, layout.stamps, layout.rows = [], [], []
        layout.texts.clear()
