"""The description of a machine: what `machines/<name>.toml` says, and which of it nobody has stated.

It travels on the broker as a retained message, so that every process takes it up at the same place in the order of messages, and
a replay knows which one was live when. A machine has one that is live, and at most one challenger, which runs beside it.

    cnctwin/description/<machine>/live          {"version": …, "toml": …, "t": …, "by": …, "why": …}
    cnctwin/description/<machine>/challenger    the same; empty where there is none
"""

import hashlib
import json
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.effects.added import check_effects
from twin.errors import EffectError, MachineError
from twin.machine import MachineFile, machine_from_toml
from twin.vocabulary import topics

VERSION_DIGITS = 12


class Role(StrEnum):
    """The part that a description plays."""

    LIVE = "live"
    CHALLENGER = "challenger"


Programs = dict[str, tuple[float, ...]]
"""Key of a program (twin/vocabulary/program_names.py) → the seconds of each of its sections between tool changes, by the twin."""


@dataclass(frozen=True, slots=True)
class Description:
    """A machine as it is described.

    version: the first digits of the SHA-256 of the file's text
    programs: of this version, as far as somebody has planned them (`cnctwin twin programs`)
    """

    machine: MachineFile
    version: str
    programs: Programs = field(default_factory=dict)

    @property
    def edition(self) -> str:
        """Return the version, and that of the planned programs where there are any."""
        return edition_of(self.version, self.programs)

    @property
    def assumed(self) -> tuple[str, ...]:
        """The sections and constants that nobody has stated or fitted, as the file says: `thermal`, `spindle.efficiency`."""
        return self.machine.machine.assumed

    @classmethod
    def from_toml(cls, text: str, source: str = "machine.toml") -> Self:
        """Return the description that a file's text is, its effects checked. Raises MachineError."""
        machine = machine_from_toml(text, source)
        try:
            check_effects(machine)
        except EffectError as error:
            raise MachineError(f"{source}: {error}") from None
        return cls(machine, version_of(text))


class Given(NamedTuple):
    """The means that a step is given for a machine, and the version of its description; "" where nobody has described it."""

    version: str
    given: Any


class DescriptionMessage(BaseModel):
    """The payload of a description on the broker.

    t: when it became live, or a challenger, ms since 1970; step: how (promoted, back, filed, described); by: who made it so;
    why: in words
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    version: str
    toml: str
    t: int = 0
    step: str = ""
    by: str = ""
    why: str = Field(default="", max_length=2000)
    programs: Programs = Field(default_factory=dict)

    @property
    def edition(self) -> str:
        """Return the version, and that of the planned programs where there are any."""
        return edition_of(self.version, self.programs)

    def payload(self) -> bytes:
        """Return the message as it is sent."""
        return json.dumps(self.model_dump(), ensure_ascii=False, sort_keys=True).encode()

    def description(self, machine: str) -> Description:
        """Return what it describes. Raises MachineError."""
        return replace(Description.from_toml(self.toml, f"machines/{machine}.toml"), programs=self.programs)


def version_of(text: str) -> str:
    """Return the version of a file by its text.

    >>> version_of("[machine]")
    '65e5121911d1'
    """
    return hashlib.sha256(text.encode()).hexdigest()[:VERSION_DIGITS]


def in_words(version: str) -> str:
    """Return the words by which the basis of a figure names a description.

    >>> in_words("3f2a9c01d5e7")
    'description 3f2a9c01d5e7'
    """
    return f"description {version}"


def edition_of(version: str, programs: Programs) -> str:
    """Return a version, and that of the planned programs where there are any.

    >>> edition_of("65e5121911d1", {}), edition_of("65e5121911d1", {"o1701": (31.8, 11.1)})
    ('65e5121911d1', '65e5121911d1+af339d674746')
    """
    return f"{version}+{version_of(json.dumps(programs, sort_keys=True))}" if programs else version


def topic_of(machine: str, role: Role) -> str:
    """Return the topic of a machine's description in a role.

    >>> topic_of("vmc", Role.LIVE)
    'cnctwin/description/vmc/live'
    """
    return f"{topics.DESCRIPTION}{machine}/{role}"


def machine_and_role(topic: str) -> tuple[str, Role] | None:
    """Return whose description a topic carries, and in which role; None for another topic.

    >>> machine_and_role("cnctwin/description/vmc/live"), machine_and_role("cnc/vmc/spindle_rpm")
    (('vmc', <Role.LIVE: 'live'>), None)
    """
    machine, _, role = topic.removeprefix(topics.DESCRIPTION).rpartition("/")
    if not topic.startswith(topics.DESCRIPTION) or not machine or "/" in machine or role not in tuple(Role):
        return None
    return machine, Role(role)


def read_message(payload: bytes, machine: str) -> DescriptionMessage:
    """Return the message of a payload. Raises MachineError where it is none."""
    try:
        return DescriptionMessage.model_validate_json(payload)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise MachineError(f"description of {machine}: {'.'.join(map(str, first['loc'])) or 'message'}: {first['msg']}") from None
