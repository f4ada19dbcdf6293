"""Return codes of FOCAS, and what is done about each.

The names and numbers are those of the library's public header (EW_…). A code above 0 is the control's answer to one function,
one below 0 comes from the way to it.

>>> policy_of(-16), policy_of(-1), policy_of(6), policy_of(5), policy_of(0)
(<Policy.RECONNECT: 'reconnect'>, <Policy.RETRY: 'retry'>, <Policy.GIVE_UP: 'give up'>, <Policy.BAD: 'bad'>, <Policy.OK: 'ok'>)
>>> told(6)
'EW_NOOPT (6): the control does not have the option for this function'
"""

from enum import Enum
from typing import NamedTuple

OK = 0
HANDLE, NODLL, SOCKET, PROTOCOL = -8, -15, -16, -17
FUNC, LENGTH, NUMBER, DATA, NOOPT = 1, 2, 3, 5, 6


class Policy(Enum):
    """The consequence of a code. A control that hangs counts as SOCKET, once its time is over."""

    OK = "ok"
    RECONNECT = "reconnect"  # the handle is dropped, and made again after a while that grows
    RETRY = "retry"  # asked again at the next look, the value stays; for long, it is bad
    GIVE_UP = "give up"  # not asked again of this control; said once
    BAD = "bad"  # a null with the code as its reason; asked again at the next look


class _Code(NamedTuple):
    name: str
    policy: Policy
    meaning: str


_CODES = {
    0: _Code("EW_OK", Policy.OK, "done"),
    -17: _Code("EW_PROTOCOL", Policy.RECONNECT, "an answer that is not in the protocol"),
    -16: _Code("EW_SOCKET", Policy.RECONNECT, "no answer, or the connection is gone"),
    -15: _Code("EW_NODLL", Policy.BAD, "the library, or the one for this series beside it, cannot be loaded"),
    -11: _Code("EW_BUS", Policy.BAD, "bus error"),
    -10: _Code("EW_SYSTEM2", Policy.BAD, "error in the control's system"),
    -9: _Code("EW_HSSB", Policy.BAD, "error of the high-speed serial bus"),
    -8: _Code("EW_HANDLE", Policy.RECONNECT, "the handle is not valid, or no session is free"),
    -7: _Code("EW_VERSION", Policy.BAD, "the library does not fit the control's software"),
    -6: _Code("EW_UNEXP", Policy.BAD, "unexpected error"),
    -5: _Code("EW_SYSTEM", Policy.BAD, "error in the control's system"),
    -4: _Code("EW_PARITY", Policy.BAD, "parity error in shared memory"),
    -3: _Code("EW_MMCSYS", Policy.BAD, "the extended driver is missing"),
    -2: _Code("EW_RESET", Policy.RETRY, "a reset or stop came in between"),
    -1: _Code("EW_BUSY", Policy.RETRY, "the control is busy"),
    1: _Code("EW_FUNC", Policy.GIVE_UP, "the control does not have this function"),
    2: _Code("EW_LENGTH", Policy.BAD, "wrong length of data"),
    3: _Code("EW_NUMBER", Policy.BAD, "no such number"),
    4: _Code("EW_ATTRIB", Policy.BAD, "wrong attribute"),
    5: _Code("EW_DATA", Policy.BAD, "wrong data"),
    6: _Code("EW_NOOPT", Policy.GIVE_UP, "the control does not have the option for this function"),
    7: _Code("EW_PROT", Policy.BAD, "protected"),
    8: _Code("EW_OVRFLOW", Policy.BAD, "memory overflow"),
    9: _Code("EW_PARAM", Policy.BAD, "wrong parameter of the control"),
    10: _Code("EW_BUFFER", Policy.BAD, "buffer empty or full"),
    11: _Code("EW_PATH", Policy.BAD, "no such path"),
    12: _Code("EW_MODE", Policy.BAD, "not in this mode"),
    13: _Code("EW_REJECT", Policy.BAD, "rejected by the control"),
    14: _Code("EW_DTSRVR", Policy.BAD, "error of the data server"),
    15: _Code("EW_ALARM", Policy.BAD, "not while there is an alarm"),
    16: _Code("EW_STOP", Policy.BAD, "not while the control is stopped"),
    17: _Code("EW_PASSWD", Policy.BAD, "a password protects it"),
}
CODES = tuple(_CODES)


def policy_of(code: int) -> Policy:
    """Return what follows from this code; of one that is not known, that the value cannot be used."""
    return _CODES[code].policy if code in _CODES else Policy.BAD


def name_of(code: int) -> str:
    """The code's name, for messages."""
    return _CODES[code].name if code in _CODES else "EW_?"


def told(code: int) -> str:
    """The code as a reason: name, number, and what it means."""
    meaning = _CODES[code].meaning if code in _CODES else "a code that is not known"
    return f"{name_of(code)} ({code}): {meaning}"
