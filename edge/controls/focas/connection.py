"""The connection to a control: one look in each interval, gathered call by call into a sweep, with no thought of what it means.

A handle that is lost is made again, after a while that grows, with jitter. The looks that could not be made meanwhile are one
hole, which the next sweep states. A control that answers slowly is looked at less often; only what is away for `HOLE_INTERVALS`
intervals is a hole.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import uuid4

from edge.controls.focas.address import address_of
from edge.controls.focas.backend import backend_of
from edge.controls.focas.calls import Answer, Call, FocasBackend, FocasValue, Identity, Request
from edge.controls.focas.config import Config, Group
from edge.controls.focas.plan import Refusals, Subject, quick, rare, slow, unread, without_offset
from edge.controls.focas.policy import OK, PROTOCOL, Policy, policy_of, told
from edge.sample import ClockReading
from edge.sweep import Fact, Hole, Sweep

BACKOFF_S = 0.25
BACKOFF_S_MAX = 30.0
HOLE_INTERVALS = 5
CLOCK_RESOLUTION_MS = 1000
RARE_AT_ONCE = 4  # requests that a look takes on beside its own, so that no look is late for what is rare


class FocasConnection:
    """Sweeps of one control, in order, reconnecting by itself."""

    def __init__(
        self,
        config: Config,
        *,
        backend: FocasBackend | None = None,
        clock: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
        wait: Callable[[float], object] | None = None,
        chance: random.Random | None = None,
    ) -> None:
        self._config = config.source
        self._backend = backend_of(config.source) if backend is None else backend
        self._clock, self._wall_s = clock, wall_s
        self._chance = chance or random.Random()  # noqa: S311  jitter, not a secret
        self._closed = threading.Event()
        self._wait = wait or self._closed.wait
        self._life, self._number = uuid4().hex, 0
        self._identity: Identity | None = None  # None: no handle
        self._is_new = True
        self._refusals = Refusals()
        self._failures, self._why_lost = 0, ""
        self._heard_s, self._seen_ms = clock(), 0
        self._slow_s = self._clock_s = float("-inf")
        self._chosen = tuple(address_of(one).request for one in config.chosen)
        self._rare_s, self._rare = float("-inf"), tuple[Request, ...]()
        self._subject, self._facts_last = Subject(), 0
        self.reconnects = 0
        self.last_error = ""

    def follow(self, cursor: Any) -> None:
        """Nothing: what is asked for next does not depend on what was made of the last answer."""

    def silent_s(self) -> float:
        """Seconds since the control answered a look."""
        return self._clock() - self._heard_s

    def close(self) -> None:
        """End `frames`; a call that waits for the control is woken."""
        self._closed.set()
        self._backend.close()

    def frames(self) -> Iterator[bytes]:
        """Sweeps until `close`."""
        try:
            while not self._closed.is_set():
                if self._identity is None and not self._open():
                    continue
                began_s = self._clock()
                sweep = self._look()
                if sweep is None:
                    continue
                self._heard_s, self._failures = self._clock(), 0
                yield sweep.encode()
                self._pause(began_s + self._config.interval_ms / 1000 - self._clock())
        finally:
            self._backend.close()

    def once(self) -> bytes | None:
        """One sweep and no more; None where it failed, and then `last_error` says why."""
        try:
            sweep = self._look() if self._open() else None
            return None if sweep is None else sweep.encode()
        finally:
            self._backend.close()

    def _pause(self, seconds: float) -> None:
        if seconds > 0 and not self._closed.is_set():
            self._wait(seconds)

    def _open(self) -> bool:
        opened = self._backend.open()
        if opened.code != OK:
            self._lost(opened.code, opened.why)
            return False
        self._identity, self._is_new, self._refusals = opened.identity, True, Refusals()
        self._slow_s = self._clock_s = self._rare_s = float("-inf")
        self._rare, self._subject = (), Subject()
        return True

    def _lost(self, code: int, why: str = "") -> None:
        """The handle is gone. Wait, longer each time, so that a plant's edges do not come back in step."""
        self._backend.close()
        self._identity = None
        if self._closed.is_set():
            return
        self.reconnects += 1
        self._failures += 1
        self._why_lost = told(code)
        self.last_error = f"focas://{self._config.host}:{self._config.port}: {told(code)}{f': {why}' if why else ''}"
        longest_s = min(BACKOFF_S_MAX, BACKOFF_S * 2.0 ** min(self._failures - 1, 16))
        self._pause(longest_s * self._chance.uniform(0.5, 1.0))

    def _look(self) -> Sweep | None:
        """One look; None where the handle was lost over it."""
        assert self._identity is not None
        axes, now_s = self._identity.axes, self._clock()
        is_slow = self._is_new or self._is_due(self._slow_s, self._config.slow_interval_ms / 1000)
        wanted = quick(self._config) + (slow(self._config, self._chosen) if is_slow else ()) + self._rare[:RARE_AT_ONCE]
        requests = self._refusals.asked(dict.fromkeys(wanted), axes)
        self._rare = self._rare[RARE_AT_ONCE:]
        began_ms = self._wall_ms()
        answers = self._backend.ask(requests)
        t_ms = (began_ms + self._wall_ms()) // 2
        found = self._judged(requests, answers)
        told_none = () if found is None else self._turned_to(found)
        if found is not None and self._is_new:  # the first look finds out all that there is
            requests, self._rare = self._refusals.asked(self._rare, axes), ()
            more = self._judged(requests, self._backend.ask(requests)) if requests else []
            found = None if more is None else found + more
        if found is None:
            return None
        is_due = self._is_new or self._is_due(self._clock_s, self._config.clock_interval_s)
        clock = self._control_clock() if is_due else None
        if self._identity is None:
            return None
        first, last = (_identified(self._identity), unread(self._config)) if self._is_new else ((), ())
        facts = (*first, *map(_fact, found), *told_none, *last)
        sweep = Sweep(self._life, self._number, t_ms, facts, self._hole(t_ms, len(facts)), self._config.interval_ms, clock, True)
        if self._is_new:
            self._seen_ms = self._wall_ms()  # it took longer, for all that it asked
        self._number, self._is_new = self._number + 1, False
        self._slow_s = now_s if is_slow else self._slow_s
        return sweep

    def _judged(self, requests: Sequence[Request], answers: Sequence[Answer]) -> list[FocasValue] | None:
        """The facts of these answers; None where the handle was lost."""
        assert self._identity is not None
        lost = next((answer.code for answer in answers if policy_of(answer.code) is Policy.RECONNECT), None)
        if lost is not None or len(answers) != len(requests):
            self._lost(PROTOCOL if lost is None else lost, _first(requests, answers))
            return None
        axes = self._identity.axes
        found = [one for pair in zip(requests, answers, strict=True) for one in self._refusals.judge(*pair, axes)]
        self._say_refused(requests, answers)
        return found

    def _turned_to(self, found: Sequence[FocasValue]) -> tuple[Fact, ...]:
        """Plan what is rare, where it is due or the tool or program is another now; return what is known without asking."""
        assert self._identity is not None
        before, subject = self._subject, Subject.after(self._subject, found)
        is_lathe = self._identity.mt_type.strip().startswith("T")
        if self._is_due(self._rare_s, self._config.rare_interval_s):
            self._rare_s, self._rare = self._clock(), rare(self._config, subject, is_lathe)
        elif subject != before:
            wanted, asked = rare(self._config, subject, is_lathe), rare(self._config, before, is_lathe)
            of_the_tool = {Request(Call.LIFE)} if subject.tool != before.tool else set()
            self._rare = tuple(one for one in wanted if one in self._rare or one not in asked or one in of_the_tool)
        else:
            return ()
        self._subject = subject
        return without_offset(self._config, subject, is_lathe)

    def _is_due(self, last_s: float, interval_s: float) -> bool:
        """Return whether this look is the nearest to the end of an interval."""
        return self._clock() - last_s >= interval_s - self._config.interval_ms / 2000

    def _hole(self, t_ms: int, facts: int) -> tuple[Hole, ...]:
        """The looks that were not made since the last one."""
        seen_ms, self._seen_ms = self._seen_ms, t_ms
        per_look, self._facts_last = max(facts, self._facts_last), facts
        why, self._why_lost = self._why_lost, ""
        away_ms = t_ms - seen_ms
        if not seen_ms or (not why and away_ms < HOLE_INTERVALS * self._config.interval_ms):
            return ()
        looks = max(1, round(away_ms / self._config.interval_ms) - 1)
        return (Hole(why or "the control answered slowly", min(seen_ms, t_ms), t_ms, looks * per_look),)

    def _control_clock(self) -> ClockReading | None:
        """The control's date and time, without zone and fractions. A reading around midnight may be torn, and is left out."""
        # Not at always the same phase of the control's seconds: many looks then tell more than one.
        self._clock_s = self._clock() - self._chance.uniform(0.0, 1.0)
        if Group.CLOCK not in self._config.groups or self._identity is None:
            return None
        request = Request(Call.CLOCK)
        if not self._refusals.asked([request], ()):
            return None
        began_ms = self._wall_ms()
        (answer,) = self._backend.ask([request])
        ended_ms = self._wall_ms()
        if policy_of(answer.code) is Policy.RECONNECT:
            self._lost(answer.code, request.name)
            return None
        found = self._refusals.judge(request, answer, ())
        control_ms = calendar_ms([one.value for one in found if isinstance(one.value, int)], self._config.utc_offset_min)
        if control_ms is None:
            return None
        middle_ms = (began_ms + ended_ms) // 2
        return ClockReading(control_ms, middle_ms, max(0, ended_ms - began_ms), CLOCK_RESOLUTION_MS, stamps_samples=False)

    def _say_refused(self, requests: Sequence[Request], answers: Sequence[Answer]) -> None:
        for request, answer in zip(requests, answers, strict=True):
            codes = [answer.code, *(one.code for one in answer.found)]
            code = next((code for code in codes if code != OK), OK)
            if code != OK:
                again = "" if policy_of(code) is Policy.GIVE_UP else ", asked again at the next look"
                self.last_error = f"{request.name}: {told(code)}{again}"

    def _wall_ms(self) -> int:
        return round(self._wall_s() * 1000)


def calendar_ms(words: Sequence[int], utc_offset_min: int) -> int | None:
    """Year to second of a calendar so many minutes ahead of UTC, as ms since 1970; None where it is no date, or about midnight.

    >>> calendar_ms([2026, 5, 14, 9, 30, 0], 540)
    1778718600000
    """
    if len(words) != 6 or list(words[3:5]) == [0, 0]:
        return None
    try:
        year, month, day, hour, minute, second = words
        shown = datetime(year, month, day, hour, minute, second, tzinfo=UTC) - timedelta(minutes=utc_offset_min)
        return max(0, round(shown.timestamp() * 1000))
    except (ValueError, OverflowError):
        return None


def _first(requests: Sequence[Request], answers: Sequence[Answer]) -> str:
    for request, answer in zip(requests, answers, strict=False):
        if policy_of(answer.code) is Policy.RECONNECT:
            return request.name
    return "answers are missing"


def _identified(identity: Identity) -> tuple[Fact, ...]:
    told_of = identity._asdict() | {"axes": " ".join(identity.axes)}
    return tuple(Fact(f"control.{name}", text) for name, text in told_of.items())


def _fact(one: FocasValue) -> Fact:
    return Fact(one.key, one.value, "" if one.code == OK else told(one.code))
