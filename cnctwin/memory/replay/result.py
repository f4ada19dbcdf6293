"""The result of a replay: by processor and metric, with the first place where it differs."""

from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.errors import ApplicationError
from cnctwin.memory.descriptions import Described
from sparkplug.values import Value

DIFFERENCES_MAX = 100  # that are listed; all are counted


class ReplayRefusedError(ApplicationError):
    """This stretch cannot be replayed; the text says why, and what can."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value that is not the same. `published` or `recomputed` None with `what` missing or extra: there was none."""

    processor: str
    signal: str
    t: int
    what: str  # differing, missing (published then, not recomputed), extra (recomputed, not published then)
    published: Value
    recomputed: Value


@dataclass(frozen=True, slots=True)
class MetricCompared:
    """One metric: how many values are the same bit for bit, with their time, quality and reason; and what is not.

    unheard: recomputed, but the log did not hear the processor then; the birth that followed told the last of them
    """

    signal: str
    same: int = 0
    differing: int = 0
    missing: int = 0
    extra: int = 0
    unheard: int = 0
    largest: float | None = None  # difference of two numbers
    first: Difference | None = None


@dataclass(frozen=True, slots=True)
class ProcessorReplayed:
    """One processor. start: where its state came from; recomputed: values that it gives now; notes: what stands in the way of an
    exact answer."""

    name: str
    start: str
    recomputed: int
    metrics: tuple[MetricCompared, ...]
    restarts: int
    dead_letters: int
    sha256: str
    notes: tuple[str, ...]

    @property
    def totals(self) -> tuple[int, int, int, int]:
        """Same, differing, missing, extra."""
        return (
            sum(one.same for one in self.metrics),
            sum(one.differing for one in self.metrics),
            sum(one.missing for one in self.metrics),
            sum(one.extra for one in self.metrics),
        )


@dataclass(frozen=True, slots=True)
class Replayed:
    """A replay of one machine. sha256: over every value that was recomputed, in order; two replays have the same.

    descriptions: those that held when it began, and those that came within it
    """

    machine: str
    from_ms: int
    to_ms: int
    chain: bool
    processors: tuple[ProcessorReplayed, ...]
    differences: tuple[Difference, ...]
    descriptions: tuple[Described, ...]
    messages: int
    samples: int
    seconds: float
    sha256: str

    @property
    def is_equal(self) -> bool:
        """True if every value came out as it was published then, and none more or less."""
        return all(sum(processor.totals[1:]) == 0 for processor in self.processors)

    @property
    def compared(self) -> int:
        """Values that were published then, or recomputed now."""
        return sum(sum(processor.totals) for processor in self.processors)

    @property
    def speed(self) -> float:
        """The factor by which it was faster than the day itself."""
        return (self.to_ms - self.from_ms) / 1000 / self.seconds if self.seconds > 0.0 else 0.0

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return {
            "machine": self.machine,
            "from": self.from_ms,
            "to": self.to_ms,
            "chain": self.chain,
            "equal": self.is_equal,
            "compared": self.compared,
            "differences": [asdict(one) for one in self.differences],
            "descriptions": [_of_description(one) for one in self.descriptions],
            "messages": self.messages,
            "samples": self.samples,
            "seconds": round(self.seconds, 3),
            "speed": round(self.speed, 1),
            "sha256": self.sha256,
            "processors": [_of_processor(one) for one in self.processors],
        }


def _of_description(one: Described) -> dict[str, Any]:
    how = {} if one.message is None else one.message.model_dump(exclude={"version", "toml", "t"})
    return {"t": one.received_ms, "role": str(one.role), "version": one.version, **how}


def _of_processor(one: ProcessorReplayed) -> dict[str, Any]:
    same, differing, missing, extra = one.totals
    return {
        "name": one.name,
        "start": one.start,
        "recomputed": one.recomputed,
        "same": same,
        "differing": differing,
        "missing": missing,
        "extra": extra,
        "unheard": sum(metric.unheard for metric in one.metrics),
        "restarts": one.restarts,
        "dead_letters": one.dead_letters,
        "sha256": one.sha256,
        "notes": list(one.notes),
        "metrics": [asdict(metric) for metric in one.metrics],
    }
