"""One line of `says` in a notification: which episode of which alert it is about, and what is new.

    fingerprint.episode.what.told_before.severity

What a notification says is recognised by these lines after a crash; they make its id.
"""

from collections.abc import Iterable
from typing import NamedTuple

from processors.alerts.state import Severity

FIRING, RAISED, REPEAT, RESOLVED = "firing", "raised", "repeat", "resolved"
PASSED = "passed"  # it fired and was over before anybody was told
OVER = (RESOLVED, PASSED)
RINGING = (FIRING, RAISED, REPEAT)
_SEVERITIES = frozenset(severity.value for severity in Severity)


class Statement(NamedTuple):
    """One statement about one alert; told_before: how often the receiver had been told of this episode."""

    fingerprint: str
    episode: int
    what: str
    told_before: int
    severity: Severity

    @property
    def text(self) -> str:
        """The line.

        >>> Statement("ea33a6c7165f5dfa", 1795000000000, FIRING, 0, Severity.HIGH).text
        'ea33a6c7165f5dfa.1795000000000.firing.0.high'
        """
        return f"{self.fingerprint}.{self.episode}.{self.what}.{self.told_before}.{self.severity.value}"

    @classmethod
    def of(cls, text: str) -> "Statement | None":
        """Return the parts of a line; None where it is about no alert (a test, a heartbeat). Raises ValueError where a number is
        none."""
        parts = text.split(".")
        if len(parts) != 5 or parts[4] not in _SEVERITIES:
            return None
        return cls(parts[0], int(parts[1]), parts[2], int(parts[3]), Severity(parts[4]))


def statements_in(says: Iterable[str]) -> tuple[Statement, ...]:
    """Return those of the lines that are about an alert. Raises ValueError."""
    return tuple(filter(None, map(Statement.of, says)))
