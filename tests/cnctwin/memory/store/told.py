"""Messages of a made-up plant, and what a store has to make of them: the law, written as plainly as it can be."""

from collections.abc import Iterable, Sequence
from typing import Any

from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.value_form import same
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

GOOD, STALE, BAD = Quality.GOOD, Quality.STALE, Quality.BAD
EDGE, TWIN = NodeId("cnc", "edge-1"), NodeId("cnc", "twin-thermal")
HOUR_MS = 3_600_000
T0_MS = 1_790_000_000_000 // 86_400_000 * 86_400_000 + 6 * HOUR_MS
"""Six o'clock of a day."""


def reading(
    name: str, value: Any, t_ms: int, quality: Quality = GOOD, reason: str | None = None, *, history: bool = False
) -> Reading:
    """A reading `t_ms` after T0_MS."""
    return Reading(name, value, T0_MS + t_ms, quality, "mm" if name.endswith("_mm") else None, reason, history)


def told(
    readings: Sequence[Reading],
    t_ms: int,
    *,
    kind: EventKind = EventKind.DATA,
    machine: str = "vmc",
    node: NodeId = EDGE,
    lag_ms: int = 20,
) -> Message:
    """A message of a machine."""
    return Message(T0_MS + t_ms + lag_ms, HostEvent(kind, node, machine, T0_MS + t_ms, tuple(readings)))


def steady(first_ms: int, count: int, *, every_ms: int = 100, machine: str = "vmc", start: int = 0) -> list[Message]:
    """A machine that says three signals, as controls do."""
    return [
        told(
            [
                reading("x_mm", round((start + n) * 0.037 % 50, 3), first_ms + n * every_ms),
                reading("exec_state", "ACTIVE" if (start + n) // 50 % 2 else "READY", first_ms + n * every_ms),
                reading("twin_like", (start + n) * 1.1, first_ms + n * every_ms),
            ],
            first_ms + n * every_ms,
            machine=machine,
        )
        for n in range(count)
    ]


class Law:
    """What a store has to hold: each sample once, each message in order, of DATA what was not there."""

    def __init__(self) -> None:
        self.samples: dict[tuple[str, str], list[tuple[int, Reading]]] = {}
        self.messages: list[Message] = []

    def append(self, messages: Iterable[Message]) -> None:
        """Take messages."""
        for message in messages:
            self._message(message)

    def _message(self, message: Message) -> None:
        event = message.event
        if event.device is None:
            self.messages.append(message)
            return
        new = [r for r in event.readings if self._is_new(event, r)]
        if event.kind is not EventKind.DATA:
            self.messages.append(message)
        elif new or not event.readings:
            self.messages.append(Message(message.received_ms, event._replace(readings=tuple(new))))

    def _is_new(self, event: HostEvent, r: Reading) -> bool:
        known = self.samples.setdefault((str(event.node), r.name), [])
        last = max(known, key=lambda one: one[0], default=None)
        within = [one for one in known if one[0] // 1000 == r.timestamp_ms]
        is_live = event.kind is EventKind.DATA and not r.is_historical
        if is_live and last is not None and last[0] // 1000 == r.timestamp_ms:
            is_new = not _alike(last[1], r)
        else:
            is_new = not any(_alike(one[1], r) for one in within)
        if is_new:
            known.append((max((t for t, _ in within), default=r.timestamp_ms * 1000 - 1) + 1, r))
        revives = event.kind is EventKind.BIRTH and last is not None and last[1].quality is STALE
        if revives and last is not None and r.timestamp_ms < last[0] // 1000 <= event.timestamp_ms:
            known.append((max(event.timestamp_ms * 1000, last[0] + 1), r))
        return is_new

    def column(self, signal: str) -> list[tuple[int, Any, Quality, str | None]]:
        """All samples of a signal, by time."""
        every = [one for (_, name), some in self.samples.items() if name == signal for one in some]
        return [(t, r.value, r.quality, r.reason) for t, r in sorted(every, key=lambda one: one[0])]


def _alike(a: Reading, b: Reading) -> bool:
    return same(a.value, b.value) and a.quality is b.quality and a.reason == b.reason
