"""The descriptions of a machine as the memory heard them: which was live when, and which was its challenger."""

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


def described(store: Store, machine: str, from_ms: int, to_ms: int) -> tuple[Described, ...]:
    """Return the descriptions that held when a stretch began, as of before it, and all that were heard within it, in order."""
    found = [one for role in Role for one in _heard(store, machine, role, from_ms, to_ms)]
    return tuple(sorted(found, key=lambda one: (one.received_ms, one.role is Role.CHALLENGER)))


def _heard(store: Store, machine: str, role: Role, from_ms: int, to_ms: int) -> Iterator[Described]:
    """The descriptions in a role, oldest first; one that says the same again is left out."""
    kept: list[Described] = []
    before_ms = to_ms
    while len(kept) < CHANGES_MAX and (snapshot := store.snapshot_before(DESCRIPTION_KIND, f"{machine}/{role}", before_ms)):
        kept.append(_described(machine, role, snapshot))
        before_ms = snapshot.received_ms
        if before_ms < from_ms:
            break
    version = None
    for one in reversed(kept):
        if one.version != version:
            yield one
        version = one.version


def _described(machine: str, role: Role, snapshot: Snapshot) -> Described:
    message = None
    if snapshot.payload:
        try:
            message = read_message(snapshot.payload, machine)
        except MachineError:
            message = None
    return Described(machine, role, snapshot.received_ms, message)
