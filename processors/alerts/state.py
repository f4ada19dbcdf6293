"""The state of the alerts processor: alerts, who was told what, what waits in the outbox, silences, commands.

Two clocks: `wall_s` is UTC as the last beat told it, for what people read and for silences and quiet hours; `clock_s` counts the
same seconds but never goes back, for every interval, so that a clock that is set changes no dwell and no repeat.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from hashlib import sha256

from processors.alerts.facts import Facts
from processors.lag_report import LagReport

ALERTS_MAX = 5000
OUTBOX_MAX = 1000
SETTLED_MAX = 5000
SILENCES_MAX = 200
OUTCOMES_MAX = 50
FAILURES_MAX = 50


class Phase(StrEnum):
    """The phase of an alert. One that never fired and does not pend has no record."""

    PENDING = "pending"
    FIRING = "firing"
    ACKNOWLEDGED = "acknowledged"
    RESOLVED = "resolved"


class Severity(StrEnum):
    """The severity of an alert, from the least."""

    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"

    @property
    def rank(self) -> int:
        """0, 1, 2."""
        return _RANKS[self]


_RANKS = {severity: rank for rank, severity in enumerate(Severity)}


@dataclass(frozen=True, slots=True)
class Alert:
    """One kind of alarm of one machine.

    episode: its start in event time, ms since 1970: what tells one firing from the next, also after a crash
    held_s, clear_s: how long the alarm was seen while pending; how long it is gone while firing (None: it stands)
    clear_ms: when it went, in event time
    unknown: why the alarm cannot be read now; the phase is kept meanwhile
    earlier: start and end (ms) of the last episode that fired, while another pends
    fired_s: when this episode fired, by clock_s
    rises_s: when it last fired, or would have but for being kept firing; empty where it never has
    severities: all that this episode had
    facts: what was known of the alarm and of the machine when the episode began
    """

    machine: str
    name: str
    signal: str
    fingerprint: str
    severity: Severity
    episode: int
    phase: Phase = Phase.PENDING
    since_wall_s: float = 0.0
    held_s: float = 0.0
    clear_s: float | None = None
    clear_ms: int = 0
    unknown: str = ""
    unknown_s: float = 0.0
    ended_ms: int = 0
    earlier: tuple[int, int] = (0, 0)
    resolved_s: float = 0.0
    fired_s: float = 0.0
    rises_s: tuple[float, ...] = ()
    severities: tuple[Severity, ...] = ()
    acknowledged_by: str = ""
    comment: str = ""
    facts: Facts = field(default_factory=dict)
    undelivered: bool = False

    @property
    def is_on(self) -> bool:
        """True while it fires, acknowledged or not."""
        return self.phase in (Phase.FIRING, Phase.ACKNOWLEDGED)


@dataclass(frozen=True, slots=True)
class LastNotice:
    """The last notice that a receiver got of an alert; `count`: how often in this episode."""

    episode: int
    severity: Severity
    is_firing: bool
    at_s: float
    count: int


@dataclass(frozen=True, slots=True)
class Group:
    """Alerts that are told together: since when there is news, when they were last told, whether the rate limit holds them, and
    how often they were told again within their interval."""

    waiting_s: float | None = None
    sent_s: float | None = None
    is_held: bool = False
    in_a_row: int = 0


@dataclass(frozen=True, slots=True)
class ReceiverState:
    """One receiver and how it fares. `recent_s` and `recent_high_s`: notifications of the last hour, by clock_s; `not_taken`: why
    the one that is being tried again was not taken; "" where none is."""

    told: dict[str, LastNotice] = field(default_factory=dict)
    groups: dict[str, Group] = field(default_factory=dict)
    recent_s: tuple[float, ...] = ()
    recent_high_s: tuple[float, ...] = ()
    is_muted: bool = False
    held_back: int = 0
    held_back_unsaid: int = 0
    delivered: int = 0
    failed: int = 0
    last_error: str = ""
    not_taken: str = ""
    last_delivered_wall_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Item:
    """One notification in the outbox, as it is published; says = what it tells of which episode."""

    id: str
    receiver: str
    kind: str
    says: tuple[str, ...]
    payload: str
    created_s: float
    emitted_s: float
    expires_s: float


@dataclass(frozen=True, slots=True)
class Settled:
    """A notification whose fate is known; it is cleared from the broker a while later."""

    receiver: str
    outcome: str
    reason: str
    at_s: float


@dataclass(frozen=True, slots=True)
class Failure:
    """A notification that was not delivered, or may not have been: said, not hidden."""

    id: str
    receiver: str
    reason: str
    wall_s: float
    says: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Silence:
    """Alerts whose labels match are not told from start to end (UTC)."""

    id: str
    matchers: dict[str, str]
    starts_s: float
    ends_s: float
    by: str
    comment: str


@dataclass(frozen=True, slots=True)
class CommandOutcome:
    """The outcome of a command."""

    id: str
    command: str
    by: str
    is_done: bool
    text: str
    wall_s: float


@dataclass(frozen=True, slots=True)
class HeardLag:
    """A processor's report of its lag, and when it was heard (UTC)."""

    heard_s: float
    report: LagReport


@dataclass(frozen=True, slots=True)
class AlertsState:
    """All of it."""

    wall_s: float = 0.0
    clock_s: float = 0.0
    machines: dict[str, float] = field(default_factory=dict)  # UTC when last seen online
    deaths: dict[str, int] = field(default_factory=dict)  # event time of the last death, ms
    pulses: dict[str, int] = field(default_factory=dict)  # alarms that stood for a moment since the last beat
    lags: dict[str, HeardLag] = field(default_factory=dict)  # by processor, of those that are behind
    alerts: dict[str, Alert] = field(default_factory=dict)
    receivers: dict[str, ReceiverState] = field(default_factory=dict)
    outbox: dict[str, Item] = field(default_factory=dict)
    settled: dict[str, Settled] = field(default_factory=dict)
    failures: tuple[Failure, ...] = ()
    silences: tuple[Silence, ...] = ()
    outcomes: tuple[CommandOutcome, ...] = ()
    malformed: int = 0
    overflowed: int = 0
    heartbeat_slot: int = 0
    shown: dict[str, str] = field(default_factory=dict)  # what was last published of each machine
    published: str = ""  # hash of the state that was last published
    published_s: float = 0.0


def fingerprint(labels: dict[str, str]) -> str:
    """Return the identity of an alert: its labels without the severity, which may rise.

    >>> fingerprint({"alertname": "rule_vibration", "machine": "okuma"})
    'ea33a6c7165f5dfa'
    """
    text = "".join(f"{name}\xff{labels[name]}\xff" for name in sorted(labels))
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]


def labels_of(machine: str, name: str, signal: str, extra: dict[str, str]) -> dict[str, str]:
    """The labels that identify an alert."""
    own = {"alertname": name, "machine": machine}
    return {**extra, **own, "signal": signal} if signal else {**extra, **own}
