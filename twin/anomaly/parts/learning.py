"""Learning from a part that has ended without an alarm; a part that alarmed teaches nothing.

At the end of an operation its levels of wear and material are followed, unless its score was suspicious for long. At the end of
the part the sections of all its operations are learned. An alarm takes back the levels to those at the beginning of its part.
Where fewer than three parts know an operation, a second part that alarms in it says that those before were the odd ones.
"""

from twin.anomaly.parts.following import with_levels
from twin.anomaly.parts.judging import Judged
from twin.anomaly.parts.levels import followed
from twin.anomaly.parts.model import LEVELLED, OPERATIONS_MAX, PartsModel, Plan
from twin.anomaly.parts.moment import SECTIONS_MAX, is_beyond
from twin.anomaly.parts.own import NEVER, Ended, Own, tool_of, usual_of
from twin.anomaly.parts.record import CutRecord, recorded
from twin.anomaly.parts.residuals import cut_share
from twin.anomaly.parts.sectioning import starts_of
from twin.anomaly.parts.usual import Sums, Usual, begun_usual, extended, froze, learned_section

SUSPICIOUS = 1.0
HELD_SHARE_MAX = 0.3
SKIPPED_MAX = 5
YOUNG_PARTS = 3
"""An operation that so few parts know is learned also where it is suspicious. A part that alarms in it is the odd one, or the
parts before are: when the next one alarms too, these are forgotten, and it is learned."""
OPERATIONS_OF_PART_MAX = 40
TICKS_MIN = 3
CUT_SHARE_MIN = 0.3


def learned(model: PartsModel, own: Own, judged: Judged, is_alarm: bool) -> tuple[Own, CutRecord | None]:
    """Return the state once the alarm is known, and the record of an operation that has ended at this tick."""
    ended = own.ended
    if own.is_idle and own.held is None and judged.score is not None:
        own = own._replace(held=judged)
    is_high = judged.score is not None and judged.score >= SUSPICIOUS
    if ended is None and not is_high and not is_alarm and not own.is_held:
        return own if judged.shared in ((), own.shared) else own._replace(shared=judged.shared), None
    cut = None
    if ended is not None:
        own, cut = _operation_ended(model, own, ended)
    if is_alarm:
        usual = usual_of(model, own, own.place.key)
        if not own.is_odd and (usual is None or usual.parts < YOUNG_PARTS):
            own = own._replace(is_odd=True)
        own = own if own.is_part_bad else _taken_back(model, own)
    since = own.high_since
    return own._replace(
        shared=judged.shared or own.shared,
        is_held=is_high or is_alarm,
        high_since=NEVER if not is_high and not is_alarm else own.tick if since == NEVER else since,
        held_ticks=own.held_ticks + (is_high and not own.is_idle),
        alarm_ticks=own.alarm_ticks + is_alarm,
    ), cut


def _taken_back(model: PartsModel, own: Own) -> Own:
    """Return the state of a part that has alarmed: nothing of it is learned, and its levels are those at its beginning."""
    own = own._replace(is_part_bad=True, waiting=())
    if own.kept is None:
        return own
    material, tools = own.kept
    levels = {
        name: tool._replace(level=tools[name].level if name in tools else model.tool_level(name))
        for name, tool in own.tools.items()
    }
    return with_levels(model, own._replace(material=material, tools=levels))


def _operation_ended(model: PartsModel, own: Own, ended: Ended) -> tuple[Own, CutRecord | None]:
    place = ended.place
    usual = usual_of(model, own, place.key)
    is_young = usual is None or usual.parts < YOUNG_PARTS
    is_bad = bool(ended.alarm_ticks) or own.is_part_bad
    cut = recorded(model, ended, usual, is_bad) if place.is_whole else None
    is_alarmed = is_bad and not (is_young and own.odd_parts)
    is_calm = not is_alarmed and ended.held_ticks <= HELD_SHARE_MAX * place.ticks
    if is_calm or (not is_alarmed and (is_young or own.skipped >= SKIPPED_MAX)):
        own = _levels_followed(model, own, ended, usual)
        if len(own.waiting) < OPERATIONS_OF_PART_MAX:
            own = own._replace(waiting=(*own.waiting, ended))
    if not ended.is_part_over:
        return own, cut
    skipped = 0 if is_calm or is_alarmed else own.skipped + 1
    for one in own.waiting:
        own = _sections_learned(model, own, one)
    odd_parts = min(own.odd_parts + 1, YOUNG_PARTS) if own.is_odd else 0
    kept = (own.material, own.tools)
    own = own._replace(is_part_bad=False, is_odd=False, odd_parts=odd_parts, skipped=min(skipped, SKIPPED_MAX), kept=kept)
    return own._replace(waiting=()), cut


def _levels_followed(model: PartsModel, own: Own, ended: Ended, usual: Usual | None) -> Own:
    """Return the state with the levels after an operation that earlier parts know."""
    if usual is None:
        return own
    residual = [_mean(model.plan, ended, usual, at) if kind in LEVELLED else None for at, kind in enumerate(model.plan.kinds)]
    if all(value is None for value in residual):
        return own
    tool = tool_of(model, own, ended.place.tool)
    material, level = followed(own.material, tool.level, residual, ended.noise, model.plan.load_at)
    name = "?" if ended.place.tool is None else str(ended.place.tool)
    if name not in own.tools and len(own.tools) >= OPERATIONS_MAX:
        return own
    return with_levels(model, own._replace(material=material, tools={**own.tools, name: tool._replace(level=level)}))


def _mean(plan: Plan, ended: Ended, usual: Usual, at: int) -> float | None:
    """Return the change of the cut that a signal shows, by least squares over the sections that earlier parts know."""
    total = weights = ticks = 0.0
    for section, sums in ended.sections:
        if 0 <= section < len(usual.marks) and usual.told[section][at] and sums.ticks[at]:
            cuts = cut_share(plan, usual.centre[section])
            if cuts >= CUT_SHARE_MIN:
                share = cuts * usual.weight[section][at] ** 2
                total += share * sums.total[at]
                weights += share * cuts * sums.ticks[at]
                ticks += sums.ticks[at]
    return total / weights if ticks >= TICKS_MIN and weights > 0.0 else None


def _sections_learned(model: PartsModel, own: Own, ended: Ended) -> Own:
    """Return the state with the usual course of an operation after one more healthy part."""
    place, plan = ended.place, model.plan
    if place.key is None or not model.follows_parts:
        return own
    usual = usual_of(model, own, place.key)
    if usual is None and (not place.is_whole or len(own.usual) >= OPERATIONS_MAX):
        return own
    if usual is not None and own.odd_parts and usual.parts < YOUNG_PARTS:
        usual = usual._replace(parts=0, told=((0,) * len(plan.kinds),) * len(usual.marks))
    merged = _merged(ended, 0 if usual is None else len(usual.marks))
    if place.is_whole and place.forming:
        usual, merged = _with_sections(usual, ended, merged, plan.kinds, model.tick_s)
    if usual is None:
        return own
    centre, variance = list(usual.centre), list(usual.variance)
    told, weight, frozen = list(usual.told), list(usual.weight), list(usual.frozen)
    for section, sums in merged.items():
        before = usual.told[section]
        centre[section], variance[section], told[section], weight[section] = learned_section(
            usual, section, sums, plan.prior, plan.least, plan.first
        )
        if plan.load_at >= 0 and before[plan.load_at] < told[section][plan.load_at]:
            at = plan.load_at
            now = (
                usual.centre[section][at]
                + sums.total[at] / sums.ticks[at]
                + ended.level[at] * cut_share(plan, usual.centre[section])
            )
            frozen[section] = froze(frozen[section], before[at], now)
    parts = min(usual.parts + 1, 10**6) if place.is_whole else usual.parts
    duration = usual.duration_ticks
    if place.is_whole:
        duration += (place.ticks - duration) / min(parts, 20)
    after = usual._replace(
        parts=parts,
        duration_ticks=duration,
        centre=tuple(centre),
        variance=tuple(variance),
        told=tuple(told),
        weight=tuple(weight),
        frozen=tuple(frozen),
    )
    return own._replace(usual={**own.usual, place.key: after})


def _with_sections(
    usual: Usual | None, ended: Ended, sums: dict[int, Sums], kinds: tuple[int, ...], tick_s: float
) -> tuple[Usual | None, dict[int, Sums]]:
    """Return the course with the sections that this part was the first to come to, and the sums by its sections."""
    known, place = 0 if usual is None else len(usual.marks), ended.place
    beyond = [at for at, mark in enumerate(place.forming) if usual is None or is_beyond(usual.end, *mark)]
    room = SECTIONS_MAX - known
    own = {section: one for section, one in sums.items() if section < known}
    if not beyond or room <= 0:
        return usual, own
    stretches = [sums.get(known + at) for at in beyond]
    starts = starts_of(stretches, kinds, tick_s, room)
    marks = tuple([place.forming[beyond[start]] for start in starts])
    for number, (start, stop) in enumerate(zip(starts, [*starts[1:], len(stretches)], strict=True)):
        for one in stretches[start:stop]:
            if one is not None:
                before = own.get(known + number)
                own[known + number] = one if before is None else before.plus(one)
    after = begun_usual(marks, place.end, len(kinds)) if usual is None else extended(usual, marks, place.end, len(kinds))
    return after, own


def _merged(ended: Ended, known: int) -> dict[int, Sums]:
    """Return the sums by section; a section that was come to several times has those of all."""
    found: dict[int, Sums] = {}
    for section, sums in ended.sections:
        if 0 <= section < known + len(ended.place.forming):
            before = found.get(section)
            found[section] = sums if before is None else before.plus(sums)
    return found
