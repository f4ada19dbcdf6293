"""The notifications of a kill run: each came once or is said to have failed, and nothing is resolved that did not fire."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.kafka.webhook import Received
from processors.alerts.outbox import DELIVERED, FAILED


@dataclass(slots=True)
class Notices:
    """The judgement."""

    emitted: int = 0
    delivered: int = 0
    failed: int = 0
    failed_yet_came: int = 0
    doubled: int = 0
    lost: int = 0
    unknown: int = 0
    firing: int = 0
    resolved: int = 0
    disordered: int = 0
    first: str = ""

    @property
    def faults(self) -> int:
        """The number of notifications that are not as they should be."""
        return self.doubled + self.lost + self.unknown + self.disordered


def judged(emitted: Collection[str], received: Sequence[Received], fates: Mapping[str, str]) -> Notices:
    """Return the judgement. `emitted`: ids that stand in the results; `fates`: what the courier has said, on the broker."""
    came = Counter(one.id for one in received)
    found = Notices(len(emitted))
    for key in emitted:
        fate = fates.get(key)
        if fate == FAILED:
            found.failed += 1
            found.failed_yet_came += key in came
        elif key not in came:
            found.lost += 1
            found.first = found.first or f"{key} never came, and is {fate or 'of no fate'}"
        elif fate == DELIVERED:
            found.delivered += 1
    found.doubled = sum(count - 1 for count in came.values())
    found.unknown = len(came.keys() - set(emitted))
    _pairs(found, received, has_failures=found.failed > found.failed_yet_came)
    return found


def _pairs(found: Notices, received: Sequence[Received], *, has_failures: bool) -> None:
    """Judge the order: of each alert an episode fires, then it is resolved, then comes the next one."""
    last: dict[str, tuple[str, str]] = {}
    for _, alerts in received:
        for fingerprint, begin, status in alerts:
            before = last.get(fingerprint)
            if before == (begin, status):
                continue  # it stands in a notification of another alert's news
            last[fingerprint] = begin, status
            found.firing += status == "firing"
            found.resolved += status == "resolved"
            is_new = before is None or before[0] < begin
            if is_new and status == "firing":
                continue
            if not is_new and before == (begin, "firing"):
                continue  # resolved
            if is_new and has_failures:
                continue  # the notification that it fires failed, and was reported so
            found.disordered += 1
            found.first = found.first or f"{fingerprint}: {status} of {begin} after {before}"
