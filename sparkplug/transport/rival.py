"""Another connection with our client id, told by how sessions end: the broker knows one of a name, and ends the older one.

MQTT 5 says so (3.14.2.1, reason 0x8E). A broker of 3.1.1 only closes the connection, and Mosquitto 2.0.11 does no more with MQTT
5, so there it is told by sessions that are cut short again and again: two of a name throw each other out for as long as both go
on.
"""

from typing import Any

from sparkplug.transport.itinerary import STABLE_S

SESSION_TAKEN_OVER = 0x8E
CUT_SHORT_MAX = 3  # sessions in a row


class Rival:
    """Watches the sessions of one client id. Times are those of time.monotonic."""

    def __init__(self, client_id: str) -> None:
        self._client_id = client_id
        self._began_s = 0.0
        self._cut_short = 0

    def began(self, now_s: float) -> None:
        """The broker has accepted a session."""
        self._began_s = now_s

    def ended(self, now_s: float, reason: Any) -> str:
        """Return why the broker has ended the session, with the way out where another one has our name."""
        self._cut_short = self._cut_short + 1 if now_s - self._began_s < STABLE_S else 0
        if reason.value == SESSION_TAKEN_OVER:
            return f"another one runs, which has taken over the session of {self._client_id}; end one of the two"
        if self._cut_short >= CUT_SHORT_MAX:
            return f"{reason}, session after session: another one seems to run as {self._client_id}; end one of the two"
        return str(reason)
