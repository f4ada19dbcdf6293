"""The thread between the ring and the server: takes batches, hands them over, and keeps at it.

A write that is not taken is tried again after 0.5 s, 1 s, 2 s … 60 s, each cut by chance to between a half and the whole, and not
before the server's Retry-After; how often is bounded by the ring's age and bytes, not here. A batch that the server refuses for
what it holds is halved until the lines at fault stand alone: the rest goes through, they are counted, and said once.
"""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from threading import Event, Lock, Thread

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.server import RefusedError, Server, ServerAwayError, TooLargeError
from cnctwin.memory.store.influx.spool import Spool, Waiting

IDLE_S = 1.0
FAULTS_MAX = 8
"""Times that one batch may be answered with 500 before the next one is tried: where that passes, the batch is at fault."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Patience:
    """The retries of a server, and the samples that a request holds."""

    delay_s_min: float = 0.5
    delay_s_max: float = 60.0
    samples_at_once: int = 5_000


class Sender:
    """Drains one ring into one server. `trouble` is what is wrong now, '' = nothing; `refused` what was refused first."""

    def __init__(
        self, spool: Spool, server: Server, *, clock: Callable[[], float], chance: Random, patience: Patience | None = None
    ) -> None:
        self._spool, self._server, self._clock, self._chance = spool, server, clock, chance
        self._patience = patience or Patience()
        self._stop, self._work = Event(), Event()
        self._lock = Lock()
        self._cursor = 0
        self._unsettled: deque[tuple[float, int, int, int]] = deque()  # sent at, up to which number, samples, refused of them
        self._incarnation: str | None = None
        self._checked_s, self._must_check = 0.0, True
        self._attempts, self._faults = 0, 0
        self.trouble, self.refused = "", ""
        self._thread = Thread(target=self._run, name="influx-sender", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def wake(self) -> None:
        """There is something new in the ring."""
        self._work.set()

    def drain(self, timeout_s: float) -> bool:
        """Wait until the server has all that is in the ring."""
        end_s = self._clock() + timeout_s
        while self.waiting and self._clock() < end_s and not self._stop.wait(0.01):
            self._work.set()
        return not self.waiting

    def stop(self, timeout_s: float = 15.0) -> None:
        """End; what is left stays in the ring."""
        self._stop.set()
        self._work.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    @property
    def waiting(self) -> int:
        """Samples that the server has not acknowledged."""
        with self._lock:
            return max(int(self._spool.held) - sum(samples for _, _, samples, _ in self._unsettled), 0)

    @property
    def passed(self) -> int:
        """All batches up to this number are with the server."""
        return self._cursor

    def _run(self) -> None:
        while not self._stop.is_set():
            self._work.clear()
            try:
                delay_s = self._step()
            except ServerAwayError as away:
                delay_s = self._later(away)
            except StoreError as error:  # the ring itself: its disk may come back
                self.trouble = str(error)
                delay_s = self._patience.delay_s_max / 4
            except Exception as error:  # a defect must not end the thread unseen, nor turn it into a busy one
                _log.exception("the sender met something that it does not know")
                self.trouble, delay_s = f"{type(error).__name__}: {error}", self._patience.delay_s_max
            if delay_s is None:
                self._work.wait(IDLE_S)
            elif delay_s > 0:
                self._stop.wait(delay_s)

    def _later(self, away: ServerAwayError) -> float:
        if self.trouble != str(away):
            _log.warning("%s; %d samples wait in the ring", away, self._spool.held)
        self.trouble = str(away)
        self._faults = self._faults + 1 if away.is_fault else 0
        self._must_check = True
        grown_s = self._patience.delay_s_min * 2.0 ** min(self._attempts, 30)
        delay_s = min(grown_s, self._patience.delay_s_max) * self._chance.uniform(0.5, 1.0)
        self._attempts += 1
        return max(delay_s, away.retry_after_s or 0.0)

    def _step(self) -> float | None:
        """Send what is next; the delay until the next step, None where nothing is left."""
        self._settle()
        found = self._spool.after(self._cursor, self._patience.samples_at_once)
        if not found:
            return None
        upto, refused = found[-1].sequence, 0
        if self._faults >= FAULTS_MAX:
            refused = self._pass_the_poisoned(found)
        else:
            by_bucket: dict[str, list[bytes]] = {}
            for batch in found:
                by_bucket.setdefault(batch.bucket, []).append(batch.lines)
            for bucket, bodies in by_bucket.items():
                refused += self._hand_over(bucket, b"".join(bodies))
        if self.trouble:
            _log.warning("the store's server takes samples again")
        self._attempts, self._faults, self.trouble = 0, 0, ""
        self._acknowledged(upto, sum(batch.samples for batch in found), refused)
        return 0.0

    def _acknowledged(self, upto: int, samples: int, refused: int) -> None:
        if self._server.settle_s <= 0:
            self._spool.done(upto, refused)
            self._cursor = upto
            return
        with self._lock:
            self._unsettled.append((self._clock(), upto, samples, refused))
            self._cursor = upto

    def _settle(self) -> None:
        """Let go of what the server has had for long enough; all of it is sent again where the server was started again."""
        asked_s = self._clock()
        if self._server.settle_s <= 0 or not (self._must_check or asked_s - self._checked_s >= self._server.settle_s):
            return
        incarnation = self._server.incarnation()
        known, self._incarnation = self._incarnation, incarnation
        self._checked_s, self._must_check = asked_s, False
        if known is not None and known != incarnation and self._unsettled:
            with self._lock:
                self._unsettled.clear()
                self._cursor = 0
            _log.warning("the store's server was started again: what it had not settled is sent again")
            return
        while self._unsettled and asked_s - self._unsettled[0][0] >= self._server.settle_s:
            _, upto, _, refused = self._unsettled[0]
            self._spool.done(upto, refused)
            with self._lock:
                self._unsettled.popleft()

    def _hand_over(self, bucket: str, lines: bytes, *, judge_faults: bool = False) -> int:
        """Have lines taken; how many the server refuses, of which the first is said."""
        try:
            self._server.write(bucket, lines)
        except RefusedError as refusal:
            if refusal.dropped is not None:
                self._say(refusal, lines)
                return refusal.dropped
            return self._find_culprits(bucket, lines, refusal, judge_faults=judge_faults)
        return 0

    def _find_culprits(self, bucket: str, lines: bytes, refusal: RefusedError, *, judge_faults: bool, passed: int = 0) -> int:
        """Halve until the lines at fault stand alone. Where a refusal is not sure and nothing passes, no line is at fault."""
        refused = 0
        first: tuple[RefusedError, bytes] | None = None
        pending = deque([(lines, refusal)])
        while pending:
            part, why = pending.popleft()
            split = part.splitlines(keepends=True)
            if len(split) == 1:
                first = first or (why, part)
                refused += 1
                continue
            middle = len(split) // 2
            for half in (b"".join(split[:middle]), b"".join(split[middle:])):
                if self._stop.is_set():
                    raise ServerAwayError("this process ends")
                try:
                    self._server.write(bucket, half)
                    passed += 1
                except RefusedError as again:
                    pending.append((half, again))
                except ServerAwayError as away:
                    if not (judge_faults and away.is_fault):
                        raise
                    pending.append((half, RefusedError(str(away), is_sure=False)))
        if first is not None and not passed and (not first[0].is_sure or isinstance(first[0], TooLargeError)):
            raise ServerAwayError(str(first[0]))
        if first is not None:
            self._say(*first)
        return refused

    def _pass_the_poisoned(self, found: list[Waiting]) -> int:
        """One batch is answered with 500 again and again. Where a later one passes, its lines are judged one by one."""
        self._faults = 0
        later = self._spool.after(found[-1].sequence, 1)
        if not later:
            raise ServerAwayError(self.trouble, is_fault=True)
        self._server.write(later[0].bucket, later[0].lines)
        refused = 0
        for batch in found:
            try:
                refused += self._hand_over(batch.bucket, batch.lines, judge_faults=True)
            except ServerAwayError as away:
                if not away.is_fault:
                    raise
                refusal = RefusedError(str(away), is_sure=False)
                refused += self._find_culprits(batch.bucket, batch.lines, refusal, judge_faults=True, passed=1)
        return refused

    def _say(self, refusal: RefusedError, line: bytes) -> None:
        if not self.refused:
            sample = line[:200].decode(errors="replace").strip()
            self.refused = f"{refusal}; the first line refused: {sample}"
            _log.warning("%s", self.refused)
