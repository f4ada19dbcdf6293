"""Records of parts by POST to an MES or a PLM, at least once each and in order, known again by their id.

The body is the record as it was published. `X-Cnctwin-Notification` holds its id, so that a receiver that gets it twice can tell;
`X-Cnctwin-Signature` is `sha256=` and the HMAC-SHA256 of the body, where a secret is shared. What was surely not taken, or may
not have been, is tried again with growing pauses, and holds up those that follow; what is refused (4xx) is not.
"""

import hashlib
import hmac
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cnctwin.memory.parts.journal import Journal
from cnctwin.memory.parts.record_log import Part, parts
from cnctwin.memory.store.contract import Store
from processors.alerts.courier.exchange import Request, exchanged, judged
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.courier.webhook import headers

SIGNATURE_HEADER = "X-Cnctwin-Signature"
LOOK_BACK_MS = 3_600_000
"""Parts that are stored later than newer ones (a clock that was set back, history of an edge) are found within it."""
PAUSE_S_MIN, PAUSE_S_MAX = 1.0, 300.0


@dataclass(frozen=True, slots=True)
class Receiver:
    """The receiver of records. Its secrets have been read."""

    url: str
    bearer: str | None = None
    secret: str | None = None
    timeout_s: float = 10.0
    give_up_after_s: float = 86_400.0


class Delivered(NamedTuple):
    """The outcome of a round; `waits_s`: None = all are settled, else when to try again, and why."""

    delivered: int
    refused: int
    given_up: int
    waits_s: float | None
    reason: str


class Delivery:
    """See the module. One receiver; `send` and the time are arguments, for the tests."""

    def __init__(
        self, store: Store, receiver: Receiver, journal: Journal, send: Callable[[Receiver, Part], Outcome] | None = None
    ) -> None:
        self._store, self._receiver, self._journal = store, receiver, journal
        self._send = send or sent
        self._tried: dict[str, tuple[float, int]] = {}  # by machine: since when the first of its parts is tried, and how often

    def round(self, machines: Sequence[str], now_ms: int) -> Delivered:
        """Deliver what is due of these machines."""
        since_ms = self._journal.since_ms or 0
        counts = {"delivered": 0, "refused": 0, "given up": 0}
        waits: list[tuple[float, str]] = []
        for machine in machines:
            from_ms = max(self._journal.until_ms.get(machine, 0) - LOOK_BACK_MS, since_ms)
            for part in parts(self._store, machine, from_ms, max(now_ms + LOOK_BACK_MS, from_ms + 1)):
                if part.id in self._journal.ids:
                    continue
                became, pause_s, reason = self._one(machine, part, now_ms / 1000)
                if became is None:
                    waits.append((pause_s, reason))
                    break
                counts[became] += 1
                self._tried.pop(machine, None)
                self._journal.settle(machine, part.id, part.ended_ms, became)
        wait = min(waits, default=None)
        return Delivered(
            counts["delivered"], counts["refused"], counts["given up"], None if wait is None else wait[0], wait[1] if wait else ""
        )

    def _one(self, machine: str, part: Part, now_s: float) -> tuple[str | None, float, str]:
        """Return the outcome for a part (None: it waits), the pause until the next try, and why."""
        outcome = self._send(self._receiver, part)
        if outcome.verdict is Verdict.DELIVERED:
            return "delivered", 0.0, ""
        if outcome.verdict is Verdict.REFUSED:
            return "refused", 0.0, outcome.reason
        since_s, tries = self._tried.get(machine, (now_s, 0))
        if now_s - since_s >= self._receiver.give_up_after_s:
            return "given up", 0.0, outcome.reason
        self._tried[machine] = since_s, tries + 1
        pause_s = min(PAUSE_S_MIN * 2.0 ** min(tries, 20), PAUSE_S_MAX)
        return None, max(pause_s, outcome.after_s or 0.0), outcome.reason


def sent(receiver: Receiver, part: Part) -> Outcome:
    """One try."""
    body = part.text.encode()
    own = headers(receiver.bearer, part.id) | {"Content-Type": "application/json"}
    if receiver.secret is not None:
        own[SIGNATURE_HEADER] = signature(receiver.secret, body)
    request = Request(
        "POST", receiver.url, own, content=body, secrets=(receiver.url, receiver.bearer or "", receiver.secret or "")
    )
    answer = exchanged(request, receiver.timeout_s)
    return answer if isinstance(answer, Outcome) else judged(answer, request)


def signature(secret: str, body: bytes) -> str:
    """Return the signature, which a receiver compares with its own in constant time.

    >>> signature("key", b"The quick brown fox jumps over the lazy dog")[:23]
    'sha256=f7bc83f430538424'
    """
    return "sha256=" + hmac.new(secret.encode(), body, hashlib.sha256).hexdigest()
