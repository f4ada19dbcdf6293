"""Fold, broker and courier in one process, killed at any moment: nothing arrives twice; what does not arrive has failed.

The broker keeps what is retained and hands each client its messages in order; each client is a step of chance behind. A fold that
is killed goes on from a snapshot of up to two beats before; a courier that is killed knows what is retained.
"""

import json
from collections import Counter, deque
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.alerts.config import AlertsConfig
from processors.alerts.courier.desk import CLAIM, Desk, Publish, Send
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.messages import DELIVERY, OUTBOX
from processors.alerts.notification import Notification
from processors.alerts.processor import step
from processors.alerts.state import AlertsState
from processors.config import Configuration
from processors.contract import PlainOutput, Sample, SampleKind
from processors.running.snapshot import decode_state, encode_state
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.depth import examples
from tests.processors.alerts.courier.alert_shop import DESK, PHONE, T0_S, VIBRATION

MACHINES = ("okuma", "mazak", "haas", "dmg")
TABLE = {
    "receivers": {name: one | {"give_up_after_s": 60.0, "rate_per_hour": 1000} for name, one in (DESK | PHONE).items()},
    "group_wait_s": 2.0,
    "group_interval_s": 5.0,
    "repeat_interval_s": 60.0,
    "flap_episodes": 50,
    "signals": {VIBRATION: {"severity": "medium", "keep_firing_for_s": 1.0}},
}
ADAPTER: TypeAdapter[Any] = TypeAdapter(AlertsState)


class Plant:
    """See the module. `killing`: how likely the courier dies at its turn, and the fold in the middle of what it publishes."""

    def __init__(self, seed: int, killing: float = 0.08) -> None:
        self.chance, self.killing = Random(seed), killing
        group_by = "all" if seed % 3 else "machine"  # together, what is told depends on the moment
        self.configuration = Configuration(AlertsConfig, TABLE | {"group_by": group_by}, name="alerts")
        self.wall_s = T0_S
        self.rows: dict[str, dict[str, Reading]] = {machine: {} for machine in MACHINES}
        self.retained: dict[str, bytes] = {}
        self.snapshot: Any = None
        self.beats = 0
        self.arrived: list[tuple[str, str]] = []  # (receiver, id)
        self.outcomes: dict[str, list[str]] = {}
        self.firings: Counter[tuple[str, str, str]] = Counter()  # what ids said, once each
        self.known: set[str] = set()
        self.believed: dict[tuple[str, str], str] = {}  # receiver and alert: what was told last
        self.lives = 0
        self.start_fold()
        self.start_courier()

    # The broker.

    def publish(self, topic: str, payload: bytes) -> None:
        if payload:
            self.retained[topic] = payload
        else:
            self.retained.pop(topic, None)
        if topic.startswith(OUTBOX) and payload:
            self.note(payload)
        if topic.startswith(DELIVERY) and payload:
            said = json.loads(payload)
            self.outcomes.setdefault(said["id"], []).append(said["outcome"])
        if payload and topic.startswith((OUTBOX, DELIVERY)):
            self.to_fold.append((topic, payload))
        if topic.startswith((OUTBOX, DELIVERY, CLAIM)):
            self.to_courier.append((topic, payload))

    def note(self, payload: bytes) -> None:
        message = Notification.of(payload)
        if message.id not in self.known:
            self.known.add(message.id)
            for said in message.says:
                fingerprint, episode, what, *_ = said.split(".")
                self.believed[message.receiver, fingerprint] = what
                if what == "firing":
                    self.firings[message.receiver, fingerprint, episode] += 1

    def shuffled(self, *prefixes: str) -> list[tuple[str, bytes]]:
        found = [item for item in self.retained.items() if item[0].startswith(prefixes)]
        self.chance.shuffle(found)
        return found

    # The fold.

    def start_fold(self) -> None:
        self.state = AlertsState() if self.snapshot is None else decode_state(ADAPTER, json.loads(self.snapshot))
        self.to_fold: deque[tuple[str, bytes]] = deque(self.shuffled(OUTBOX, DELIVERY))
        while self.to_fold:  # the worker folds what has come before it goes on
            self.fold_message()

    def fold_message(self) -> None:
        if self.to_fold:
            topic, payload = self.to_fold.popleft()
            self.fold(Sample("", SampleKind.PLAIN, self.wall_s, {}, detail=payload.decode(), topic=topic, cell=self.rows))

    def beat(self) -> None:
        self.wall_s += 1.0
        self.fold(Sample("", SampleKind.BEAT, self.wall_s, {}, cell=self.rows), die=self.chance.random() < self.killing)
        self.beats += 1
        if self.beats % 2 == 0:
            self.snapshot = json.dumps(encode_state(ADAPTER, self.state))

    def toggle(self) -> None:
        machine = self.chance.choice(MACHINES)
        row = self.rows[machine]
        value = not (VIBRATION in row and row[VIBRATION].value)
        row[VIBRATION] = Reading(VIBRATION, value, round(self.wall_s * 1000), Quality.GOOD, None, None, False)
        self.fold(Sample(machine, SampleKind.DATA, self.wall_s, row, (VIBRATION,), cell=self.rows))

    def fold(self, sample: Sample, die: bool = False) -> None:
        self.state, outputs = step(self.configuration, self.state, sample)
        plain = [output for output in outputs if isinstance(output, PlainOutput)]
        if die:  # in the middle of publishing
            for output in plain[: self.chance.randint(0, len(plain))]:
                self.publish(output.topic, output.payload)
            self.start_fold()
            return
        for output in plain:
            self.publish(output.topic, output.payload)

    # The courier.

    def start_courier(self) -> None:
        self.lives += 1
        self.desk = Desk(f"life{self.lives}", dict.fromkeys(TABLE["receivers"], 60.0))  # type: ignore[attr-defined]
        self.to_courier: deque[tuple[str, bytes]] = deque(self.shuffled(OUTBOX, CLAIM, DELIVERY))
        self.in_flight: dict[str, tuple[Notification, Outcome | None]] = {}
        while self.to_courier:
            self.courier_message()
        self.desk.complete()

    def courier_message(self) -> None:
        if not self.to_courier:
            return
        topic, payload = self.to_courier.popleft()
        key = topic.rpartition("/")[2]
        if topic.startswith(OUTBOX):
            self.desk.outbox(key, payload)
        elif topic.startswith(CLAIM):
            self.desk.claim(key, payload, self.wall_s)
        else:
            self.desk.delivery(key, payload)

    def courier_turn(self, die: bool = False) -> None:
        free = frozenset(TABLE["receivers"]) - {message.receiver for message, _ in self.in_flight.values()}  # type: ignore[arg-type]
        self.desk.tick(self.wall_s, self.wall_s, free)
        actions = self.desk.take()
        if die:
            actions = actions[: self.chance.randint(0, len(actions))]
        for action in actions:
            if isinstance(action, Publish):
                self.publish(action.topic, action.payload)
            else:
                assert isinstance(action, Send)
                self.in_flight[action.message.id] = (action.message, None)
        if die:
            self.start_courier()

    def network(self) -> None:
        """A step of what is being sent: it arrives, or is refused; then the courier learns what became of it."""
        for key, (message, outcome) in list(self.in_flight.items()):
            if self.chance.random() < 0.5:
                continue
            if outcome is not None:
                del self.in_flight[key]
                self.desk.result(key, outcome, self.wall_s)
                continue
            verdict = self.chance.choices([Verdict.DELIVERED, Verdict.NOT_TAKEN, Verdict.REFUSED, Verdict.UNSURE], [6, 2, 1, 1])[
                0
            ]
            if verdict is Verdict.DELIVERED or (verdict is Verdict.UNSURE and self.chance.random() < 0.5):
                self.arrived.append((message.receiver, key))
            self.in_flight[key] = (message, Outcome(verdict, "by chance"))

    # All of it.

    def live(self, steps: int) -> None:
        for _ in range(steps):
            what = self.chance.random()
            if what < 0.25:
                self.beat()
            elif what < 0.5:
                self.fold_message()
            elif what < 0.75:
                self.courier_message()
            elif what < 0.88:
                self.courier_turn(die=self.chance.random() < self.killing)
            elif what < 0.93:
                self.network()
            elif what < 0.98:
                self.toggle()
            elif self.chance.random() < self.killing:
                (self.start_fold if self.chance.random() < 0.5 else self.start_courier)()

    def settle(self) -> None:
        """All alarms go, nobody is killed any more, and everything comes to its end."""
        self.chance.random = lambda: 0.9  # type: ignore[method-assign] — everything moves at each step
        for machine in MACHINES:
            row = self.rows[machine]
            row[VIBRATION] = Reading(VIBRATION, False, round(self.wall_s * 1000), Quality.GOOD, None, None, False)
        for _ in range(150):
            self.beat()
            for _ in range(4):
                self.courier_turn()
                self.network()
                while self.to_courier:
                    self.courier_message()
                while self.to_fold:
                    self.fold_message()


def lived(seed: int, killing: float = 0.08, steps: int = 1500) -> Plant:
    """A plant after its life, and after everything has come to its end."""
    plant = Plant(seed, killing)
    plant.live(steps)
    plant.settle()
    return plant


def told_twice(plant: Plant) -> list[tuple[str, str, str]]:
    return [said for said, count in plant.firings.items() if count > 1]


def believed_to_fire(plant: Plant) -> list[tuple[str, str]]:
    return [who for who, what in plant.believed.items() if what not in ("resolved", "passed")]


@given(seed=st.integers(0, 2**32))
@settings(max_examples=examples(20, 10), deadline=None, derandomize=True)
def test_killed_anywhere_nothing_arrives_twice_and_what_is_missing_is_said_to_have_failed(seed: int) -> None:
    plant = lived(seed)
    twice = [item for item, count in Counter(plant.arrived).items() if count > 1]
    assert twice == []
    arrived = {key for _, key in plant.arrived}
    assert [key for key in plant.known if key not in arrived and "failed" not in plant.outcomes.get(key, [])] == []
    assert [key for key in plant.known if len(set(plant.outcomes[key])) > 1] == []
    assert told_twice(plant) == [], "a firing was told by two notifications"
    assert believed_to_fire(plant) == [], "nobody was told of the end"
    left = [topic for topic in plant.retained if topic.startswith((OUTBOX, DELIVERY, CLAIM))]
    assert left == []


# Of these, each told a firing again under another id, when a fold that came back believed its snapshot only.
@pytest.mark.parametrize("seed", [106, 115, 118, 124])
def test_a_firing_is_told_by_one_notification_however_the_fold_is_killed(seed: int) -> None:
    plant = lived(seed, killing=0.15)
    assert told_twice(plant) == []
    assert believed_to_fire(plant) == []


def test_the_simulation_does_send_fail_and_kill() -> None:
    """A law that nothing ever tried is none."""
    plants = [lived(seed) for seed in range(4)]
    outcomes = Counter(outcome for plant in plants for told in plant.outcomes.values() for outcome in told)
    assert outcomes["delivered"] > 50
    assert outcomes["failed"] > 20
    assert sum(plant.lives for plant in plants) > 20


def test_undisturbed_every_firing_is_told_to_both() -> None:
    plant = lived(7, killing=0.0, steps=3000)
    receivers = Counter(receiver for receiver, _, _ in plant.firings)
    assert receivers["desk"] == receivers["phone"] > 5
