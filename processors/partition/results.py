"""The outcome of a fold as events of the processor's own node, and back: what runners write and bridges publish.

A processor's results are what a reader on MQTT sees of `twin-<processor>`: the birth of a twin device with all that is known of
it, data, its death, and plain messages. So the log holds them in the same form as what machines say.
"""

from collections.abc import Sequence

from processors.actions import Action, Declare, PlainOutput, Publish, Remove
from processors.discovery import AnyProcessor
from processors.running.challenger import challenger_specs
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import Change, NodeId, Reading
from twin.vocabulary.twin_signals import live_name

_NO_NODE = NodeId("", "")


class Results:
    """Makes events of the actions of one processor."""

    def __init__(self, group: str, processor: AnyProcessor) -> None:
        self.node = NodeId(group, processor.node)
        of_challenger = challenger_specs(processor.outputs)
        self._units = {spec.name: spec.unit for spec in (*processor.outputs, *of_challenger)}

    def event(self, action: Action, at_ms: int) -> HostEvent | None:
        """Return the event that tells of an action; None for a dead letter and a pin, which tell nobody else."""
        if isinstance(action, Publish):
            return HostEvent(EventKind.DATA, self.node, action.machine, at_ms, self._readings(action.changes))
        if isinstance(action, Declare):
            return HostEvent(EventKind.BIRTH, self.node, action.machine, at_ms, self._readings(action.latest))
        if isinstance(action, Remove):
            return HostEvent(EventKind.DEATH, self.node, action.machine, at_ms)
        if isinstance(action, PlainOutput):
            return HostEvent(EventKind.PLAIN, _NO_NODE, None, at_ms, topic=action.topic, payload=action.payload)
        return None

    def _readings(self, changes: Sequence[Change]) -> tuple[Reading, ...]:
        units = self._units
        return tuple(
            Reading(name, value, at_ms, quality, units.get(name), reason, is_historical)
            for name, value, at_ms, quality, reason, is_historical in changes
        )


def action_of(event: HostEvent, qos: int = 0, *, retain: bool = False) -> Action:
    """Return the action that an event of a processor's node tells of."""
    machine = event.device or ""
    if event.kind is EventKind.PLAIN:
        return PlainOutput(event.topic, event.payload, qos, retain)
    if event.kind is EventKind.DEATH:
        return Remove(machine)
    changes = tuple(
        Change(name, value, at_ms, quality, reason, is_historical)
        for name, value, at_ms, quality, _, reason, is_historical in event.readings
    )
    if event.kind is EventKind.DATA:
        return Publish(machine, changes)
    return Declare(machine, changes, is_challenged=any(live_name(change.name) is not None for change in changes))
