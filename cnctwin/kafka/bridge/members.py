"""The runners and bridges of a plant, by what they report of themselves: who lives, and sums of their counts that never fall."""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from cnctwin.kafka.counted import MACHINES, without_gauges
from cnctwin.kafka.report import BridgeReport, Report, RunnerReport, parsed
from twin.vocabulary.node_ledger import BUFFERED, RECEIVED

GONE_S = 10.0  # who says nothing for so long counts as silent
FORGOTTEN_S = 86_400.0  # who has been silent for so long is spoken of no more
MEMBERS_MAX = 1000
NAMED_MAX = 5  # silent ones are named up to here
_OF_RUNNERS = (
    "records", "transactions", "transactions_aborted", "rebalances", "lost_by_retention", "repeated", "dead_letters", "faults",
)  # fmt: skip
_OF_BRIDGES = ("events", "delivered", "dropped")
_log = logging.getLogger(__name__)


class Rising:
    """Counts of members that come, go and begin again at 0, summed so that the sum never falls.

    >>> sums = Rising()
    >>> for member, count in (("a", 5), ("b", 7), ("a", 1), ("b", 8)):  # a was started again
    ...     sums.take(member, {"records": count})
    >>> sums.leave("b")
    >>> sums.total["records"]
    14
    """

    def __init__(self) -> None:
        self._last: dict[str, Counter[str]] = {}
        self._gone: Counter[str] = Counter()

    def take(self, member: str, counts: Mapping[str, int]) -> None:
        """Take what a member counts by now."""
        last = self._last.get(member, Counter())
        if any(counts.get(name, 0) < count for name, count in last.items() if name not in (BUFFERED, MACHINES)):
            self.leave(member)
        self._last[member] = Counter(counts)

    def leave(self, member: str) -> None:
        """Keep what a member has counted so far, which is gone."""
        last = self._last.pop(member, Counter())
        if RECEIVED in last:
            without_gauges(last)
        self._gone.update(last)

    @property
    def total(self) -> Counter[str]:
        """The sums over all members, those that have gone too."""
        return sum(self._last.values(), Counter(self._gone))


class Members:
    """See the module. `publishable`: the metrics of a processor's node that a ledger may fill; a report may say more."""

    def __init__(self, publishable: Iterable[str]) -> None:
        self._publishable = frozenset(publishable)
        self._reports: dict[str, Report] = {}
        self._heard_ms: dict[str, int] = {}  # by our own clock, once a member was heard twice
        self._counts: dict[str, Rising] = {}  # of each processor: those of its runners
        self._ledgers: dict[str, Rising] = {}
        self._of_bridges = Rising()

    def hear(self, name: str, payload: bytes | None, at_ms: int) -> None:
        """Take a member's report; None: it has left. The first one may have lain there for long; its second one is new."""
        if payload is None:
            self._leave(name)
            return
        try:
            report = parsed(payload)
        except ValueError as error:
            _log.warning("the health of %.60s cannot be read: %.300s", name, error)
            return
        if name not in self._reports and len(self._reports) >= MEMBERS_MAX:
            self._leave(min(self._heard_ms, key=self._heard_ms.__getitem__))
        before = self._reports.get(name)
        if before is None:
            self._heard_ms[name] = min(report.t, at_ms)
        elif before.t != report.t:
            self._heard_ms[name] = at_ms
        self._reports[name] = report
        if isinstance(report, BridgeReport):
            self._of_bridges.take(name, {key: getattr(report, key) for key in _OF_BRIDGES})
            return
        for processor in report.processors:
            self._counts.setdefault(processor, Rising()).take(name, {key: getattr(report, key) for key in _OF_RUNNERS})
            ledger = {key: count for key, count in report.ledgers.get(processor, {}).items() if key in self._publishable}
            self._ledgers.setdefault(processor, Rising()).take(name, ledger)

    def _leave(self, name: str) -> None:
        self._reports.pop(name, None)
        self._heard_ms.pop(name, None)
        self._of_bridges.leave(name)
        for sums in (*self._counts.values(), *self._ledgers.values()):
            sums.leave(name)

    def of_bridges(self, at_ms: int) -> dict[str, Any]:
        """Return the metrics of all bridges."""
        alive, silent = self._alive(at_ms, lambda one: isinstance(one, BridgeReport))
        bridges = [one for one in alive.values() if isinstance(one, BridgeReport)]
        total = self._of_bridges.total
        return {
            "bridges": len(bridges),
            "bridges_silent": len(silent),
            **{f"bridge_{key}": total[key] for key in _OF_BRIDGES},
            "bridge_waiting": sum(one.waiting for one in bridges),
            "bridge_busy_pct": max((one.busy_pct for one in bridges), default=0.0),
        }

    def of_processor(self, processor: str, at_ms: int) -> dict[str, Any]:
        """Return the metrics of a processor's runners, and who is silent of them and of the bridges."""
        alive, silent = self._alive(at_ms, lambda one: isinstance(one, RunnerReport) and processor in one.processors)
        runners = [one for one in alive.values() if isinstance(one, RunnerReport)]
        bridges = self._alive(at_ms, lambda one: isinstance(one, BridgeReport))[1]
        ledger = self._ledgers.get(processor, Rising()).total
        counts = self._counts.get(processor, Rising()).total
        lag_s = max((one.lag_s for one in runners), default=0.0)
        missing = sorted([*silent, *bridges])
        return {
            **ledger,
            **{key: counts[key] for key in _OF_RUNNERS},
            MACHINES: sum(one.ledgers.get(processor, {}).get(MACHINES, 0) for one in runners),
            "process": f"kafka: {'+'.join(sorted({name for one in runners for name in one.processors}) or [processor])}",
            "processors": max((len(one.processors) for one in runners), default=0),
            "lag_s": lag_s,
            "published_lag_s": lag_s,
            "busy_pct": max((one.busy_pct for one in runners), default=0.0),
            "runners": len(runners),
            "runners_silent": len(silent),
            "silent": ", ".join(missing[:NAMED_MAX]) + (", …" if len(missing) > NAMED_MAX else ""),
            "partitions": sum(one.partitions for one in runners),
            "lag_records": sum(one.lag_records for one in runners),
            "restored_s": max((one.restored_s for one in runners), default=0.0),
            "fault": next((one.fault for one in runners if one.fault), ""),
        }

    def _alive(self, at_ms: int, is_meant: Callable[[Report], bool]) -> tuple[dict[str, Report], list[str]]:
        """Return those that report, and the names of those that have ended without a word."""
        meant = {name: one for name, one in self._reports.items() if is_meant(one)}
        silent_s = {name: (at_ms - self._heard_ms[name]) / 1000 for name in meant}
        alive = {name: one for name, one in meant.items() if silent_s[name] < GONE_S}
        return alive, [name for name in meant if GONE_S <= silent_s[name] < FORGOTTEN_S]
