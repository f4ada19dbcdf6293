"""Defects of the kind that was once found in a plant, put back in on purpose: a simulation must find them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import processors.mirror
from processors.alerts.courier.desk import Desk
from sparkplug.admission.gate import Gate
from sparkplug.transport.sendable import Sendable
from tests.plant.simulation.disk import Database

Names = list[tuple[Any, str, Any]]


def receipts_before_sync() -> Names:
    """The historian says that it has a row which is committed, but not forced to the disk."""
    execute = Database.execute

    def hasty(self: Database, text: str, *args: Any) -> Any:
        is_store = self.file.endswith("store.sqlite")
        return execute(self, text.replace("synchronous = FULL", "synchronous = NORMAL") if is_store else text, *args)

    return [(Database, "execute", hasty)]


def claim_unseen() -> Names:
    """The courier sends before its claim stands on the broker."""
    begin = Desk._begin

    def hasty(self: Desk, job: Any, now_s: float, wall_s: float) -> None:
        begin(self, job, now_s, wall_s)
        self._may_send(job, now_s)

    return [(Desk, "_begin", hasty)]


def key_without_machine() -> Names:
    """The mirror remembers its topics by the names of the signals alone."""
    remembered: dict[tuple[str, ...], tuple[str, ...]] = {}
    topics = processors.mirror._topics

    def hasty(machine: str, names: tuple[str, ...]) -> tuple[str, ...]:
        return remembered.setdefault(names, topics(machine, names))

    return [(processors.mirror, "_topics", hasty)]


def no_gate() -> Names:
    """Whatever can be decoded is let in, and whatever is to be sent is sent."""
    names: Names = [(Sendable, "takes", lambda self, message: True)]
    return names + [(Gate, name, let_in) for name, let_in in OPEN_GATE.items()]


OPEN_GATE: dict[str, Any] = {
    "node_fault": lambda self, node: None,
    "device_fault": lambda self, device: None,
    "birth_fault": lambda self, message, size: None,
    "believes": lambda self, stamp_ms: True,
    "trim": lambda self, message, size: None,
}

DEFECTS: dict[str, Callable[[], Names]] = {
    "receipts-before-sync": receipts_before_sync,
    "no-receipts": list,  # edges forget what only the broker has; `options_of`
    "claim-unseen": claim_unseen,
    "key-without-machine": key_without_machine,
    "no-gate": no_gate,
}


def options_of(defect: str | None) -> dict[str, Any]:
    """Return the options of a plant that has a defect."""
    return {"await_receipt": False} if defect == "no-receipts" else {}


@contextmanager
def put_in(defect: str | None) -> Iterator[None]:
    """Have our code do something wrong for a while."""
    names = [] if defect is None else DEFECTS[defect]()
    before = [(owner, name, owner.__dict__[name] if name in vars(owner) else None) for owner, name, _ in names]
    for owner, name, value in names:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in before:
            if value is None:
                delattr(owner, name)
            else:
                setattr(owner, name, value)
