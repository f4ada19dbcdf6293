"""The state of `production` for one machine: everything that the next sample needs, of bounded size."""

from dataclasses import dataclass, field

from processors.events.processor import State as Runs
from processors.production.doing import NO_DATA, Kind
from processors.production.tally import Tally


@dataclass(frozen=True, slots=True)
class Energy:
    """The energy of a run while it lasts. kwh: of known_s seconds in which the power was known; seconds: of all"""

    kwh: float = 0.0
    known_s: float = 0.0
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class LastPart:
    """The part that ended last, until the next one: its record as far as it is known, and what was said of its quality."""

    id: str
    program: str | None
    shift: str | None
    shift_begin: int
    begin: int
    end: int
    complete: bool
    ideal_s: float | None
    active_s: float
    interrupted_s: float
    unknown_s: float
    energy_kwh: float | None
    is_good: bool | None = None

    @property
    def quality(self) -> str | None:
        """The quality in a word; None where nothing was said of it."""
        return None if self.is_good is None else "good" if self.is_good else "scrap"


@dataclass(frozen=True, slots=True)
class Pending:
    """Time that is not in the tally yet: spent in one way, in one slot of the calendar, which ends at until_s."""

    until_s: float = 0.0
    is_planned: bool = False
    seconds: float = 0.0
    kwh: float = 0.0
    known_s: float = 0.0


@dataclass(frozen=True, slots=True)
class State:
    """See the module.

    runs: of the processor `events`; at_s: up to when time is added up; kind, reason: what the machine does since, is_new where
    that begins here; kw: power of the spindle as of at_s; is_blind: what comes after at_s was not seen
    told_s: when the figures were last published
    """

    runs: Runs = field(default_factory=Runs)
    at_s: float | None = None
    kind: Kind = Kind.UNKNOWN
    reason: str = NO_DATA
    is_new: bool = True
    kw: float | None = None
    is_blind: bool = False
    tally: Tally | None = None
    pending: Pending = field(default_factory=Pending)
    energy: Energy = field(default_factory=Energy)
    part: LastPart | None = None
    told_s: float = 0.0

    def having(self, at_s: float, kw: float | None, pending: Pending) -> "State":
        """Return the state with these. Spelled out, since `replace` looks up each field, and there is one a second."""
        return State(
            self.runs, at_s, self.kind, self.reason, self.is_new, kw, self.is_blind,
            self.tally, pending, self.energy, self.part, self.told_s,
        )  # fmt: skip

    def with_runs(self, runs: Runs, is_blind: bool) -> "State":
        """Return the state with these; spelled out as `having`."""
        return State(
            runs, self.at_s, self.kind, self.reason, self.is_new, self.kw, is_blind,
            self.tally, self.pending, self.energy, self.part, self.told_s,
        )  # fmt: skip
