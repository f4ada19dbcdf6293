"""The plan of what is asked when: at each look, in a slow and in a rare interval, and what the control has refused for good."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from edge.controls.focas.calls import OFFSET_KINDS, Answer, Call, FocasValue, Request, keys_of
from edge.controls.focas.config import Backend, FocasConfig, Group, LifeUnit, ToolSource
from edge.controls.focas.pmc import PmcAddress, pmc_address
from edge.controls.focas.policy import Policy, policy_of
from edge.sweep import Fact, Plain

G_GROUPS = ("0", "1", "2")
OFFSET_MAX = 9999
LOOKS_BUSY_MAX = 25  # a value that the control is too busy to give for so many looks is not known any more


@dataclass(frozen=True, slots=True)
class Signals:
    """The PMC addresses that FANUC's interface defines; those of path 2 are 1000 further on, and so on.

    strobe: F7.0, MF, on while an M code is worked on; code: F10 to F13, the M code
    feed: G12, the feed override in negative logic; rapid: G14.0 and .1; spindle: G30, the spindle override in %
    """

    strobe: str
    code: str
    feed: str
    rapid: str
    spindle: str

    @classmethod
    def of(cls, path: int) -> "Signals":
        """Those of one path.

        >>> Signals.of(2).feed
        'G1012'
        """
        on = 1000 * (path - 1)
        return cls(f"F{7 + on}", f"F{10 + on}:4", f"G{12 + on}", f"G{14 + on}", f"G{30 + on}")


def change_bit(config: FocasConfig) -> PmcAddress | None:
    """The bit of the machine's builder that is on during a tool change, where it is configured."""
    return pmc_address(config.tool_change_pmc) if config.tool_change_pmc else None


def quick(config: FocasConfig) -> tuple[Request, ...]:
    """Return what each look asks. What belongs to a tool change comes first, to be of one moment."""
    groups, signals, bit = config.groups, Signals.of(config.path), change_bit(config)
    requests = [Request(Call.STATUS), Request(Call.DYNAMIC)]
    if Group.MODAL in groups:
        requests += [Request(Call.MODAL), Request(Call.PMC, signals.strobe), Request(Call.PMC, signals.code)]
    if config.backend is Backend.LIBRARY and config.tool_number in (ToolSource.AUTO, ToolSource.TOOLNUM):
        requests.append(Request(Call.TOOL))
    if bit is not None:
        requests.append(Request(Call.PMC, bit.byte_name))
    if config.tool_number_pmc:
        requests.append(Request(Call.PMC, config.tool_number_pmc))
    if Group.OVERRIDES in groups:
        requests += [Request(Call.PMC, address) for address in (signals.feed, signals.rapid, signals.spindle)]
    if Group.BLOCK in groups:
        requests.append(Request(Call.BLOCK))
    if Group.LOADS in groups:
        requests += [Request(Call.SPINDLE_LOAD), Request(Call.SERVO_LOAD)]
    return tuple(dict.fromkeys(requests))


def slow(config: FocasConfig, chosen: Iterable[Request] = ()) -> tuple[Request, ...]:
    """Return what a slow look asks besides; `chosen` are the variables and PMC addresses of the configuration."""
    requests = [Request(Call.PROGRAM)]
    if Group.ALARMS in config.groups:
        requests.append(Request(Call.ALARMS))
    if Group.MODAL in config.groups:
        requests += [Request(Call.G_CODE, group) for group in G_GROUPS]
    if Group.MESSAGES in config.groups:
        requests.append(Request(Call.MESSAGE))
    return tuple(dict.fromkeys((*requests, *chosen)))


class Subject(NamedTuple):
    """The tool, its offsets and the program that the rare requests are about: numbers, None where they are not known."""

    tool: int | None = None
    length_offset: int | None = None
    radius_offset: int | None = None
    program: int | None = None

    @classmethod
    def after(cls, before: "Subject", found: Iterable[FocasValue]) -> "Subject":
        """Return the subject that a look has shown; what it did not tell is as before.

        >>> Subject.after(Subject(tool=3), [FocasValue("modal.H", 7.0)])
        Subject(tool=3, length_offset=7, radius_offset=None, program=None)
        """
        told = {_SUBJECT[one.key]: _number(one.value) for one in found if one.key in _SUBJECT}
        return before._replace(**told)


_SUBJECT = {"modal.T": "tool", "modal.H": "length_offset", "modal.D": "radius_offset", "program.number": "program"}
NO_OFFSET = "no offset is in force: {} 0"
UNREAD = "unread."  # before the signal, in the key of a fact that this configuration cannot ask for
BY_LIBRARY = 'only by FANUC\'s own library: set focas.backend = "library" and focas.library (docs/how-to/edge-focas.md)'
BY_UNIT = 'FOCAS does not tell the unit: set focas.tool_life_unit = "minutes" or "uses" (docs/how-to/edge-focas.md)'
_LIFE_SIGNALS = ("tool_life_used_min", "tool_life_limit_min", "tool_life_used_count", "tool_life_limit_count")


def _number(value: Plain) -> int | None:
    is_whole = isinstance(value, int | float) and not isinstance(value, bool) and value == int(value) and 0 <= value < 10**8
    return int(value) if is_whole and isinstance(value, int | float) else None


def rare(config: FocasConfig, subject: Subject, is_lathe: bool) -> tuple[Request, ...]:
    """Return what changes with the tool or the program, or hardly ever. A lathe's offsets are of its axes, and are not read."""
    requests = list[Request]()
    if Group.OFFSET in config.groups and not is_lathe:
        requests += [
            Request(Call.OFFSET, f"{kind} {number}")
            for kind, number, _ in _offsets(subject)
            if number is not None and 0 < number <= OFFSET_MAX
        ]
    if Group.COMMENT in config.groups and subject.program:
        requests.append(Request(Call.COMMENT, str(subject.program)))
    if config.backend is Backend.LIBRARY:
        requests += [Request(Call.LIFE)] if config.tool_life_unit else []
        requests += [Request(Call.HISTORY)] if Group.HISTORY in config.groups else []
    return tuple(requests)


def unread(config: FocasConfig) -> tuple[Fact, ...]:
    """Return the facts of signals that cannot be read as the control is asked, each with the way out as its fault.

    >>> [fact.key for fact in unread(FocasConfig(groups=frozenset({Group.HISTORY})))][:2]
    ['unread.alarm_history', 'unread.tool_life_used_min']
    """
    is_library = config.backend is Backend.LIBRARY
    history = () if is_library or Group.HISTORY not in config.groups else ("alarm_history",)
    life = _LIFE_SIGNALS if config.tool_life_unit is LifeUnit.UNKNOWN else ()
    return tuple(Fact(UNREAD + signal, None, BY_UNIT if is_library else BY_LIBRARY) for signal in (*history, *life))


def without_offset(config: FocasConfig, subject: Subject, is_lathe: bool) -> tuple[Fact, ...]:
    """Return the facts of offsets that are not asked for because H or D is 0."""
    if Group.OFFSET not in config.groups or is_lathe:
        return ()
    none = [(kind, letter) for kind, number, letter in _offsets(subject) if number == 0]
    return tuple(Fact(f"offset.{kind}", None, NO_OFFSET.format(letter)) for kind, letter in none)


def _offsets(subject: Subject) -> tuple[tuple[str, int | None, str], ...]:
    length, radius = (subject.length_offset, "H"), (subject.radius_offset, "D")
    return tuple((kind, *(length if kind.startswith("length") else radius)) for kind in OFFSET_KINDS)


@dataclass(slots=True)
class Refusals:
    """Requests that this control has refused for good, or was too busy for. Forgotten with the handle: options can be bought."""

    given_up: dict[str, int] = field(default_factory=dict)
    busy: dict[str, int] = field(default_factory=dict)

    def asked(self, requests: Iterable[Request], axes: Sequence[str]) -> tuple[Request, ...]:
        """The requests that can still give something."""
        return tuple(
            request
            for request in requests
            if request.name not in self.given_up and not all(key in self.given_up for key in keys_of(request, axes))
        )

    def judge(self, request: Request, answer: Answer, axes: Sequence[str]) -> tuple[FocasValue, ...]:
        """The facts of an answer that are to be told: values, and refusals the first time."""
        if answer.code == 0:
            found = answer.found
        else:
            found = tuple(FocasValue(key, None, answer.code) for key in keys_of(request, axes))
            if policy_of(answer.code) is Policy.GIVE_UP:
                self.given_up[request.name] = answer.code
        return tuple(one for one in found if self._is_told(one))

    def _is_told(self, one: FocasValue) -> bool:
        policy = policy_of(one.code)
        if policy is Policy.RETRY:
            self.busy[one.key] = self.busy.get(one.key, 0) + 1
            return self.busy[one.key] >= LOOKS_BUSY_MAX
        self.busy.pop(one.key, None)
        if policy is not Policy.GIVE_UP:
            return True
        is_new = one.key not in self.given_up
        self.given_up[one.key] = one.code
        return is_new
