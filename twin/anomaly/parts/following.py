"""A machine followed through its parts: its residuals at each tick, on every time scale, and where it is in its part.

    z = (x − centre(section) − level) · weight(section) · calm

x is the quantity of a signal (`quantity.py`), centre and weight are those of the same section in earlier parts (`usual.py`), or
the twin's expectation where no earlier part has the section; level follows wear and material (`levels.py`). A tick tells
nothing while gated, while the spindle stands or changes its speed, or while the feed is held.
"""

from collections.abc import Sequence

from twin.anomaly.parts import heat, scales
from twin.anomaly.parts.alignment import CELL_S, put_right
from twin.anomaly.parts.levels import NOISE, another_material
from twin.anomaly.parts.model import LEVELLED, PartsModel, Plan
from twin.anomaly.parts.moment import (
    NO_LINE,
    STOOD_S,
    Mark,
    Place,
    formed,
    is_beyond,
    is_part_begun,
    operation_begun,
    section_at,
)
from twin.anomaly.parts.operation import (
    TICKS_MIN,
    TOGETHER,
    Gathered,
    begun_operation,
    both,
    clipped,
    gathered,
    statistic,
    together,
)
from twin.anomaly.parts.own import NEVER, Ended, Own, tool_of, usual_of
from twin.anomaly.parts.quantity import TURNS_RPM_MIN
from twin.anomaly.parts.residuals import felt_still, idle_of, residuals
from twin.anomaly.parts.told import Told
from twin.anomaly.parts.usual import Usual, with_rows

GAP_TICKS = 5
BATCH_S = 240.0
"""After so long a standstill the material may be another one."""
OVERRIDE_MIN = 0.01
FEED_MIN = 1.0
SETTLED = 0.006
SETTLED_RPM = 5.0
EXPECTED_PCT_MIN = 0.5
YOUNG_VAR = 0.05**2
"""Variance of a centre that one part has taught."""
ROWS_MAX = 30
REST = Own._fields.index("held") + 1
"""Fields from here on do not change at every tick."""


def told_after(model: PartsModel, own: Own, told: Told) -> Own:
    """Return the state after one more tick; a gated one tells nothing of the cut."""
    plan, values, tick = model.plan, told.values, told.tick
    line = NO_LINE if told.line is None else told.line
    rpm = values[plan.speed_at] if plan.speed_at >= 0 else None
    turns = rpm is None or rpm >= TURNS_RPM_MIN
    place = own.place
    if (
        told.program != place.program
        or told.tool != place.tool
        or line < place.line
        or (line < 0 and turns and place.stood_ticks * model.tick_s >= STOOD_S)
        or own.ended is not None
    ):
        own = _turned(model, own._replace(ended=None), told, line)
        place = own.place
    if tick - own.tick > GAP_TICKS and place.is_whole:
        place = place._replace(is_whole=False)
    warm = own.heat
    if plan.heat_every and tick % plan.heat_every == 0:
        is_held = own.is_held and (tick - own.high_since) * model.tick_s < heat.HELD_S
        warm = heat.warmed(warm, plan.drivers_at, model.heat, values, plan.heat_shares, is_held=is_held)
    override = 1.0 if told.feed_override_pct is None else told.feed_override_pct / 100.0
    feed = values[plan.feed_at] if plan.feed_at >= 0 else None
    step = (feed or 0.0) * model.tick_s / 60.0 if line >= 0 else override * model.tick_s
    if told.is_gated or not turns or override < OVERRIDE_MIN or (feed is not None and feed < FEED_MIN):
        moved = place.moved_mm + step if line < 0 and turns and feed is not None and feed >= FEED_MIN else place.moved_mm
        if not turns and not told.is_gated and model.still:
            own = own._replace(felt=felt_still(model, own, values), felt_at=tick)
        place = place._replace(line=line, stood_ticks=0 if turns else place.stood_ticks + 1, moved_mm=moved)
        return own._replace(tick=tick, place=place, rpm=rpm or 0.0, is_idle=True, heat=warm, shared=plan.flat)
    if place.stood_ticks * model.tick_s >= BATCH_S:
        own = with_levels(model, own._replace(material=another_material(own.material)))
    moved = (place.moved_mm if line == place.line else 0.0) + step
    return _cut(model, own._replace(heat=warm) if warm is not own.heat else own, told, place, (line, moved), override)


def _cut(model: PartsModel, own: Own, told: Told, place: Place, here: Mark, override: float) -> Own:
    """Return the state after a tick at which the machine works."""
    plan = model.plan
    usual = usual_of(model, own, place.key)
    is_new = usual is None or is_beyond(usual.end, *here)
    known, before = 0 if usual is None else len(usual.marks), place.section
    section = before if is_new or usual is None else section_at(usual.marks, *here)
    place = place.moved_to(here, section)
    if is_new:
        place = formed(place, known, override, model.tick_s) if place.is_whole else place._replace(section=-1)
    rows, sections = own.rows, own.sections
    if rows and (place.section != before or len(rows) >= ROWS_MAX):
        sections, rows = with_rows(sections, before, rows), ()
    rpm = told.values[plan.speed_at] if plan.speed_at >= 0 else None
    settled = rpm is None or -SETTLED * rpm - SETTLED_RPM <= rpm - own.rpm <= SETTLED * rpm + SETTLED_RPM
    now = residuals(model, own, told, override, settled, None if is_new else usual, place.section)
    tells, d = now.tells, now.d
    if here[0] < 0 and usual is not None and not is_new and told.tick % max(1, round(CELL_S / model.tick_s)) == 0:
        place = _put_right(usual, place, d)
    expected = own.expected if told.expected is None else _expected_after(plan, own.expected, told, override, model)
    if 0.0 in tells:
        told_at = tuple([told.tick if t else last for t, last in zip(tells, own.told_at, strict=True)])
    else:
        told_at = (told.tick,) * len(tells)
    sums = gathered(own.gathered, now.cut_z, now.cut_tells, now.late, now.off)
    smooth = scales.smoothed(own.smooth, now.z, tells, plan.shares, _of_cuts(model, own, sums))
    is_idle, rows, felt = not any(tells), (*rows, d), tuple(now.felt)
    moving = (told.tick, place, rpm or 0.0, smooth, told_at, is_idle, is_new, rows, sections, expected, sums, felt, own.felt_at)
    return Own._make((*moving, None, *own[REST:]))


def _of_cuts(model: PartsModel, own: Own, sums: Gathered) -> list[tuple[float, ...]]:
    """Return the figures of the operation that runs, of the last four, and of the tool, by signal; () of other signals."""
    plan, found = model.plan, list[tuple[float, ...]]()
    last = tool_of(model, own, own.place.tool).last
    variance = own.unsure + sums.off / sums.ticks
    for at, (is_levelled, over, alike) in enumerate(zip(plan.cuts, plan.over_spread, plan.alike, strict=True)):
        if not is_levelled:
            found.append(())
            continue
        t = statistic(sums.total[at], sums.weight[at], variance * over * over, alike)
        found.append((t, together(t, own.past, at), both(t, last[at])))
    return found


def _put_right(usual: Usual, place: Place, d: Sequence[float | None]) -> Place:
    """Return the place with its progress put right by the signals; d: residuals to the centre of its section."""
    values = [None if apart is None else apart + middle for apart, middle in zip(d, usual.centre[place.section], strict=True)]
    band, shift_s = put_right(usual, place.band, place.moved_mm, values)
    return place._replace(band=band, moved_mm=max(0.0, place.moved_mm + shift_s))


def _expected_after(
    plan: Plan, before: tuple[float, float, int], told: Told, override: float, model: PartsModel
) -> tuple[float, float, int]:
    """Return the sums of the cutting load that was measured, at full feed, and of what the twin expects, with their ticks."""
    expected = told.expected
    twin = None if expected is None else expected.cut_load_pct
    load = told.values[plan.load_at] if plan.load_at >= 0 else None
    if twin is None or load is None or not twin >= EXPECTED_PCT_MIN:
        return before
    cut = max(0.0, load - idle_of(plan, told.values)) * override ** -model.powers[plan.load_at]
    return before[0] + cut, before[1] + twin, before[2] + 1


def _turned(model: PartsModel, own: Own, told: Told, line: int) -> Own:
    """Return the state where program, tool or part may have changed; the operation before has ended then."""
    before, plan = own.place, model.plan
    is_part = is_part_begun(before, told.program, told.tool, line, round(STOOD_S / model.tick_s))
    if not is_part and told.program == before.program and told.tool == before.tool:
        return own
    sections = with_rows(own.sections, before.section, own.rows) if own.rows else own.sections
    ended = None
    if before.key is not None and sections:
        measured, expected, ticks = own.expected
        ended = Ended(
            before,
            sections,
            own.tick,
            own.level,
            expected / ticks if ticks else None,
            measured / ticks if ticks else None,
            own.held_ticks,
            own.alarm_ticks,
            is_part,
            _noise(model, own.gathered),
        )
    is_seen = own.tick != NEVER and told.tick - own.tick <= GAP_TICKS
    place = operation_begun(before, told.program, told.tool, line, is_part, is_seen)
    if own.gathered.ticks >= TICKS_MIN:
        figures = tuple([one[0] if one else 0.0 for one in _of_cuts(model, own, own.gathered)])
        tools = {**own.tools, _name(before.tool): tool_of(model, own, before.tool)._replace(last=figures)}
        own = own._replace(tools=tools, past=(*own.past[2 - TOGETHER :], clipped(figures)))
    own = own._replace(
        place=place,
        gathered=begun_operation(len(plan.kinds)),
        rows=(),
        sections=(),
        expected=(0.0, 0.0, 0),
        ended=ended,
        held_ticks=0,
        alarm_ticks=0,
    )
    if told.program != before.program:
        own = own._replace(material=another_material(own.material))
    return with_levels(model, own)


def _noise(model: PartsModel, sums: Gathered) -> float:
    """Return the variance of the change that an operation shows, ln²: of its override, and of its ticks."""
    plan, at = model.plan, max(model.plan.load_at, 0)
    ticks = sums.weight[at] * plan.over_spread[at] ** 2 / plan.alike[at] if sums.weight[at] else 0.0
    return (sums.off / sums.ticks if sums.ticks else 0.0) + (1.0 / ticks if ticks else 0.0)


def _name(tool: int | None) -> str:
    return "?" if tool is None else str(tool)


def with_levels(model: PartsModel, own: Own) -> Own:
    """Return the state with the levels of the tool in the spindle, and what their uncertainty leaves of a residual."""
    tool = tool_of(model, own, own.place.tool).level
    usual = usual_of(model, own, own.place.key)
    young = 0.0 if usual is None or not usual.parts else YOUNG_VAR / usual.parts
    variance = own.material.variance + tool.variance + young
    kinds = model.plan.kinds
    each = zip(kinds, own.material.values, tool.values, model.plan.prior, strict=True)
    rows = [(m + t, 1.0 / (1.0 + variance / v)) if k in LEVELLED else (0.0, 1.0) for k, m, t, v in each]
    return own._replace(level=tuple([one[0] for one in rows]), calm=tuple([one[1] for one in rows]), unsure=variance + NOISE)
