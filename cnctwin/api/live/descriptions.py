"""The descriptions of machines, as the broker tells them: what each machine is, live and as a challenger."""

import logging
from typing import ClassVar

from processors.description import Description, Role, machine_and_role, read_message
from twin.errors import MachineError
from twin.vocabulary import topics

MACHINES_MAX = 5000
_log = logging.getLogger(__name__)


class LiveDescriptions:
    """Kept up to date by one thread; others may read."""

    filters: ClassVar[tuple[str, ...]] = tuple(f"{topics.DESCRIPTION}+/{role}" for role in Role)

    def __init__(self) -> None:
        self._known: dict[tuple[str, Role], Description] = {}

    def take(self, topic: str, payload: bytes) -> None:
        """Take a message; one that is no description changes nothing."""
        key = machine_and_role(topic)
        if key is None:
            return
        if not payload:
            self._known.pop(key, None)
            return
        if key not in self._known and len(self._known) >= MACHINES_MAX:
            _log.warning("more than %d descriptions; that of %s is not taken up", MACHINES_MAX, key[0])
            return
        try:
            self._known[key] = read_message(payload, key[0]).description(key[0])
        except MachineError as error:
            _log.warning("the %s description of %s is not taken up: %s", key[1], key[0], error)

    def of(self, machine: str, role: Role = Role.LIVE) -> Description | None:
        """Return the description of a machine in a role; None where it has none."""
        return self._known.get((machine, role))
