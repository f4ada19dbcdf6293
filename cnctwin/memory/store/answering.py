"""One answer from both tiers: the hot samples and the list of sealed files are taken in one transaction, the files read after it.

A file that a sweep or a rewriting has removed meanwhile is no loss: the question is asked again, and finds what took its place.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from cnctwin.memory.store import hot, message_log
from cnctwin.memory.store.contract import Column, Message, Query, StoreError
from cnctwin.memory.store.database import Readers
from cnctwin.memory.store.extra import MISSING, extra_is_there
from cnctwin.memory.store.sealed.manifest import Checked, File, State, files
from cnctwin.memory.store.series_table import StoredClass
from cnctwin.memory.store.windows import StoredSample, Windows, raw_column

if TYPE_CHECKING:
    from cnctwin.memory.store.sealed.answers import SealedAnswers

ATTEMPTS_MAX = 5
MINUTE_MS = 60_000
_log = logging.getLogger(__name__)
_T = TypeVar("_T")


class Answering:
    """Answers questions, from any thread."""

    def __init__(self, folder: Path, readers: Readers) -> None:
        self._folder, self._readers = folder, readers
        self.checked = Checked(folder)
        self._lock = threading.Lock()
        self._answers: SealedAnswers | None = None

    def close(self) -> None:
        """Give memory back."""
        with self._lock:
            if self._answers is not None:
                self._answers.close()

    def query(self, query: Query) -> list[Column]:
        """A column for each signal asked for."""
        return self._again(lambda: self._query(query))

    def _query(self, query: Query) -> list[Column]:
        span_us = (query.from_ms * 1000, query.to_ms * 1000)
        with self._readers.snapshot() as db:
            wanted = hot.asked(db, query.machine, query.signals)
            every = {s.sid: s for asked in wanted.values() for s in asked.series}
            found = db.execute("SELECT id FROM machines WHERE name = ?", (query.machine,)).fetchone()
            there = [] if found is None else files(db, found[0], query.from_ms, query.to_ms)
            chunks = hot.chunk_samples(db, -1 if found is None else found[0], *span_us)
            if query.every_ms is None:
                told: dict[str, list[StoredSample]] = {
                    name: [one for s in asked.series for one in hot.told(db, chunks, s, *span_us)]
                    for name, asked in wanted.items()
                }
                windows: dict[str, Windows] = {}
            else:
                windows = {name: Windows(query.every_ms) for name in wanted}
                for name, asked in wanted.items():
                    for s in asked.series:
                        hot.fill(db, chunks, windows[name], s, span_us)
        classes = {s.stored_class for s in every.values()}
        sealed = self._sound([f for f in there if f.state == State.SEALED and f.stored_class in classes])
        of = {s.sid: name for name, asked in wanted.items() for s in asked.series}
        if query.every_ms is None:
            if sealed:
                for sid, some in self._sealed().told(sealed, every.values(), query.from_ms, query.to_ms).items():
                    told[of[sid]] += some
            return [raw_column(name, wanted[name].unit, list(told[name])) for name in query.signals]
        by_sid = {sid: windows[name] for sid, name in of.items()}
        if sealed:
            self._sealed().fill(sealed, by_sid, list(every.values()), query.from_ms, query.to_ms)
        if query.every_ms % MINUTE_MS == 0:
            self._rolled(by_sid, every, there, query)
        return [windows[name].column(name, wanted[name].unit) for name in query.signals]

    def _rolled(self, by_sid: Mapping[int, Windows], every: Mapping[int, hot.SeriesOf], there: list[File], query: Query) -> None:
        if not any(f.state != State.SEALED for f in there) or not any(f.stored_class == StoredClass.ROLLUP for f in there):
            return
        self._sealed()
        from cnctwin.memory.store.sealed.rollup import Span, fill_gone  # noqa: PLC0415

        fill_gone(self.checked, by_sid, every.values(), there, Span(query.from_ms, query.to_ms))

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """Yield the messages of a machine, in order."""
        if extra_is_there():
            from cnctwin.memory.store.sealed.messages import SealedMessages  # noqa: PLC0415

            sealed: message_log.SealedPage = SealedMessages(self.checked)
        else:
            sealed = self._none_sealed
        return message_log.messages(self._readers.snapshot, sealed, (machine, from_ms, to_ms), self._again)

    def _none_sealed(self, db: object, machine: str, first: int, until: int) -> message_log.Sealed:
        with self._readers.snapshot() as other:
            if other.execute("SELECT 1 FROM files LIMIT 1").fetchone():
                raise StoreError(f"{self._folder}: {MISSING}: sealed hours of this store cannot be read without them")
        return message_log.Sealed({}, {})

    def _again(self, ask: Callable[[], _T]) -> _T:
        for _ in range(ATTEMPTS_MAX):
            try:
                return ask()
            except FileNotFoundError as error:
                missing = error
        raise StoreError(f"{self._folder}: {missing} is gone; the writer finds that when it starts")

    def _sound(self, wanted: list[File]) -> list[File]:
        known = len(self.checked.damaged)
        sound = self.checked.sound(wanted)
        for trouble in list(self.checked.damaged.values())[known:]:
            _log.warning("%s; the answer is without it", trouble)
        return sound

    def _sealed(self) -> "SealedAnswers":
        with self._lock:
            if self._answers is None:
                if not extra_is_there():
                    raise StoreError(f"{self._folder}: {MISSING}: sealed hours of this store cannot be read without them")
                from cnctwin.memory.store.sealed.answers import SealedAnswers  # noqa: PLC0415

                self._answers = SealedAnswers(self._folder)
            return self._answers
