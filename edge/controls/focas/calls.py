"""The calls to a FANUC control, by the names of its functions, and the shape of what it answers: the interface of both backends.

A call answers with values (`FocasValue`), each with a return code of its own: a control without the option for spindle loads
still gives its servo loads.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol

from edge.alarm_list import ListedAlarm, alarms_text
from edge.sweep import Plain


class Call(StrEnum):
    """The functions that are used. All of them read."""

    STATUS = "cnc_statinfo"
    DYNAMIC = "cnc_rddynamic2"
    SERVO_LOAD = "cnc_rdsvmeter"
    SPINDLE_LOAD = "cnc_rdspmeter"
    BLOCK = "cnc_rdexecprog"
    MODAL = "cnc_modal"
    TOOL = "cnc_toolnum"
    PMC = "pmc_rdpmcrng"
    PROGRAM = "cnc_exeprgname"
    ALARMS = "cnc_rdalmmsg2"
    G_CODE = "cnc_rdgcode"
    OFFSET = "cnc_rdtofs"
    CLOCK = "cnc_gettimer"
    MESSAGE = "cnc_rdopmsg"
    MACRO = "cnc_rdmacro"
    COMMENT = "cnc_rdprogdir3"
    LIFE = "cnc_rdlife"
    HISTORY = "cnc_rdalmhistry"


STATUS_WORDS = ("aut", "run", "motion", "mstb", "emergency", "alarm", "edit")
MODAL_WORDS = {"M": 106, "S": 107, "T": 108, "F": 103, "H": 104, "D": 101}  # the number of the modal datum in cnc_modal
OFFSET_KINDS = {"radius_wear": 0, "radius": 1, "length_wear": 2, "length": 3}  # of a machining centre, in cnc_rdtofs
LIFE_WORDS = ("used", "limit")
CLOCK_WORDS = ("year", "month", "day", "hour", "minute", "second")


class Request(NamedTuple):
    """One call. `argument`: a PMC address, a G group, kind and number of an offset, the number of a variable or a program."""

    call: Call
    argument: str = ""

    @property
    def name(self) -> str:
        """The name in messages, by which a refusal is remembered too."""
        return f"{self.call} {self.argument}".rstrip()


class FocasValue(NamedTuple):
    """One value, or the code that came in its place."""

    key: str
    value: Plain = None
    code: int = 0


class Identity(NamedTuple):
    """The control's description of itself. `mt_type`: M a machining centre, T a lathe; axes by name, in their order."""

    cnc_type: str = ""
    mt_type: str = ""
    series: str = ""
    version: str = ""
    axes: tuple[str, ...] = ()


class Opened(NamedTuple):
    """The answer to opening: a handle or none, and whose."""

    code: int
    identity: Identity = Identity()
    why: str = ""


class Answer(NamedTuple):
    """The result of one request. `code` other than 0: nothing was found."""

    code: int
    found: tuple[FocasValue, ...] = ()


class FocasBackend(Protocol):
    """One way to a control. No call blocks for longer than its timeout; `close` may come from any thread."""

    def open(self) -> Opened:
        """Make a handle, and ask who is there."""

    def ask(self, requests: Sequence[Request]) -> tuple[Answer, ...]:
        """The answers, in the order of the requests. One with RECONNECT in it means that the handle is gone."""

    def close(self) -> None:
        """Free the handle. `open` may follow."""


def keys_of(request: Request, axes: Sequence[str]) -> tuple[str, ...]:
    """The facts that a call would give, for one that gave none.

    >>> keys_of(Request(Call.SERVO_LOAD), ("X", "Z"))
    ('servo_load.X', 'servo_load.Z')
    """
    match request.call:
        case Call.STATUS:
            return tuple(f"status.{word}" for word in STATUS_WORDS)
        case Call.DYNAMIC:
            plain = ("program.number", "program.main", "sequence", "feed", "spindle_rpm")
            return (*plain, *(f"position.{axis}" for axis in axes))
        case Call.SERVO_LOAD:
            return tuple(f"servo_load.{axis}" for axis in axes)
        case Call.MODAL:
            return tuple(f"modal.{word}" for word in MODAL_WORDS)
        case Call.PMC:
            return (f"pmc.{request.argument}",)
        case Call.G_CODE:
            return (f"modal.G{request.argument}",)
        case Call.OFFSET:
            return (f"offset.{request.argument.partition(' ')[0]}",)
        case Call.MACRO:
            return (f"macro.{request.argument}",)
        case Call.ALARMS:
            return ("alarms", "alarm_list")
        case Call.LIFE:
            return tuple(f"life.{word}" for word in LIFE_WORDS)
        case Call.CLOCK:
            return tuple(f"clock.{word}" for word in CLOCK_WORDS)
    return (_LONE[request.call],)


_LONE = {
    Call.SPINDLE_LOAD: "spindle_load",
    Call.BLOCK: "block",
    Call.TOOL: "tool",
    Call.PROGRAM: "program.name",
    Call.MESSAGE: "operator_message",
    Call.COMMENT: "program.comment",
    Call.HISTORY: "alarm_history",
}


ALARM_LETTERS = ("SW", "PW", "IO", "PS", "OT", "OH", "SV", "SR", "MC", "SP", "DS", "IE", "BG", "SN", "", "EX", "", "", "", "PC")


def alarm_code(kind: int, number: int) -> str:
    """An alarm's code as the control's screen shows it (series 30i and 0i-D to 0i-F; of older ones the letters may differ).

    >>> alarm_code(3, 10)
    'PS0010'
    """
    letters = ALARM_LETTERS[kind] if 0 <= kind < len(ALARM_LETTERS) else ""
    return f"{letters or f'type {kind} '}{number:04d}"


def alarm_values(alarms: Sequence[ListedAlarm]) -> tuple[FocasValue, FocasValue]:
    """Both facts of the active alarms: the text that a person reads, and the list."""
    texts = (f"{alarm.code} {alarm.text}".strip() for alarm in alarms)
    return FocasValue("alarms", "; ".join(texts)), FocasValue("alarm_list", alarms_text(alarms))
