"""The world as the loop of a machine sees it: the folder, the standing gap, the state of the work, and a person's request."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cnctwin.loop.request import Request
from cnctwin.loop.standing import Standing
from cnctwin.machines.evidence import Card, Shadow


@dataclass(frozen=True, slots=True)
class Finding:
    """The finding of a diagnosis. is_better: the corrected description is worth filing; else `text` says why it is not.

    toml: that description; programs: as it plans them; next_experiment: what would tell more
    """

    is_better: bool
    text: str
    toml: str = ""
    card: Card = field(default_factory=Card)
    next_experiment: Mapping[str, Any] | None = None
    programs: Mapping[str, Sequence[float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Work:
    """The state of the step's work. progress: 0 to 1, None = not known; is_done: composing is through

    failed: why nothing will come of it; finding: of a diagnosis
    """

    doing: str = ""
    progress: float | None = None
    is_done: bool = False
    failed: str = ""
    finding: Finding | None = None


NO_WORK, NOTHING_HEARD = Work(), Standing()


@dataclass(frozen=True, slots=True)
class World:
    """See the module.

    now_ms: the clock on the wall; at_ms: the machine's own, as far as it is known
    live, challenger: versions, empty = there is none; card, live_card: the evidence for each
    live_since_ms, live_said: since when the live one is live, on the wall, and how that came
    is_first: nothing else was ever live
    fault: why the live file cannot be used
    healthy_until_ms: end of the time in which somebody has stated that the machine is healthy, 0 where nobody has
    """

    machine: str
    now_ms: int
    at_ms: int
    live: str
    challenger: str = ""
    card: Card | None = None
    live_card: Card | None = None
    live_since_ms: int = 0
    live_said: str = ""
    is_first: bool = False
    fault: str = ""
    healthy_until_ms: int = 0
    standing: Standing = NOTHING_HEARD
    work: Work = NO_WORK
    request: Request | None = None


@dataclass(frozen=True, slots=True)
class File:
    """Have the corrected description wait as the challenger."""

    finding: Finding


@dataclass(frozen=True, slots=True)
class Promote:
    """Make a version live."""

    version: str
    by: str
    why: str
    shadow: Shadow | None = None


@dataclass(frozen=True, slots=True)
class Back:
    """Let a live version go."""

    version: str
    by: str
    why: str


@dataclass(frozen=True, slots=True)
class Withdraw:
    """Take a challenger away."""

    version: str
    by: str
    why: str


Deed = File | Promote | Back | Withdraw
"""A change to the folder; one that is made twice is made once."""
