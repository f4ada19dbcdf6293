"""The state of one machine between two ticks; all of it is JSON-able and bounded."""

from typing import NamedTuple

from twin.anomaly.parts.alarms.episodes import Memory
from twin.anomaly.parts.heat import Heat
from twin.anomaly.parts.judgement import Judged
from twin.anomaly.parts.levels import Level, another_material
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.moment import Place
from twin.anomaly.parts.operation import Gathered, begun_operation
from twin.anomaly.parts.usual import Rows, Sums, Usual

NEVER = -(10**12)


class Tool(NamedTuple):
    """A tool's level, and the figures of its last operation, by signal (`operation.py`)."""

    level: Level
    last: tuple[float, ...]


class Ended(NamedTuple):
    """An operation of a part that has ended, as it was followed; forming: marks beyond what earlier parts know.

    sections: each with its sums; cut_pct: mean cutting load at the programmed feed, and of its reference, by section
    held_ticks, alarm_ticks: during which the score was suspicious, and the alarm on
    noise: variance of a change of the cut that was seen in it, ln²
    """

    place: Place
    sections: tuple[tuple[int, Sums], ...]
    tick: int
    level: tuple[float, ...]
    expected_pct: float | None
    cut_pct: float | None
    held_ticks: int
    alarm_ticks: int
    is_part_over: bool
    noise: float


class Own(NamedTuple):
    """tick: the last one told; place: where the machine is in its part; rpm: speed at the last tick
    smooth: residuals in spreads, by signal, each on all scales; told_at: tick at which each signal was last told of
    is_idle: this tick told nothing; is_new: no earlier part has the section, so the twin is all there is
    held: the judgement of the first idle tick, until there is another one
    gathered: sums of the operation that runs; past: figures of the three operations before, by signal
    felt: what the machine feels, by signal, for its peers (`shared.py`)
    felt_at: tick at which a vibration was last felt while the spindle stood
    shared: what its peers feel, by signal
    level: of wear and material in the operation that runs, by signal; calm: what its uncertainty leaves of r², by signal
    unsure: the variance of both levels and of the centres, ln²
    material, tools: the levels; kept: those at the beginning of the part; skipped: parts in a row
        that were too suspicious to learn
    rows: residuals of the section that runs; sections: sums of those of the operation so far; expected: sums of the cutting
        load, % at full feed, and of what the twin expects, and their ticks
    usual: the operations learned since training; waiting: those of the part that runs, until it has ended without an alarm
    ended: an operation that has ended at this tick
    is_held: the score is suspicious, nothing is followed; high_since: tick since when; held_ticks, alarm_ticks: of the operation
    is_part_bad: an alarm in this part; is_odd: in an operation that few parts know; odd_parts: of such parts in a row
    memory: the alarms that are remembered, and what people have said of them
    """

    tick: int = NEVER
    place: Place = Place()
    rpm: float = 0.0
    smooth: tuple[float, ...] = ()
    told_at: tuple[int, ...] = ()
    is_idle: bool = True
    is_new: bool = True
    rows: Rows = ()
    sections: tuple[tuple[int, Sums], ...] = ()
    expected: tuple[float, float, int] = (0.0, 0.0, 0)
    gathered: Gathered = Gathered()
    felt: tuple[tuple[float, float], ...] = ()
    felt_at: int = NEVER
    held: Judged | None = None
    heat: Heat = Heat()
    shared: tuple[float, ...] = ()
    past: tuple[tuple[float, ...], ...] = ()
    level: tuple[float, ...] = ()
    calm: tuple[float, ...] = ()
    unsure: float = 0.0
    material: Level = Level((), 0.0)
    tools: dict[str, Tool] = {}  # noqa: RUF012  never changed in place
    kept: tuple[Level, dict[str, Tool]] | None = None
    skipped: int = 0
    usual: dict[str, Usual] = {}  # noqa: RUF012  never changed in place
    waiting: tuple[Ended, ...] = ()
    ended: Ended | None = None
    is_held: bool = False
    high_since: int = NEVER
    held_ticks: int = 0
    alarm_ticks: int = 0
    is_part_bad: bool = False
    is_odd: bool = False
    odd_parts: int = 0
    memory: Memory = Memory()


def begun(model: PartsModel) -> Own:
    """Return the state of a machine before anything was told."""
    count, plan = len(model.signals), model.plan
    material = another_material(model.material if model.material.values else Level(plan.flat, model.material.variance))
    return Own(
        smooth=plan.blank,
        told_at=(NEVER,) * count,
        gathered=begun_operation(count),
        felt=((0.0, 0.0),) * count,
        shared=plan.flat,
        level=plan.flat,
        calm=(1.0,) * count,
        heat=Heat(base=(None,) * count),
        material=material,
    )


def usual_of(model: PartsModel, own: Own, key: str | None) -> Usual | None:
    """Return the usual course of an operation: as learned since training, else as training learned it."""
    if key is None:
        return None
    return own.usual.get(key) or model.usual.get(key)


def tool_of(model: PartsModel, own: Own, tool: int | None) -> Tool:
    """Return a tool's level and residuals."""
    name = "?" if tool is None else str(tool)
    return own.tools.get(name) or Tool(model.tool_level(name), model.plan.flat)
