"""The descriptions of machines, as the broker tells them: what each machine is, live and as a challenger, and what is wrong."""

import logging
from dataclasses import dataclass
from typing import ClassVar

from pydantic import BaseModel, ConfigDict, ValidationError

from processors.description import Description, DescriptionMessage, Role, machine_and_role, read_message
from twin.errors import MachineError
from twin.vocabulary import topics

MACHINES_MAX = 5000
FAULTS_MAX = 5000
FAULT = "fault"
_log = logging.getLogger(__name__)


class Fault(BaseModel):
    """A fault of a machine's files, or of a description that a processor cannot take up. t: since when, ms since 1970."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    t: int = 0
    text: str = ""


@dataclass(frozen=True, slots=True)
class Known:
    """A description as it was read, and the message that it came in."""

    message: DescriptionMessage
    description: Description


class LiveDescriptions:
    """Kept up to date by one thread; others may read. `filters`: the topics to listen to."""

    filters: ClassVar[tuple[str, ...]] = (f"{topics.DESCRIPTION}#",)

    def __init__(self) -> None:
        self._known: dict[tuple[str, Role], Known] = {}
        self._faults: dict[str, Fault] = {}

    def take(self, topic: str, payload: bytes) -> None:
        """Take a message; one that is no description changes nothing."""
        key = machine_and_role(topic)
        if key is None:
            self._take_fault(topic, payload)
        elif not payload:
            self._known.pop(key, None)
        elif key not in self._known and len(self._known) >= MACHINES_MAX:
            _log.warning("more than %d descriptions; that of %s is not taken up", MACHINES_MAX, key[0])
        else:
            try:
                message = read_message(payload, key[0])
                self._known[key] = Known(message, message.description(key[0]))
            except MachineError as error:
                _log.warning("the %s description of %s is not taken up: %s", key[1], key[0], error)

    def of(self, machine: str, role: Role = Role.LIVE) -> Description | None:
        """Return the description of a machine in a role; None where it has none."""
        known = self._known.get((machine, role))
        return None if known is None else known.description

    def known(self, role: Role) -> dict[str, Known]:
        """Return the descriptions in a role, by machine in alphabetical order."""
        return {machine: known for (machine, own), known in sorted(self._known.items()) if own is role}

    def faults(self) -> tuple[tuple[str, Fault], ...]:
        """Return the faults that stand, each with its machine, in alphabetical order."""
        return tuple((machine_of_fault(topic), fault) for topic, fault in sorted(self._faults.items()))

    def _take_fault(self, topic: str, payload: bytes) -> None:
        if not machine_of_fault(topic):
            return
        try:
            fault = Fault.model_validate_json(payload) if payload else Fault()
        except ValidationError:
            _log.warning("%s: this is no fault of a description; it is passed over", topic[:200])
            return
        if not fault.text:
            self._faults.pop(topic, None)
        elif topic in self._faults or len(self._faults) < FAULTS_MAX:
            self._faults[topic] = fault


def machine_of_fault(topic: str) -> str:
    """Return the machine whose fault a topic carries; "" for another topic.

    >>> machine_of_fault("cnctwin/description/vmc/fault"), machine_of_fault("cnctwin/description/vmc/fault/thermal/live")
    ('vmc', 'vmc')
    >>> machine_of_fault("cnctwin/description/vmc/live")
    ''
    """
    machine, _, rest = topic.removeprefix(topics.DESCRIPTION).partition("/")
    return machine if topic.startswith(topics.DESCRIPTION) and rest.partition("/")[0] == FAULT else ""
