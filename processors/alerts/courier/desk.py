"""The course of each notification through the courier, without I/O. The clock is an argument.

    waiting -> claiming -> sending -> settled
       ^                      |
       +--- surely not taken -+

A claim is sent for only once it is seen to stand on the broker. After a crash, a claim that says `sending` with no delivery means
that nobody knows whether the notification arrived: it is said to have failed, and is not sent again. One that says `waiting` was
surely not taken, and goes on. Each receiver is sent one notification at a time, in the order of the outbox.

Two couriers may overlap, where one takes over from another. Of two claims the one that the broker has first holds: both see them
in its order, and a courier that sees another's before its own lets go.
"""

import json
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from processors.alerts.body import iso
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.notification import Notification
from twin.vocabulary import topics

JOBS_MAX = 2000
DONE_MAX = 10_000
SAY_AGAIN_S = 5.0
FOREIGN_S_MAX = 180.0  # longer than any receiver may take
BACKOFF_S_MIN, BACKOFF_S_MAX = 2.0, 60.0
OUTBOX, CLAIM, DELIVERY = topics.ALERT_OUTBOX, topics.ALERT_CLAIM, topics.ALERT_DELIVERY
SENDING, WAITING = "sending", "waiting"
REASON_MAX = 400
INTERRUPTED = "interrupted while sending; it may have arrived"
FORSAKEN = "another process began to send it, and did not report what became of it; it may have arrived"


class Publish(NamedTuple):
    """Publish this, retained; empty removes it."""

    topic: str
    payload: bytes


class Send(NamedTuple):
    """Send this notification."""

    message: Notification


Action = Publish | Send


class Stage(Enum):
    """The stage of a notification."""

    WAITING = "waiting"
    CLAIMING = "claiming"
    SENDING = "sending"
    SETTLED = "settled"
    FOREIGN = "foreign"  # another courier has claimed it


@dataclass(slots=True)
class _Job:
    message: Notification
    stage: Stage = Stage.WAITING
    attempts: int = 0
    first_s: float | None = None  # of the first attempt
    not_before_s: float = 0.0
    said_s: float = 0.0
    said: bytes = b""  # the claim or the delivery that is to be seen on the broker
    is_seen: bool = False


class Desk:
    """See the module. `give_up_after_s`: of each receiver, how long what is surely not taken is tried again."""

    def __init__(self, instance: str, give_up_after_s: Mapping[str, float]) -> None:
        self.malformed = 0
        self.overflowed = 0
        self._instance, self._give_up_after_s = instance, give_up_after_s
        self._jobs: dict[str, _Job] = {}
        self._done: OrderedDict[str, bytes] = OrderedDict()
        self._claims: dict[str, bytes] = {}  # of others, while what is retained comes in
        self._deliveries: dict[str, bytes] = {}
        self._is_complete = False
        self._actions: list[Action] = []

    @property
    def sending(self) -> frozenset[str]:
        """The receivers that are being sent something."""
        return frozenset(job.message.receiver for job in self._jobs.values() if job.stage is Stage.SENDING)

    @property
    def engaged(self) -> frozenset[str]:
        """The receivers that are being sent something, or are about to be."""
        stages = (Stage.CLAIMING, Stage.SENDING)
        return frozenset(job.message.receiver for job in self._jobs.values() if job.stage in stages)

    @property
    def unseen(self) -> bool:
        """True while the fate of a notification is still to be seen on the broker."""
        return any(job.stage is Stage.SETTLED and not job.is_seen for job in self._jobs.values())

    def take(self) -> list[Action]:
        """Return the actions that are due, in this order."""
        actions, self._actions = self._actions, []
        return actions

    # What comes from the broker.

    def outbox(self, key: str, payload: bytes) -> None:
        """A notification, or its removal."""
        job = self._jobs.get(key)
        if not payload:
            self._removed(key, job)
            return
        if job is not None:
            if job.stage is Stage.SETTLED:
                job.is_seen, job.said_s = False, 0.0  # it asks again: what we said was lost
            return
        if self._done.get(key):  # the alerts processor does not know its fate, which we do
            if (message := _notification(payload)) is not None:
                self._jobs[key] = _Job(message, Stage.SETTLED, said=self._done[key])
            return
        message = _notification(payload)
        if message is None or message.id != key:
            self.malformed += 1
            return
        if len(self._jobs) >= JOBS_MAX:
            self.overflowed += 1  # it comes again: the alerts processor repeats what has no fate
            return
        job = self._jobs[key] = _Job(message)
        if self._is_complete:
            self._recall(key, job)

    def claim(self, key: str, payload: bytes, now_s: float) -> None:
        """A claim stands on the broker: ours, as it was said, or another courier's."""
        if not payload:
            self._claims.pop(key, None)
            return
        job = self._jobs.get(key)
        if not self._is_complete or (job is None and key not in self._done):
            if len(self._claims) < JOBS_MAX:
                self._claims[key] = payload
        elif job is None:
            return
        elif job.stage is Stage.CLAIMING and payload == job.said:
            self._may_send(job, now_s)
        elif _who(payload) != self._instance:
            self._claimed_elsewhere(job, _phase(payload), now_s)

    def _claimed_elsewhere(self, job: _Job, phase: Any, now_s: float) -> None:
        """Another courier has claimed it, or leaves it to whoever claims it next."""
        if phase == SENDING and job.stage in (Stage.WAITING, Stage.CLAIMING):
            job.stage, job.not_before_s = Stage.FOREIGN, now_s + FOREIGN_S_MAX
        elif phase == WAITING and job.stage is Stage.FOREIGN:
            job.stage, job.not_before_s = Stage.WAITING, now_s

    def delivery(self, key: str, payload: bytes) -> None:
        """The fate of a notification stands on the broker."""
        if not payload:
            self._deliveries.pop(key, None)
            return
        self._deliveries[key] = payload
        job = self._jobs.get(key)
        if job is None:
            return
        if job.stage is Stage.SETTLED:
            job.is_seen = True
        elif job.stage is not Stage.SENDING:  # of an earlier life of ours, or of another courier
            job.stage, job.said, job.is_seen = Stage.SETTLED, payload, True

    def complete(self) -> None:
        """Everything that was retained has come: what an earlier life has begun is settled."""
        if self._is_complete:
            return
        self._is_complete = True
        for key, job in self._jobs.items():
            self._recall(key, job)
        self._actions += [Publish(CLAIM + key, b"") for key in self._claims]  # of notifications that are gone
        self._claims.clear()

    def close(self) -> None:
        """The courier ends: what was claimed and not sent yet is surely not taken, and goes on in its next life."""
        for key, job in self._jobs.items():
            if job.stage is Stage.CLAIMING:
                job.stage = Stage.WAITING
                self._actions.append(Publish(CLAIM + key, self._claim(job, WAITING)))

    # What comes from the senders, and time.

    def result(self, key: str, outcome: Outcome, now_s: float) -> None:
        """An attempt has ended."""
        job = self._jobs.get(key)
        if job is None or job.stage is not Stage.SENDING:
            if outcome.verdict is not Verdict.NOT_TAKEN:  # it was removed meanwhile; should it come again, it is not sent again
                self._remember(key, self._fate(key, "", outcome))
            return
        if outcome.verdict is Verdict.NOT_TAKEN:
            began_s = now_s if job.first_s is None else job.first_s
            wait_s = outcome.after_s or min(BACKOFF_S_MIN * 2.0 ** min(job.attempts - 1, 10), BACKOFF_S_MAX)
            if now_s + wait_s - began_s <= self._give_up_after_s.get(job.message.receiver, 0.0):
                job.stage, job.not_before_s = Stage.WAITING, now_s + wait_s
                self._actions.append(Publish(CLAIM + key, self._claim(job, WAITING, reason=outcome.reason)))
                return
            outcome = outcome._replace(reason=f"given up after {job.attempts} attempts: {outcome.reason}")
        self._settle(job, outcome)

    def tick(self, now_s: float, wall_s: float, free: frozenset[str]) -> None:
        """Time has passed; `free` are the receivers that can be sent something."""
        if not self._is_complete:
            return
        busy = {job.message.receiver for job in self._jobs.values() if job.stage in (Stage.CLAIMING, Stage.SENDING)}
        for job in self._jobs.values():
            name = job.message.receiver
            if job.stage is Stage.WAITING:
                if name not in self._give_up_after_s:
                    self._settle(
                        job, Outcome(Verdict.REFUSED, f"the sending process has no receiver {name} in its configuration")
                    )
                elif wall_s > job.message.expires_s:
                    self._settle(job, Outcome(Verdict.REFUSED, "it was too old when it could be sent"))
                elif name not in busy:
                    busy.add(name)  # also where it waits: what comes after does not overtake it
                    if name in free and now_s >= job.not_before_s:
                        self._begin(job, now_s, wall_s)
            elif job.stage is Stage.FOREIGN and now_s >= job.not_before_s:
                self._settle(job, Outcome(Verdict.UNSURE, FORSAKEN))
            if job.stage is Stage.CLAIMING or (job.stage is Stage.SETTLED and not job.is_seen):
                self._say(job, now_s)

    # How it is done.

    def _removed(self, key: str, job: _Job | None) -> None:
        """The alerts processor is done with it: the claim goes too, last of all, so that it never misses a notification that
        could still be sent."""
        self._claims.pop(key, None)
        if job is not None:
            del self._jobs[key]
            if job.stage is Stage.SETTLED:
                self._remember(key, job.said)
        if job is not None or self._is_complete:
            self._actions.append(Publish(CLAIM + key, b""))

    def _remember(self, key: str, fate: bytes) -> None:
        self._done[key] = fate
        while len(self._done) > DONE_MAX:
            self._done.popitem(last=False)

    def _recall(self, key: str, job: _Job) -> None:
        """Take over what an earlier life of the courier has left on the broker of this notification."""
        claim, delivery = self._claims.pop(key, None), self._deliveries.get(key)
        if delivery is not None:
            job.stage, job.said, job.is_seen = Stage.SETTLED, delivery, True
        elif claim is not None and _phase(claim) != WAITING:
            self._settle(job, Outcome(Verdict.UNSURE, INTERRUPTED))

    def _begin(self, job: _Job, now_s: float, wall_s: float) -> None:
        job.stage, job.attempts, job.said_s = Stage.CLAIMING, job.attempts + 1, 0.0
        job.first_s = now_s if job.first_s is None else job.first_s
        job.said = self._claim(job, SENDING, iso(round(wall_s * 1000)))

    def _may_send(self, job: _Job, now_s: float) -> None:
        job.stage, job.said_s = Stage.SENDING, now_s
        self._actions.append(Send(job.message))

    def _say(self, job: _Job, now_s: float) -> None:
        """Say a claim or a fate, and again until it is seen."""
        if job.said_s and now_s - job.said_s < SAY_AGAIN_S:
            return
        job.said_s = now_s
        topic = CLAIM if job.stage is Stage.CLAIMING else DELIVERY
        self._actions.append(Publish(topic + job.message.id, job.said))

    def _claim(self, job: _Job, phase: str, at: str = "", reason: str = "") -> bytes:
        said = {"id": job.message.id, "courier": self._instance, "phase": phase, "attempt": job.attempts, "at": at}
        if reason:  # why it was surely not taken, for the state of alerts to show
            said |= {"receiver": job.message.receiver, "reason": reason[:REASON_MAX]}
        return json.dumps(said, separators=(",", ":")).encode()

    def _settle(self, job: _Job, outcome: Outcome) -> None:
        job.stage, job.said_s, job.is_seen = Stage.SETTLED, 0.0, False
        job.said = self._fate(job.message.id, job.message.receiver, outcome)

    def _fate(self, key: str, receiver: str, outcome: Outcome) -> bytes:
        is_delivered = outcome.verdict is Verdict.DELIVERED
        said: dict[str, Any] = {
            "id": key,
            "receiver": receiver or "?",
            "outcome": "delivered" if is_delivered else "failed",
            "reason": outcome.reason,
        }
        return json.dumps(said, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")


def _notification(payload: bytes) -> Notification | None:
    """The notification in the outbox; None where it cannot be read."""
    try:
        return Notification.of(payload)
    except (ValueError, RecursionError):
        return None


def _claimed(payload: bytes) -> dict[str, Any]:
    try:
        said = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _phase(payload: bytes) -> Any:
    return _claimed(payload).get("phase")


def _who(payload: bytes) -> Any:
    return _claimed(payload).get("courier")
