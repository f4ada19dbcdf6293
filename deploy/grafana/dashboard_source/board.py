"""The content of a dashboard, without a word of how a store is asked or how Grafana draws it."""

from dataclasses import dataclass
from enum import Enum

from twin.vocabulary.twin_signals import TWIN_PREFIX

RAW, DERIVED = "cnc_raw", "cnc_twin_state"
MINUTE_S, HOUR_S, DAY_S = 60, 3600, 86_400
HOLD_S = 10 * MINUTE_S
"""Seconds for which a value that is not told again is drawn on: signals are told when they change."""


class Shown(Enum):
    """The choice of the sample that is drawn for all those between two points of the screen.

    LAST: the last one; of a signal that says when it changes, what is true at that moment
    PEAK: the largest one: no spike is lost by zooming out
    """

    LAST = "last"
    PEAK = "max"


class Draw(Enum):
    """The drawing of a series: a line, a broken line, points, or a grey area behind the others (of a signal that is 0 or 1)."""

    LINE = "line"
    BROKEN = "broken"
    STEP = "step"
    SHADE = "shade"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Series:
    """The common part of all series: legend ({} takes the machine's or signal's name where there are several), own axis, unit."""

    legend: str
    unit: str = ""
    right: bool = False
    draw: Draw = Draw.LINE


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading(_Series):
    """A signal of the store.

    signal: its name; with `many`, a regular expression for several
    fleet: of every machine, one line each; else of the machine chosen
    quality: not the value but how good it is: 0 good, 1 stale, 2 bad
    """

    signal: str
    many: bool = False
    fleet: bool = False
    shown: Shown = Shown.LAST
    hold_s: int = HOLD_S
    quality: bool = False

    @property
    def measurement(self) -> str:
        """Raw or derived."""
        return DERIVED if self.signal.startswith(TWIN_PREFIX) else RAW

    @property
    def told_apart_by(self) -> str:
        """The tag that its lines differ by."""
        return "signal" if self.many else "machine"


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric(_Series):
    """A metric that the runtime interface shows at /metrics: an expression in PromQL. Legends are `{{label}}`."""

    expression: str


class View(Enum):
    """The kind of a panel, as Grafana calls it."""

    LINES = "timeseries"
    STATES = "state-timeline"
    FIGURE = "stat"
    TABLE = "table"


@dataclass(frozen=True, slots=True)
class Limit:
    """The value from which on a colour is used."""

    at: float | None
    colour: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """A panel: `says` is its description, in the corner; `words` names numbers; width in 24ths."""

    title: str
    says: str
    series: tuple[Reading | Metric, ...]
    view: View = View.LINES
    unit: str = ""
    words: tuple[tuple[float, str, str], ...] = ()
    limits: tuple[Limit, ...] = ()
    width: int = 12
    height: int = 8
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A mark in all panels of a dashboard: a moment for each change of a signal, or a stretch while it is not 0."""

    name: str
    signal: str
    colour: str
    stretch: bool = False
    hold_s: int = DAY_S

    @property
    def measurement(self) -> str:
        """Raw or derived."""
        return DERIVED if self.signal.startswith(TWIN_PREFIX) else RAW


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A dashboard. `chooses_machine`: its panels are of one machine, that a list at the top offers."""

    uid: str
    title: str
    says: str
    panels: tuple[Panel, ...]
    marks: tuple[Mark, ...] = ()
    chooses_machine: bool = True
    last: str = "now-1h"
    refresh: str = "5s"
    from_metrics: bool = False
