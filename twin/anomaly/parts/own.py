"""The state of one machine between two ticks; all of it is JSON-able and bounded."""

from typing import NamedTuple

from twin.anomaly.parts.episodes import Memory
from twin.anomaly.parts.heat import Heat
from twin.anomaly.parts.levels import Level, another_material
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.moment import Place
from twin.anomaly.parts.usual import Rows, Sums, Usual

NEVER = -(10**12)


class Tool(NamedTuple):
    """A tool's level, and its residuals on its own scale, by signal, as it left the spindle."""

    level: Level
    slow: tuple[float, ...]


class Ended(NamedTuple):
    """An operation of a part that has ended, as it was followed; forming: marks beyond what earlier parts know.

    sections: each with its sums; cut_pct: mean cutting load at the programmed feed, and of its reference, by section
    held_ticks, alarm_ticks: during which the score was suspicious, and the alarm on
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


class Own(NamedTuple):
    """tick: the last one told; place: where the machine is in its part; rpm: speed at the last tick
    smooth: residuals in spreads, by signal, each on all scales; told_at: tick at which each signal was last told of
    is_idle: this tick told nothing; is_new: no earlier part has the section, so the twin is all there is
    level: of wear and material in the operation that runs, by signal; calm: what its uncertainty leaves of a residual, by signal
    material, tools: the levels; kept: those at the beginning of the part; skipped: parts in a row
        that were too suspicious to learn
    rows: residuals of the section that runs; sections: sums of those of the operation so far; expected: sums of the cutting
        load, % at full feed, and of what the twin expects, and their ticks
    usual: the operations learned since training; waiting: those of the part that runs, until it has ended without an alarm
    ended: an operation that has ended at this tick
    is_held: the score is suspicious, nothing is followed; high_since: tick since when; held_ticks, alarm_ticks: of the operation
    is_part_bad: an alarm in this part; memory: the alarms that are remembered, and what people have said of them
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
    heat: Heat = Heat()
    level: tuple[float, ...] = ()
    calm: tuple[float, ...] = ()
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
    memory: Memory = Memory()


def begun(model: PartsModel) -> Own:
    """Return the state of a machine before anything was told."""
    count, plan = len(model.signals), model.plan
    material = another_material(model.material if model.material.values else Level(plan.flat, model.material.variance))
    return Own(
        smooth=plan.blank,
        told_at=(NEVER,) * count,
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
    return own.tools.get(name) or Tool(model.tool_level(name), (0.0,) * len(model.signals))
