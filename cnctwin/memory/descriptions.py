"""The descriptions of a machine as the memory heard them: which was live when, and which was its challenger."""

import json
from collections.abc import Iterator
from dataclasses import dataclass

from cnctwin.memory.plain_record import DESCRIPTION_KIND
from cnctwin.memory.store.contract import Snapshot, Store
from processors.description import Description, DescriptionMessage, Role, read_message
from twin.errors import MachineError

CHANGES_MAX = 10_000  # in a stretch


@dataclass(frozen=True, slots=True)
class Described:
    """A description, or its end where `message` is None, as of when it was heard: before any message of that millisecond."""

    machine: str
    role: Role
    received_ms: int
    message: DescriptionMessage | None = None

    @property
    def version(self) -> str:
        """The version; "" at its end."""
        return "" if self.message is None else self.message.version

    @property
    def description(self) -> Description | None:
        """Return the description; None at its end, and where the memory holds what this version cannot read."""
        try:
            return None if self.message is None else self.message.description(self.machine)
        except MachineError:
            return None


@dataclass(frozen=True, slots=True)
class Faulty:
    """A stretch in which the files that describe a machine had a fault; until_ms: when it was mended, None = not yet."""

    from_ms: int
    until_ms: int | None
    text: str


def described(store: Store, machine: str, from_ms: int, to_ms: int) -> tuple[Described, ...]:
    """Return the descriptions that held when a stretch began, as of before it, and all that were heard within it, in order."""
    found = [one for role in Role for one in _heard(store, machine, role, from_ms, to_ms)]
    return tuple(sorted(found, key=lambda one: (one.received_ms, one.role is Role.CHALLENGER)))


def faults(store: Store, machine: str, from_ms: int, to_ms: int) -> tuple[Faulty, ...]:
    """Return the faults of a machine's files that stood in a stretch, oldest first; one that began earlier with its beginning."""
    found: list[Faulty] = []
    for one in _snapshots(store, f"{machine}/fault", from_ms, to_ms):
        text = _fault_text(one.payload)
        if found and found[-1].until_ms is None:
            if text == found[-1].text:
                continue
            found[-1] = Faulty(found[-1].from_ms, one.received_ms, found[-1].text)
        if text:
            found.append(Faulty(one.received_ms, None, text))
    return tuple(one for one in found if one.until_ms is None or one.until_ms >= from_ms)


def _fault_text(payload: bytes) -> str:
    try:
        document = json.loads(payload) if payload else {}
    except (ValueError, RecursionError):
        return ""
    return str(document.get("text") or "") if isinstance(document, dict) else ""


def _heard(store: Store, machine: str, role: Role, from_ms: int, to_ms: int) -> Iterator[Described]:
    """The descriptions in a role, oldest first; one that says the same again is left out."""
    version = None
    for snapshot in _snapshots(store, f"{machine}/{role}", from_ms, to_ms):
        one = _described(machine, role, snapshot)
        if one.version != version:
            yield one
        version = one.version


def _snapshots(store: Store, name: str, from_ms: int, to_ms: int) -> list[Snapshot]:
    """Return what was heard under a name in a stretch, and the last before it, oldest first."""
    found: list[Snapshot] = []
    before_ms = to_ms
    while len(found) < CHANGES_MAX and (snapshot := store.snapshot_before(DESCRIPTION_KIND, name, before_ms)):
        found.append(snapshot)
        before_ms = snapshot.received_ms
        if before_ms < from_ms:
            break
    return found[::-1]


def _described(machine: str, role: Role, snapshot: Snapshot) -> Described:
    message = None
    if snapshot.payload:
        try:
            message = read_message(snapshot.payload, machine)
        except MachineError:
            message = None
    return Described(machine, role, snapshot.received_ms, message)
