"""The answer of the optimiser: the program rewritten, each line before and after, what binds, how far the optimum is."""

import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Objective(StrEnum):
    """The figure that is made small."""

    TIME = "time"
    COST = "cost"
    PARETO = "pareto"


class SpeedChanges(StrEnum):
    """The places between two lines where the spindle may change its speed (`twin.optimisation.speeds.groups`)."""

    ANYWHERE = "anywhere"
    IN_AIR = "in_air"
    """Never while the tool is in the material: what is cut without leaving it is cut at one speed."""
    PER_TOOL = "per_tool"
    """One speed for each tool number, throughout the program."""


class Binds(StrEnum):
    """The limit that keeps a line from being better."""

    FEED = "feed range"
    SPEED = "spindle speed range"
    FORCE = "cutting force"
    POWER = "spindle power"
    TORQUE = "spindle torque"
    CHIP = "chip thickness"
    SURFACE_SPEED = "surface speed"
    CHATTER = "chatter"
    TOOL_LIFE = "tool life"
    """Inside all limits: faster would cost more in tools than it saves."""
    SPEED_CHANGE = "a change of speed"
    """Another speed would be better for this line, but the spindle would take longer to change than it saves."""
    SHARED_SPEED = "a speed it shares"
    """Another speed would be better for this line, but not for all lines that have to have the same one."""
    DYNAMICS = "axis dynamics"
    """The line is too short to reach its feed."""
    RUN_UP = "spindle run-up"
    """The line waits for the spindle to reach its speed; a lower one is reached sooner."""


@dataclass(frozen=True, slots=True)
class Cutting:
    """A line as it is cut: the worst of its cut, over all times that it is executed.

    feed_mm_min as programmed; force_n: peak resultant; power_kw: electrical, greatest; torque_nm: mean over a turn, greatest
    chip_mm: greatest chip thickness; surface_speed_m_min
    seconds: on the line, all executions together; cost: of these seconds, None without [cost]
    """

    feed_mm_min: float
    spindle_rpm: float
    force_n: float
    power_kw: float
    torque_nm: float
    chip_mm: float
    surface_speed_m_min: float
    seconds: float
    cost: float | None


@dataclass(frozen=True, slots=True)
class LineAnswer:
    """One source line of the program that cuts or feeds (0-based `line`; people and controls count from 1).

    text_before, text_after: of the line; cut_mm: way in material, length_mm: way in all, of one execution; times: executions
    axial_depth_mm: greatest; binds: empty where nothing does, or where the line is left alone: `left_alone` then says why
    force_known: not where its end face cuts: force, power, torque and chip are then not those of the cut
    bound: feed, mm/min, and speed, rev/min, that would be best for this line if changes of speed were free and axes ideal
    """

    line: int
    text_before: str
    text_after: str
    length_mm: float
    cut_mm: float
    times: int
    axial_depth_mm: float
    before: Cutting
    after: Cutting
    binds: str
    bound: tuple[float, float] | None = None
    left_alone: str = ""
    force_known: bool = True


@dataclass(frozen=True, slots=True)
class Totals:
    """The figures of the whole program. cost: None without [cost]; over: lines above a limit, 0 = none."""

    seconds: float
    cost: float | None
    force_n: float
    power_kw: float
    torque_nm: float
    chip_mm: float
    over: int


@dataclass(frozen=True, slots=True)
class Bound:
    """No program within the limits is better than this.

    value: seconds, or cost; distance: relative, of the answer above it
    exact: the value is reached by a program (lines do not depend on each other); else it is a bound that none may reach
    how: a sentence
    """

    value: float
    distance: float
    exact: bool
    how: str


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """One program of the front: seconds, cost, greatest force, lowest and highest speed. chosen: it is written out."""

    seconds: float
    cost: float
    force_n: float
    spindle_rpm: tuple[float, float]
    chosen: bool = False


@dataclass(frozen=True, slots=True)
class Parted:
    """The share of one uncertain constant in the force: path as in [uncertainty], relative standard deviation, and by how many
    per cent the greatest force changes for one standard deviation."""

    path: str
    relative: float
    force_pct: float


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """The effect of the twin's uncertainty on the force limit.

    kept: probability that no line exceeds the limit, 0 to 1; asked: that which was asked for, None = planned with the constants
        as stated
    draws: on how many draws of the constants `kept` stands, other ones than those that the plan was made with
    force_low_n, force_high_n: 90 % interval of the greatest force
    price_pct: by how many per cent the objective is (or would be) worse if the limit is kept with `priced` instead of with the
        constants as stated
    parts: largest first; source: where the intervals come from, a sentence; identified: one of them was identified
    """

    kept: float
    asked: float | None
    draws: int
    force_low_n: float
    force_high_n: float
    priced: float
    price_pct: float
    parts: tuple[Parted, ...]
    source: str
    identified: bool = True

    @property
    def is_unsure(self) -> bool:
        """Return True where the limit is kept less surely than with `priced`, beyond what so many draws can tell."""
        off = math.sqrt(max(self.kept * (1.0 - self.kept), 0.0) / max(self.draws, 1))
        return self.kept + 2.0 * off < self.priced


@dataclass(frozen=True, slots=True)
class Search:
    """The course of the search. history: best objective (or hypervolume of the front) after each evolution."""

    method: str
    seed: int
    population: int
    evolutions: int
    evaluations: int
    history: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class Resimulated:
    """The rewritten program run on the whole simulated machine, servo loops included, beside the original.

    following_error_mm: axis → (before, after), peak; seconds, force_n: (before, after)
    """

    seconds: tuple[float, float]
    force_n: tuple[float, float]
    following_error_mm: dict[str, tuple[float, float]]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Optimised:
    """The answer. `program` is the whole text; `diff` unified; `sentence` says it in one.

    objective: as asked; currency: empty without [cost]; limits: name → figure with its unit, as they were kept
    collisions: lines (from 1) with a rapid into material, of the program as it came too
    speed_changes: as asked; changes_in_material: how often the speed changes in the material, counted on the program read again
    """

    name: str
    machine: str
    objective: Objective
    currency: str
    sentence: str
    limits: dict[str, str]
    before: Totals
    after: Totals
    bound: Bound
    lines: tuple[LineAnswer, ...]
    front: tuple[FrontPoint, ...]
    sensitivity: Sensitivity | None
    search: Search
    resimulated: Resimulated | None
    notes: tuple[str, ...]
    diff: str
    program: str
    collisions: tuple[int, ...] = ()
    speed_changes: SpeedChanges = SpeedChanges.ANYWHERE
    changes_in_material: int = 0

    def as_json(self) -> dict[str, Any]:
        """Everything but the program's text, for a program to read; infinities become null."""
        values = asdict(self)
        del values["program"]
        return {key: _plain(value) for key, value in values.items()}


def _plain(value: Any) -> Any:
    """As JSON has it.

    >>> _plain({"a": (1.0, float("inf")), "b": Objective.TIME})
    {'a': [1.0, None], 'b': 'time'}
    """
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, StrEnum):
        return str(value)
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    return value
