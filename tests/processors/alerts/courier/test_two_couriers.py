"""Two couriers that overlap, in a simulation with chance as the seed: one is stopped, hangs or is killed while the other begins.

A broker keeps one order of all messages; what goes to it, and what comes from it, waits for as long as chance will have it.
"""

import json
from collections import Counter, deque
from random import Random

import pytest

from processors.alerts.courier.desk import CLAIM, DELIVERY, OUTBOX, Desk, Publish, Send
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.notification import Notification
from tests.depth import IS_FULL

SEEDS = 2000 if IS_FULL else 300
NOTIFICATIONS = 6
MARKER = "marker"
FATES = (Verdict.DELIVERED, Verdict.DELIVERED, Verdict.NOT_TAKEN, Verdict.UNSURE)


class Broker:
    """Retained messages, and what waits for each subscriber."""

    def __init__(self) -> None:
        self.retained: dict[str, bytes] = {}
        self.lives: list[Life] = []

    def publish(self, topic: str, payload: bytes) -> None:
        if payload:
            self.retained[topic] = payload
        else:
            self.retained.pop(topic, None)
        for life in self.lives:
            life.inbox.append((topic, payload))


class Life:
    """A courier, and the messages on both of its ways."""

    def __init__(self, broker: Broker, name: str, chance: Random, sent: Counter[str]) -> None:
        self.broker, self.chance, self.sent = broker, chance, sent
        self.desk = Desk(name, {"desk": 1e6})
        self.inbox: deque[tuple[str, bytes]] = deque([*broker.retained.items(), (MARKER, b"")])
        self.outbox: deque[Publish] = deque()
        self.sending: list[str] = []
        self.now_s = 0.0
        self.is_stopping = False
        broker.lives.append(self)

    def step(self) -> None:
        """Something of what may happen next."""
        self.now_s += 1.0
        what = self.chance.choice(("read", "read", "write", "write", "tick", "answer"))
        if what == "read" and self.inbox:
            self._take(*self.inbox.popleft())
        elif what == "write" and self.outbox:
            self.broker.publish(*self.outbox.popleft())
        elif what == "tick":
            free = frozenset() if self.is_stopping or self.sending else frozenset({"desk"})
            self.desk.tick(self.now_s, 0.0, free)
        elif what == "answer" and self.sending:
            key, verdict = self.sending.pop(), self.chance.choice(FATES)
            self.sent[key] += verdict is not Verdict.NOT_TAKEN
            self.desk.result(key, Outcome(verdict, "so it is"), self.now_s)
        self._act()

    def stop(self) -> None:
        self.is_stopping = True
        self.desk.close()
        self._act()

    @property
    def is_done(self) -> bool:
        return not (self.sending or self.outbox or self.desk.unseen)

    def end(self) -> None:
        self.broker.lives.remove(self)

    def _take(self, topic: str, payload: bytes) -> None:
        key = topic.rpartition("/")[2]
        if topic == MARKER:
            self.desk.complete()
        elif topic.startswith(OUTBOX):
            self.desk.outbox(key, payload)
        elif topic.startswith(CLAIM):
            self.desk.claim(key, payload, self.now_s)
        elif topic.startswith(DELIVERY):
            self.desk.delivery(key, payload)

    def _act(self) -> None:
        for action in self.desk.take():
            if isinstance(action, Send):
                self.sending.append(action.message.id)
            else:
                self.outbox.append(action)


def notification(key: str) -> bytes:
    said = {
        "id": key, "receiver": "desk", "kind": "notify", "severity": "high", "title": key, "text": key,
        "says": [], "expires_s": 1e9, "body": {},
    }  # fmt: skip
    payload = json.dumps(said).encode()
    assert Notification.of(payload).id == key
    return payload


@pytest.mark.parametrize("leaving", ["is stopped", "is killed", "hangs, and is stopped late"])
def test_whatever_overlaps_nothing_is_sent_twice_and_everything_has_a_fate(leaving: str) -> None:
    untold = 0
    for seed in range(SEEDS):
        chance, broker, sent = Random(seed), Broker(), Counter[str]()
        first = Life(broker, "first", chance, sent)
        keys = [f"n{number}" for number in range(NOTIFICATIONS)]
        for key in keys:
            broker.publish(OUTBOX + key, notification(key))
            for _ in range(chance.randrange(12)):
                first.step()
        if leaving == "is stopped":
            first.stop()
            for _ in range(chance.randrange(12)):
                first.step()
        elif leaving == "is killed":
            first.end()
        second = Life(broker, "second", chance, sent)
        for _ in range(chance.randrange(300)):  # they overlap
            (first if first in broker.lives and chance.random() < 0.5 else second).step()
        if first in broker.lives:
            if not first.is_stopping:
                first.stop()
            while not first.is_done:
                chance.choice((first, second)).step()
            first.end()
        for _ in range(2000):
            second.step()
        assert [key for key, count in sent.items() if count > 1] == [], f"seed {seed}"
        fates = {topic.removeprefix(DELIVERY) for topic in broker.retained if topic.startswith(DELIVERY)}
        untold += len(set(keys) - fates)
    assert untold == 0
