"""The notifications of a kill run: each came once or is said to have failed, and nothing is resolved that did not fire.

A body shows some of the alerts of a notification and leaves the others out (`truncatedAlerts`). What it says of those stands in
the statements of the notification (`says` in the log), so an alert that is seen resolved without having been seen firing passes
only where the very firing stands in a notification that came before it, was left out there, and is among as many as its body
says.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.kafka.webhook import Received
from processors.alerts.body import iso
from processors.alerts.outbox import DELIVERED, FAILED
from processors.alerts.statement import PASSED, RINGING, Statement

Episode = tuple[str, str]
"""Fingerprint of an alert, and when it began, as a body writes it."""
Emitted = Mapping[str, Sequence[Statement]]
"""The notifications that stand in the log: their statements by id."""


@dataclass(slots=True)
class Notices:
    """The judgement.

    left_out: alerts that bodies did not show
    unseen: alerts that passed as resolved though no body showed them firing, since the firing was left out or failed
    passed: alerts that were over before anybody was told
    """

    emitted: int = 0
    delivered: int = 0
    failed: int = 0
    failed_yet_came: int = 0
    doubled: int = 0
    lost: int = 0
    unknown: int = 0
    firing: int = 0
    resolved: int = 0
    left_out: int = 0
    unseen: int = 0
    passed: int = 0
    disordered: int = 0
    first: str = ""

    @property
    def faults(self) -> int:
        """The number of notifications that are not as they should be."""
        return self.doubled + self.lost + self.unknown + self.disordered


def judged(emitted: Emitted, received: Sequence[Received], fates: Mapping[str, str]) -> Notices:
    """Return the judgement. `emitted`: what stands in the results; `fates`: what the courier has said, on the broker."""
    came = Counter(one.id for one in received)
    found = Notices(len(emitted))
    never: set[Episode] = set()
    for key, statements in emitted.items():
        fate = fates.get(key)
        if fate == FAILED:
            found.failed += 1
            found.failed_yet_came += key in came
            if key not in came:
                never.update(_of(statements, RINGING))
        elif key not in came:
            found.lost += 1
            found.first = found.first or f"{key} never came, and is {fate or 'of no fate'}"
        elif fate == DELIVERED:
            found.delivered += 1
    found.doubled = sum(count - 1 for count in came.values())
    found.unknown = len(came.keys() - emitted.keys())
    _pairs(found, emitted, received, never)
    return found


def _of(statements: Sequence[Statement], whats: Sequence[str]) -> Iterator[Episode]:
    return ((one.fingerprint, iso(one.episode)) for one in statements if one.what in whats)


def _pairs(found: Notices, emitted: Emitted, received: Sequence[Received], never: set[Episode]) -> None:
    """Judge the order: of each alert an episode fires, then it is resolved, then comes the next one. `never`: the firings of
    notifications that failed."""
    last: dict[str, tuple[str, str]] = {}
    unseen, passed = set(never), set[Episode]()
    for one in received:
        statements = emitted.get(one.id, ())
        passed.update(_of(statements, (PASSED,)))
        for fingerprint, begin, status in one.alerts:
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
            if is_new and (fingerprint, begin) in passed:
                found.passed += 1
                continue
            if is_new and (fingerprint, begin) in unseen:
                found.unseen += 1
                continue
            found.disordered += 1
            found.first = found.first or f"{fingerprint}: {status} of {begin} after {before}"
        shown = {(fingerprint, begin) for fingerprint, begin, _ in one.alerts}
        left_out = [episode for episode in _of(statements, RINGING) if episode not in shown]
        unseen.update(left_out[: one.left_out])  # a body that leaves out more than it says passes for no more than it says
        found.left_out += one.left_out
