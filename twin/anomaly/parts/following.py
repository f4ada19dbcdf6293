"""A machine followed through its parts: its residuals at each tick, on every time scale, and where it is in its part.

    z = (x − centre(section) − level) · weight(section) · calm

x is the quantity of a signal (`quantity.py`), centre and weight are those of the same section in earlier parts (`usual.py`), or the
twin's expectation where no earlier part has the section; level follows wear and material (`levels.py`). A tick tells nothing while
gated, while the spindle stands or changes its speed, or while the feed is held.
"""

from twin.anomaly.parts import heat, scales
from twin.anomaly.parts.levels import another_material
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
from twin.anomaly.parts.own import NEVER, Ended, Own, tool_of, usual_of
from twin.anomaly.parts.quantity import TURNS_RPM_MIN
from twin.anomaly.parts.residuals import idle_of, quantities, residuals
from twin.anomaly.parts.told import Told
from twin.anomaly.parts.usual import Sums

GAP_TICKS = 5
BATCH_S = 240.0
"""After so long a standstill the material may be another one."""
OVERRIDE_PCT_MIN = 1.0
FEED_MIN = 1.0
SETTLED = 0.03
SETTLED_RPM = 20.0
EXPECTED_PCT_MIN = 0.5


def told_after(model: PartsModel, own: Own, told: Told) -> Own:
    """Return the state after one more tick; a gated one tells nothing of the cut."""
    plan, place, values = model.plan, own.place, told.values
    line = NO_LINE if told.line is None else told.line
    rpm = values[plan.speed_at] if plan.speed_at >= 0 else None
    turns = rpm is None or rpm >= TURNS_RPM_MIN
    if own.ended is not None:
        own = own._replace(ended=None)
    stood = place.stood_ticks
    if (
        told.program != place.program
        or told.tool != place.tool
        or line < place.line
        or (line < 0 and turns and stood * model.tick_s >= STOOD_S)
    ):
        own = _turned(model, own, told, line)
        place = own.place
    if told.tick - own.tick > GAP_TICKS and place.is_whole:
        place = place._replace(is_whole=False)
    override = 1.0 if told.feed_override_pct is None else told.feed_override_pct / 100.0
    if any(model.heat):
        own = own._replace(heat=heat.warmed(own.heat, plan.drivers_at, model.heat, values, plan.heat_shares, is_held=own.is_held))
    feed = values[plan.feed_at] if plan.feed_at >= 0 else None
    if told.is_gated or not turns or override * 100.0 < OVERRIDE_PCT_MIN or (feed is not None and feed < FEED_MIN):
        place = place._replace(line=line, stood_ticks=stood + 1 if not turns else 0)
        return own._replace(tick=told.tick, place=place, rpm=rpm or 0.0, is_idle=True)
    if stood * model.tick_s >= BATCH_S:
        own = own._replace(material=another_material(own.material))
    moved = (place.moved_mm if line == place.line else 0.0) + (feed or 0.0) * model.tick_s / 60.0
    return _cut(model, own, told, place, (line, moved), override)


def _cut(model: PartsModel, own: Own, told: Told, place: Place, here: Mark, override: float) -> Own:
    """Return the state after a tick at which the machine works."""
    plan = model.plan
    usual = usual_of(model, own, place.key)
    line, moved = here
    is_new = usual is None or is_beyond(usual.end, line, moved)
    place = place._replace(
        line=line,
        line_last=max(line, place.line_last),
        moved_mm=moved,
        stood_ticks=0,
        ticks=place.ticks + 1,
        section_ticks=place.section_ticks + 1,
        end=max(place.end, here),
    )
    before, sums, sections = place.section, own.sums, own.sections
    known = 0 if usual is None else len(usual.marks)
    if is_new:
        place = formed(place, known, override, model.tick_s) if place.is_whole else place._replace(section=-1)
    elif usual is not None:
        section = section_at(usual.marks, line, moved)
        place = place if section == before else place._replace(section=section, section_ticks=0)
    if place.section != before and any(sums.count):
        sections, sums = (*sections, (before, sums)), Sums((0,) * len(plan.kinds), plan.flat, plan.flat)
    rpm = told.values[plan.speed_at] if plan.speed_at >= 0 else None
    settled = rpm is None or abs(rpm - own.rpm) <= SETTLED * rpm + SETTLED_RPM
    x = quantities(model, told, override, settled)
    z, d, is_told = residuals(plan, model, own, x, told.expected, None if is_new else usual, place.section)
    share = plan.shares
    return own._replace(
        tick=told.tick,
        place=place,
        rpm=rpm or 0.0,
        smooth=scales.smoothed(own.smooth, z, is_told, share),
        told_at=tuple([told.tick if t else last for t, last in zip(is_told, own.told_at, strict=True)]),
        is_idle=not any(is_told),
        is_new=is_new,
        sums=_added(sums, d),
        sections=sections,
        expected=_expected_after(plan, own.expected, told, override, model),
    )


def _added(sums: Sums, d: list[float | None]) -> Sums:
    count = tuple([n if v is None else n + 1 for n, v in zip(sums.count, d, strict=True)])
    total = tuple([t if v is None else t + v for t, v in zip(sums.total, d, strict=True)])
    return Sums(count, total, tuple([s if v is None else s + v * v for s, v in zip(sums.squares, d, strict=True)]))


def _expected_after(
    plan: Plan, before: tuple[float, float, int], told: Told, override: float, model: PartsModel
) -> tuple[float, float, int]:
    """Return the sums of the cutting load that was measured, at full feed, and of what the twin expects, with their ticks."""
    expected = told.expected
    if expected is None or plan.load_at < 0 or not expected.cut_load_pct >= EXPECTED_PCT_MIN:
        return before
    load = told.values[plan.load_at]
    if load is None:
        return before
    cut = max(0.0, load - idle_of(plan, told.values)) * override ** -model.powers[plan.load_at]
    return before[0] + cut, before[1] + expected.cut_load_pct, before[2] + 1


def _turned(model: PartsModel, own: Own, told: Told, line: int) -> Own:
    """Return the state where program, tool or part may have changed; the operation before has ended then."""
    before = own.place
    is_part = is_part_begun(before, told.program, told.tool, line, round(STOOD_S / model.tick_s))
    if not is_part and told.program == before.program and told.tool == before.tool:
        return own
    sections = (*own.sections, (before.section, own.sums)) if any(own.sums.count) else own.sections
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
        )
    is_seen = own.tick != NEVER and told.tick - own.tick <= GAP_TICKS
    place = operation_begun(before, told.program, told.tool, line, is_part, is_seen)
    tools = {**own.tools, _name(before.tool): tool_of(model, own, before.tool)._replace(slow=scales.of_tool(own.smooth))}
    tool = tools.get(_name(told.tool)) or tool_of(model, own, told.tool)
    zero = (0,) * len(model.signals)
    own = own._replace(
        place=place,
        smooth=scales.with_tool(own.smooth, tool.slow),
        tools=tools,
        sums=Sums(zero, model.plan.flat, model.plan.flat),
        sections=(),
        expected=(0.0, 0.0, 0),
        ended=ended,
        held_ticks=0,
        alarm_ticks=0,
    )
    if told.program != before.program:
        own = own._replace(material=another_material(own.material))
    return with_levels(model, own)


def _name(tool: int | None) -> str:
    return "?" if tool is None else str(tool)


def with_levels(model: PartsModel, own: Own) -> Own:
    """Return the state with the levels of the tool in the spindle, and what their uncertainty leaves of a residual."""
    tool = tool_of(model, own, own.place.tool).level
    variance = own.material.variance + tool.variance
    kinds = model.plan.kinds
    rows = zip(kinds, own.material.values, tool.values, model.plan.prior, strict=True)
    both = [(m + l, (1.0 + variance / v) ** -0.5) if k in LEVELLED else (0.0, 1.0) for k, m, l, v in rows]
    return own._replace(level=tuple([one[0] for one in both]), calm=tuple([one[1] for one in both]))
