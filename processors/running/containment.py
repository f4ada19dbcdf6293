"""The reach of a fault: a message, a machine, or the processor. Faults go in, verdicts come out; the clock is an argument.

    a message fails                            it is dropped, and nothing else
    FAULTS_MAX of a machine within WITHIN_S    the machine is set aside, and taken up again with a fresh state after a pause
    something fails that is no machine's,      the processor goes down, and is started again after a pause
    or most of its machines are set aside

A pause is a second, doubles each time, up to ten minutes, and is a second again after a time without a fault that is twice as
long as the last pause and no shorter than WITHIN_S. A processor is never given up.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum

FAULTS_MAX = 3
WITHIN_S = 60.0
PAUSE_S_MIN = 1.0
PAUSE_S_MAX = 600.0
CULPRITS_MAX = 5000  # machines, or nodes and topics, whose faults are remembered
NODES_MIN = 3  # a few machines of one sender are that sender's fault
TEXT_MAX = 200


class Reach(Enum):
    """The reach of a fault."""

    MESSAGE = "message"
    MACHINE = "machine"
    PROCESSOR = "processor"


@dataclass(slots=True)
class _Pauses:
    """The pauses of a machine, or of the processor."""

    until_s: float = 0.0
    length_s: float = 0.0

    def begin(self, now_s: float) -> float:
        """Begin the next pause; return its length."""
        forgotten = now_s - self.until_s > max(2 * self.length_s, WITHIN_S)
        self.length_s = PAUSE_S_MIN if forgotten or not self.length_s else min(2 * self.length_s, PAUSE_S_MAX)
        self.until_s = now_s + self.length_s
        return self.length_s


@dataclass(slots=True)
class _Culprit:
    """A machine whose messages fail. `node`: whose messages they are; empty where that is not known."""

    node: str
    faults_s: deque[float] = field(default_factory=lambda: deque(maxlen=FAULTS_MAX))
    pauses: _Pauses = field(default_factory=_Pauses)


class Containment:
    """The faults of one processor."""

    def __init__(self) -> None:
        self.faults = 0
        self.restarts = 0
        self.text = ""  # the last fault, in one line
        self.aside: dict[str, float] = {}  # machines that are set aside, and until when
        self._culprits: dict[str, _Culprit] = {}
        self._pauses = _Pauses()

    def failed(self, name: str, node: str, error: Exception, now_s: float, *, machines: int = 0) -> Reach:
        """Note that a message of a machine could not be handled, and judge. `machines`: how many others are online."""
        culprit = self._culprits.pop(name, None) or _Culprit(node)
        self._culprits[name] = culprit  # the latest at the end
        if len(self._culprits) > CULPRITS_MAX:
            self._forget(next(iter(self._culprits)))
        culprit.faults_s.append(now_s)
        if len(culprit.faults_s) < FAULTS_MAX or now_s - culprit.faults_s[0] > WITHIN_S:
            self._note(f"a message of {shown(name)} failed", error)
            return Reach.MESSAGE
        culprit.faults_s.clear()
        pause_s = culprit.pauses.begin(now_s)
        self.aside[name] = culprit.pauses.until_s
        self._note(f"{shown(name)} is set aside for {pause_s:g} s", error)
        nodes = {known.node for known in map(self._culprits.get, self.aside) if known is not None and known.node}
        is_most = len(nodes) >= NODES_MIN and len(self.aside) > machines
        return Reach.PROCESSOR if is_most else Reach.MACHINE

    def down(self, what: str, error: Exception, now_s: float) -> float:
        """Note that the processor goes down; return when it is to be started again."""
        self.restarts += 1
        self.aside.clear()
        pause_s = self._pauses.begin(now_s)
        self._note(f"{what} failed; restarted after {pause_s:g} s, {self.restarts} times so far", error)
        return self._pauses.until_s

    @property
    def is_at_the_longest_pause(self) -> bool:
        """True if it has failed again and again until its pause could grow no longer."""
        return self._pauses.length_s >= PAUSE_S_MAX

    def taken_up(self, now_s: float) -> list[str]:
        """The machines whose pause is over; they are not set aside any more."""
        over = [name for name, until_s in self.aside.items() if now_s >= until_s]
        for name in over:
            del self.aside[name]
        return over

    def _forget(self, name: str) -> None:
        del self._culprits[name]
        self.aside.pop(name, None)

    def _note(self, what: str, error: Exception) -> None:
        self.faults += 1
        self.text = f"{what}: {one_line(error)}"


def one_line(error: Exception) -> str:
    """Return an exception for people: in one printable line of bounded length.

    >>> one_line(ValueError("a" + chr(10) + "b"))
    'ValueError: a b'
    """
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return "".join(character if character.isprintable() else "?" for character in text[:TEXT_MAX])


def shown(name: str) -> str:
    """Return a name that a sender chose, for people.

    >>> shown("okuma"), shown("%" * 30_000)
    ('okuma', '%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%…')
    """
    short = name if len(name) <= 40 else f"{name[:40]}…"
    return "".join(character if character.isprintable() else "?" for character in short)
