"""The way out of a processor: its twin devices on its edge node, its plain messages on the host's connection.

An action that fails is its machine's fault, and holds up no other action.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from processors.actions import Action, DeadLetter, Declare, Pin, PlainOutput, Publish, Remove
from processors.discovery import AnyProcessor
from processors.plain_topic import topic_level
from processors.running.challenger import challenger_specs
from processors.running.containment import shown
from processors.running.counts import Counts
from processors.running.ledger import DropReason
from processors.running.ports import EdgePort, HostPort
from sparkplug.actions import Publish as PlainMessage
from sparkplug.errors import SparkplugError
from sparkplug.metric import Change, MetricSpec
from twin.vocabulary import topics

DEAD_LETTERS_A_REPORT_MAX = 10  # that are published; all are counted
_log = logging.getLogger(__name__)


class Sent(NamedTuple):
    """The outcome of actions: why not all of it could be sent, and the machines whose actions failed."""

    missed: DropReason | None
    failures: Sequence[tuple[str, Exception]] = ()


ALL = Sent(None)


class Sender:
    """See the module. `alarmed` is called with a machine whose alarm is raised or ended, `pin` with what is to be pinned."""

    def __init__(
        self,
        processor: AnyProcessor,
        host: HostPort,
        edge: EdgePort,
        *,
        alarmed: Callable[[str], None],
        pin: Callable[[Pin], None],
    ) -> None:
        self._name, self._host, self._edge = processor.name, host, edge
        self._alarmed, self._pin = alarmed, pin
        self._specs: tuple[MetricSpec, ...] = tuple(spec.metric() for spec in processor.outputs)
        self._challenger_specs = tuple(spec.metric() for spec in challenger_specs(processor.outputs))
        self._alarms = frozenset(spec.name for spec in processor.outputs if spec.is_alarm)
        self._letter_prefix = topics.dead_letters_of(processor.name)
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX
        self._declared: set[str] = set()

    def begin(self, edge: EdgePort) -> None:
        """Go on with an edge node that knows no device."""
        self._edge = edge
        self._declared.clear()

    def reported(self) -> None:
        """A report has gone out: dead letters may be published again."""
        self._letters_left = DEAD_LETTERS_A_REPORT_MAX

    def apply(self, actions: Sequence[Action], counts: Counts) -> Sent:
        """Carry out what the engine asks."""
        missed: DropReason | None = None
        failures: list[tuple[str, Exception]] = []
        plain: list[PlainMessage] = []
        for action in actions:
            if isinstance(action, PlainOutput):
                plain.append(action)
                continue
            try:
                if isinstance(action, Publish):
                    if not self._publish(action, counts):
                        missed = DropReason.BROKER_OFFLINE
                elif isinstance(action, DeadLetter):
                    plain += self._posted(action)
                else:
                    self._do(action)
            except Exception as error:
                failures.append((action.machine, error))
        if plain and not self._host.publish_all(plain):
            missed = DropReason.BROKER_OFFLINE
        if failures:
            return Sent(DropReason.FAULT, failures)
        return ALL if missed is None else Sent(missed)

    def _do(self, action: Declare | Remove | Pin) -> None:
        if isinstance(action, Declare):
            specs = self._specs + self._challenger_specs if action.is_challenged else self._specs
            self._edge.declare_device(action.machine, [_with_latest(spec, action.latest) for spec in specs])
            self._declared.add(action.machine)
        elif isinstance(action, Pin):
            self._pin(action)
        elif action.machine in self._declared:
            self._declared.discard(action.machine)
            self._edge.remove_device(action.machine)

    def _publish(self, action: Publish, counts: Counts) -> bool:
        if action.machine not in self._declared:
            return True  # of a machine that is offline; its next birth carries what is known then
        if self._alarms and not self._alarms.isdisjoint(change[0] for change in action.changes):
            self._alarmed(action.machine)
        try:
            return self._edge.publish(action.machine, action.changes)
        except SparkplugError as error:
            counts.dead_letters += 1
            _log.warning("%s: %s: %s", self._name, action.machine, error)
            return True

    def _posted(self, letter: DeadLetter) -> list[PlainMessage]:
        if self._letters_left <= 0:
            return []
        self._letters_left -= 1
        _log.warning("%s: dead letter of %s: %s", self._name, shown(letter.machine), letter.payload.decode())
        return [PlainMessage(self._letter_prefix + topic_level(letter.machine), letter.payload)]


def _with_latest(spec: MetricSpec, latest: Sequence[Change]) -> MetricSpec:
    """The declaration with the value that was published last, so that the birth carries it, as of its own time."""
    for name, value, timestamp_ms, quality, reason, _ in latest:
        if name == spec.name:
            return replace(spec, value=value, timestamp_ms=timestamp_ms, quality=quality, reason=reason)
    return spec
