"""The lag that processors report, and the sentence that doctor, page and alert have for it.

The node of a processor has it as metrics (`health/lag_s`, …). While the processor is behind it also publishes a report on a plain
topic, `cnctwin/lag/<processor>`, once a second, not retained, and once more when it has caught up.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from pydantic import Field, TypeAdapter

from twin.vocabulary.topics import LAG

BEHIND_S = 5.0
"""From here on a process is called behind."""
SPOKEN_OF_S = 1.0
"""From here on a processor says its lag on the plain topic."""
BUSY_PCT = 70.0
"""Below this a process that is behind does not lack a core of its own, but the time on it."""
TEXT_MAX = 4000
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Count = Annotated[int, Field(ge=0, le=2**62)]
_Amount = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False)]


class Remedy(Enum):
    """The way out for a process that is behind: more cores, one more runner, or time on the core that it has."""

    CORE = "core"
    RUNNER = "runner"
    ELSEWHERE = "elsewhere"


@dataclass(frozen=True, slots=True)
class LagReport:
    """The lag of processors that share a process; what they report of it is the same.

    at_ms: when it was reported, UTC
    process: any text that is the same for processors of one process, and for no others
    runners, partitions, waiting: of processors that are folded on a log, the runners that share them, the partitions that these
        have, and the records that wait; 0 runners: one process folds it all
    """

    processors: Annotated[tuple[_Name, ...], Field(max_length=100)]
    process: _Name
    at_ms: Annotated[int, Field(ge=0, le=10**16)]
    lag_s: _Amount
    machines: Annotated[int, Field(ge=0, le=10**9)]
    busy_pct: _Amount
    runners: _Count = 0
    partitions: _Count = 0
    waiting: _Count = 0

    @property
    def load(self) -> str:
        """The work that they have to do, and the means for it.

        >>> LagReport(("thermal",), "kafka: thermal", 0, 18.2, 20, 98.0, 2, 12, 40_213).load
        '20 machines, 40213 records wait, 2 runners with 12 partitions, the busiest 98 % busy'
        """
        machines = _counted(self.machines, "machine")
        if not self.runners:
            return f"{machines}, one core, {self.busy_pct:.0f} % busy"
        waiting = f"{self.waiting} {'record waits' if self.waiting == 1 else 'records wait'}"
        runners = f"{_counted(self.runners, 'runner')} with {_counted(self.partitions, 'partition')}"
        return f"{machines}, {waiting}, {runners}, the busiest {self.busy_pct:.0f} % busy"

    @property
    def remedy(self) -> Remedy:
        """The way out."""
        if self.busy_pct < BUSY_PCT:
            return Remedy.ELSEWHERE
        return Remedy.RUNNER if self.runners else Remedy.CORE

    @property
    def sentence(self) -> str:
        """The line for people.

        >>> LagReport(("thermal", "mirror"), "hall-3:4711", 0, 18.2, 20, 104.8).sentence
        'processors are 18 s behind: 20 machines, one core, 105 % busy; `cnctwin plan fleet` says what it takes (mirror, thermal)'
        """
        elsewhere = "the log" if self.runners else "the broker"
        way_out = {
            Remedy.ELSEWHERE: f"that is less than a core: look at what else runs there, and at {elsewhere}",
            Remedy.RUNNER: "start one more with the same processors (no more of them than partitions)",
            Remedy.CORE: "`cnctwin plan fleet` says what it takes",
        }[self.remedy]
        return f"processors are {self.lag_s:.0f} s behind: {self.load}; {way_out} ({', '.join(sorted(self.processors))})"

    def payload(self) -> bytes:
        """The report as JSON."""
        return _ADAPTER.dump_json(self)


_ADAPTER = TypeAdapter(LagReport)


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def parsed(text: str) -> LagReport:
    """Return the report in a payload. Raises ValueError where there is none."""
    if len(text) > TEXT_MAX:
        raise ValueError(f"more than {TEXT_MAX} characters")
    try:
        return _ADAPTER.validate_python(json.loads(text))
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def topic_of(processor: str) -> str:
    """Return the topic on which a processor says its lag."""
    return f"{LAG}{processor}"


def by_process(reports: Iterable[LagReport]) -> list[LagReport]:
    """Return one report for each process, with all its processors; the furthest behind comes first."""
    shared: dict[str, list[LagReport]] = {}
    for report in reports:
        shared.setdefault(report.process, []).append(report)
    merged = [
        LagReport(
            processors=tuple(sorted({name for one in group for name in one.processors})),
            process=process,
            at_ms=max(one.at_ms for one in group),
            lag_s=max(one.lag_s for one in group),
            machines=max(one.machines for one in group),
            busy_pct=max(one.busy_pct for one in group),
            runners=max(one.runners for one in group),
            partitions=max(one.partitions for one in group),
            waiting=max(one.waiting for one in group),
        )
        for process, group in shared.items()
    ]
    return sorted(merged, key=lambda one: (-one.lag_s, one.processors))
