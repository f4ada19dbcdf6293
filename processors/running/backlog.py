"""The events that wait while more comes than can be folded. Pure; what folding has cost is told to it.

Each sender has a line. The next event is taken from the sender whose events have cost the least time so far, counted from when
its line began (start-time fair queuing: Goyal, Vin and Cheng, 1996). So a sender waits for no more than one event of each other
sender, however many of them it has waiting. Within a line the order holds; between lines it does not.

    line short                    events wait as they came
    line beyond its share         data are conflated with the data of the same device that wait last (conflation.py)
    line beyond what is bounded   its oldest data are passed over, and where there are none, its oldest event

A share is what can be folded in WORK_S_MAX, divided by the senders that wait. The description of a machine waits behind what the
machine's own edge has waiting, and the edge's next data behind it.
"""

import heapq
import itertools
from collections import deque
from dataclasses import dataclass, field

from processors.description import machine_and_role
from processors.running.conflation import conflated
from sparkplug.host_event import EventKind, HostEvent
from twin.vocabulary.nodes import is_twin_node

WORK_S_MAX = 2.0  # that may wait, if it is shared fairly
SHARE_MIN = 50  # readings
LINE_MAX = 50_000  # readings of one sender
READINGS_MAX = 500_000  # of all; beyond it a line is bounded by its share
COST_S = 5e-6  # of a reading, until it is known
COST_WEIGHT = 0.01  # of the latest event in the mean
Sender = tuple[str, str, str]


@dataclass(slots=True)
class _Waiting:
    """An event in a line; None once it was taken or passed over."""

    event: HostEvent | None


@dataclass(slots=True)
class _Line:
    """The events of a sender in order, its data among them, and what waits last of each device."""

    start_s: float  # the folding time that the sender has had, on the scale of all
    size: int = 0
    items: deque[_Waiting] = field(default_factory=deque)
    data: deque[_Waiting] = field(default_factory=deque)
    last: dict[str | None, _Waiting] = field(default_factory=dict)


class Backlog:
    """See the module. It is empty in a process that keeps up."""

    def __init__(self) -> None:
        self._lines: dict[Sender, _Line] = {}
        self._due: list[tuple[float, int, Sender]] = []
        self._numbers = itertools.count()
        self._served_s = 0.0  # where the sender began that was served last
        self._current: Sender | None = None
        self._taken_size = 0
        self._cost_s = COST_S
        self._size = 0

    def __bool__(self) -> bool:
        return bool(self._lines)

    def put(self, event: HostEvent) -> list[HostEvent]:
        """Have an event wait; return the events that are passed over for it."""
        described = machine_and_role(event.topic) if event.kind is EventKind.PLAIN else None
        sender = (None if described is None else self._edge_of(described[0])) or _sender(event)
        line = self._lines.get(sender)
        if line is None:
            line = self._lines[sender] = _Line(self._served_s)
            heapq.heappush(self._due, (line.start_s, next(self._numbers), sender))
        share = min(max(SHARE_MIN, int(WORK_S_MAX / self._cost_s / len(self._lines))), LINE_MAX // 2)
        if line.size > share and (old := self._conflate(line, event)) is not None:
            return [old]
        waiting = _Waiting(event)
        line.items.append(waiting)
        if event.kind is EventKind.DATA:
            line.data.append(waiting)
        if event.device is None:
            line.last.clear()  # nothing is moved across what concerns all devices
            if described is not None:
                line.last[described[0]] = waiting
        else:
            line.last[event.device] = waiting
        self._grow(line, _size(event))
        bound = LINE_MAX if self._size <= READINGS_MAX else share
        passed_over: list[HostEvent] = []
        while line.size > bound and len(line.items) > 1:
            passed_over += self._drop_oldest(line)
        return passed_over

    def take(self) -> HostEvent:
        """Return the event that is next. Call `spent` when it is folded."""
        start_s, _, sender = heapq.heappop(self._due)
        line = self._lines[sender]
        self._served_s = max(self._served_s, start_s)
        event = None
        while event is None:
            waiting = line.items.popleft()
            event, waiting.event = waiting.event, None
        if line.data and line.data[0].event is None:
            line.data.popleft()
        self._grow(line, -_size(event))
        self._current, self._taken_size = sender, _size(event)
        return event

    def spent(self, cost_s: float) -> None:
        """Note what folding the event that was taken last has cost."""
        assert self._current is not None, "an event was taken before"
        self._cost_s += COST_WEIGHT * (cost_s / self._taken_size - self._cost_s)
        line = self._lines[self._current]
        if line.size:
            line.start_s = max(line.start_s, self._served_s) + cost_s
            heapq.heappush(self._due, (line.start_s, next(self._numbers), self._current))
        else:
            del self._lines[self._current]
        self._current = None

    def _edge_of(self, machine: str) -> Sender | None:
        """Return the edge in whose line something of a machine waits; None where there is none."""
        lines = self._lines.items()
        return next((sender for sender, line in lines if machine in line.last and not is_twin_node(sender[1])), None)

    def _conflate(self, line: _Line, event: HostEvent) -> HostEvent | None:
        """Put an event into the one of its device that waits last; return that one, or None where it cannot be done."""
        waiting = line.last.get(event.device)
        old = None if waiting is None else waiting.event
        if waiting is None or old is None or (both := conflated(old, event)) is None:
            return None
        waiting.event = both
        self._grow(line, _size(both) - _size(old))
        return old

    def _drop_oldest(self, line: _Line) -> list[HostEvent]:
        """Pass over the oldest data of a line, else its oldest event; of the newest one nothing is lost."""
        while line.data and line.data[0].event is None:
            line.data.popleft()
        newest = line.items[-1]
        waiting = line.data.popleft() if line.data and line.data[0] is not newest else line.items.popleft()
        event, waiting.event = waiting.event, None
        while line.items[0].event is None:
            line.items.popleft()
        if event is None:
            return []
        self._grow(line, -_size(event))
        return [event]

    def _grow(self, line: _Line, size: int) -> None:
        line.size += size
        self._size += size


def _size(event: HostEvent) -> int:
    return 1 + len(event.readings)


def _sender(event: HostEvent) -> Sender:
    """Return whose line an event is in: its node's, the machine's of a processor, the folder's of a plain message."""
    if event.kind is EventKind.PLAIN:
        return "", event.topic.rpartition("/")[0], ""
    group, node = event.node
    return group, node, event.device or "" if is_twin_node(node) else ""
