"""The outcome of the demo's loop, as the loop tells it on the broker: what was hidden, what was named, how far the gap closed."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cnctwin.files.sealed import SealError, read_sealed
from sparkplug.host import EventKind, HostEvent
from twin.vocabulary.topics import LOOP

CLOSED_FLOORS_MAX = 1.3
"""A standing gap of so many floors is closed: a healthy machine differs by one from itself."""
SHADOW, PROMOTED = "shadow", "promoted"


@dataclass(frozen=True, slots=True)
class LoopOutcome:
    """The loop of a demo. What did not come before its end is None, or empty.

    effect, on: what was hidden; named, not_told_from: effects of the description that was promoted, or waits
    gap_before, gap_after: standing gap in floors before the promotion, and after it; seconds: from the start to the closed gap
    """

    effect: str | None = None
    on: str | None = None
    named: tuple[str, ...] = ()
    not_told_from: tuple[str, ...] = ()
    gap_before: float | None = None
    gap_after: float | None = None
    promoted: bool = False
    seconds: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return asdict(self)


class LoopWatch:
    """Follows the loop of a machine. started_s: monotonic time at which the demo has begun"""

    def __init__(self, machine: str, started_s: float) -> None:
        self._topic, self._started_s = LOOP + machine, started_s
        self._causes: Sequence[Mapping[str, Any]] = ()
        self._found = LoopOutcome()
        self.text = ""

    def see(self, events: Sequence[HostEvent]) -> None:
        """Take the next events of the broker."""
        for event in events:
            if event.kind is EventKind.PLAIN and event.topic == self._topic and event.payload:
                self.take(json.loads(event.payload), time.monotonic())

    def take(self, document: Mapping[str, Any], now_s: float) -> None:
        """Take what the loop tells at a moment."""
        self.text = str(document.get("text", ""))
        if challenger := document.get("challenger"):
            self._causes = challenger.get("causes") or ()
        last = document.get("last") or {}
        if not last:
            self._found = LoopOutcome()  # nothing was promoted, or it was taken back
        if document.get("step") != PROMOTED:
            return
        before, after = last.get("before"), last.get("after")
        seconds = self._found.seconds
        if seconds is None and after is not None and after <= CLOSED_FLOORS_MAX:
            seconds = round(now_s - self._started_s, 1)
        self._found = LoopOutcome(gap_before=before, gap_after=after, promoted=True, seconds=seconds)

    def outcome(self, sealed: Path) -> LoopOutcome:
        """Return what came of it; the file in which the machine has sealed its effect is opened here, at the end."""
        found = self._found
        try:
            added = json.loads(read_sealed(sealed).text)["added"]
        except SealError:
            added = {"effect": None, "on": None}
        others = [one for cause in self._causes for one in cause.get("indistinguishable_from") or ()]
        return LoopOutcome(
            effect=added["effect"],
            on=added["on"],
            named=_names(self._causes),
            not_told_from=_names(others),
            gap_before=found.gap_before,
            gap_after=found.gap_after,
            promoted=found.promoted,
            seconds=found.seconds,
        )


def _names(effects: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(one["effect"]) for one in effects))
