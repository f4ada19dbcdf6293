"""One processor's part of a partition: its engine, the place in the log from which it folds, and what is to be saved of it.

A cut is taken at one place of the log for all units of the partition: then whoever restores it folds from there, and comes to the
same state. Results of records before `published` went out already, and are folded in silence.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from paho.mqtt.client import topic_matches_sub

from processors.actions import Action, DeadLetter
from processors.config import Configuration, ProcessorConfig
from processors.description import machine_and_role, read_message
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.partition.moment import go_on, moment_of
from processors.running.containment import one_line
from processors.running.dead_letter import letter_of_message
from processors.running.engine import Engine
from processors.running.ledger import DropReason
from sparkplug.host_event import HostEvent

FORMAT = 1
_to_json = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False).encode


class Saved(NamedTuple):
    """The state of a unit as it is saved; `payload` is None where the unit is no more."""

    unit: str
    payload: bytes | None


class Seat:
    """See the module. Nothing that it is given makes it raise, but a snapshot that it cannot read."""

    def __init__(
        self, processor: AnyProcessor, configuration: Configuration[ProcessorConfig], is_home: Callable[[str], bool]
    ) -> None:
        """`is_home`: whether the messages of a cell come to this partition."""
        self.processor, self._configuration, self._is_home = processor, configuration, is_home
        self.engine = self._new_engine()
        self.from_offset = self.published = 0
        self.faults: list[str] = []
        self._saved: set[str] = set()

    @property
    def name(self) -> str:
        """The processor's name."""
        return self.processor.name

    def listens(self, topic: str) -> bool:
        """Return True if the processor reads plain messages of a topic."""
        return any(topic_matches_sub(wanted, topic) for wanted in self.processor.listens)

    def _new_engine(self) -> Engine:
        """Return an engine with those cells only, of all that there are from the beginning, that are at home here."""
        engine = Engine(self.processor, self._configuration)
        for unit in [unit for unit in engine.known_units if not self._is_home(unit)]:
            del engine.known_units[unit]
        return engine

    # Snapshots.

    def begin_again(self, units: Iterable[str]) -> None:
        """Forget everything but where results went out. What was saved of `units` is of no use: the next cut takes back those
        that are not known again by then, or they would be refused at each start."""
        self.engine = self._new_engine()
        self._saved = set(units)
        self.from_offset = 0

    def restore(self, name: str, payload: bytes) -> None:
        """Take the state of a unit, before anything is folded. Raises SnapshotError where it is of another version or form.

        A cell that is at home in another partition is taken back with the next cut.
        """
        if self.processor.is_of_cells and not self._is_home(name):
            self._saved.add(name)
            return
        first, _, snapshot = payload.partition(b"\n")
        try:
            moment = json.loads(first)
            of_format = moment["format"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise SnapshotError(f"no snapshot of a unit: {type(error).__name__}: {error}") from error
        if of_format != FORMAT:
            raise SnapshotError(f"format {of_format!r:.40}; this program reads {FORMAT}")
        try:
            unit = self.engine.restore(snapshot)
            go_on(self.engine, self.engine.known_units[unit], moment)
        except SnapshotError:
            raise
        except Exception as error:  # bytes that nobody wrote so: nothing of it is used
            raise SnapshotError(f"no snapshot of a unit: {one_line(error)}") from error
        self._saved.add(unit)

    def cut(self) -> Iterator[Saved]:
        """Yield the units that have changed since the last cut, as they are, and those that are no more."""
        for unit in self.engine.take_changed():
            self._saved.add(unit)
            yield Saved(unit, self.state_of(unit))
        for unit in [unit for unit in self._saved if unit not in self.engine.known_units]:
            self._saved.discard(unit)
            yield Saved(unit, None)

    def state_of(self, unit: str) -> bytes:
        """Return the state of a unit as it is saved: its moment in one line of JSON, and its snapshot in the next."""
        moment = {"format": FORMAT, **moment_of(self.engine, self.engine.known_units[unit])}
        return _to_json(moment).encode() + b"\n" + self.engine.snapshot(unit)

    # What is folded.

    def event(self, event: HostEvent, wall_s: float) -> list[Action]:
        """Fold an event of a node that the processor reads."""
        try:
            return self.engine.feed(event, wall_s)
        except Exception as error:
            return self.failed(event, error)

    def failed(self, event: HostEvent, error: Exception) -> list[Action]:
        """Note a fault at an event, which becomes a dead letter. It is deterministic: a replay comes to the same."""
        self.engine.lost(event, DropReason.FAULT)
        self._note(f"a message of {event.device}", error)
        return [DeadLetter(event.device or str(event.node), letter_of_message(self.name, event, error))]

    def watermark(self, wall_s: float, is_meant: Callable[[str], bool]) -> list[Action]:
        """Fold the silence up to a moment of the machines that are meant, and the beat of the wall clock."""
        try:
            return self.engine.silence(wall_s, is_meant) + self.engine.beat(round(wall_s * 1000))
        except Exception as error:
            self._note("a silence", error)
            return []

    def plain(self, topic: str, payload: bytes, at_ms: int) -> list[Action]:
        """Fold a plain message that the processor listens to."""
        try:
            return self.engine.plain(topic, payload, at_ms)
        except Exception as error:
            self._note(topic, error)
            return []

    def describe(self, topic: str, payload: bytes) -> list[Action]:
        """Take up a machine's description, or that there is none any more."""
        key = machine_and_role(topic)
        if key is None or not self.engine.is_described:
            return []
        machine, role = key
        try:
            description = read_message(payload, machine).description(machine) if payload else None
            return self.engine.describe(machine, role, description)
        except Exception as error:  # the one before goes on
            self._note(f"the {role} description of {machine}", error)
        return []

    def _note(self, what: str, error: Exception) -> None:
        self.faults.append(f"{self.name}: {what} failed: {one_line(error)}")
