"""An operation of a part that has ended, beside the same operation of earlier parts: what wear and drift are read from.

    load_ratio = mean over the sections of   cutting load / frozen reference

The reference is frozen (the twin's expectation where there is one, else the first healthy parts), so that wear stays visible.
"""

import json
import math
from typing import NamedTuple

from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Ended
from twin.anomaly.parts.quantity import FEED, Kind
from twin.anomaly.parts.residuals import cut_share
from twin.anomaly.parts.usual import Usual

VERSION = 1


class CutRecord(NamedTuple):
    """A ratio that is not known is None. operation: program, tool, and n-th use of the tool in the program
    ended_s: event time; load_ratio_sd: standard error of load_ratio; reference: "twin" or "parts"
    """

    program: str | None
    tool: int | None
    operation: str
    part: int
    ended_s: float
    duration_s: float
    duration_ratio: float | None
    load_ratio: float | None
    load_ratio_sd: float | None
    vibration_ratio: float | None
    feed_ratio: float | None
    parts_known: int
    reference: str
    is_alarmed: bool

    def in_json(self) -> str:
        """Return the JSON text that is published."""
        return json.dumps({"version": VERSION, **self._asdict()}, separators=(",", ":"), allow_nan=False)


CUT_PCT_MIN = 1.0
"""A section with less cutting load than that is air."""


def recorded(model: PartsModel, ended: Ended, usual: Usual | None, is_alarmed: bool) -> CutRecord:
    """Return the record of an operation that has ended; usual: its usual course before it."""
    place, plan = ended.place, model.plan
    parts = 0 if usual is None else usual.parts
    by_parts = _load_beside_parts(model, ended, usual)
    by_twin = None if not ended.expected_pct or ended.cut_pct is None else ended.cut_pct / ended.expected_pct
    ratio, error = (by_twin, by_parts[1]) if by_twin is not None else by_parts
    vibration = next((at for at, kind in enumerate(plan.kinds) if kind == Kind.VIBRATION), -1)
    feed = model.signals.index(FEED) if FEED in model.signals else -1
    return CutRecord(
        place.program,
        place.tool,
        place.key or "?",
        place.part,
        ended.tick * model.tick_s,
        place.ticks * model.tick_s,
        place.ticks / usual.duration_ticks if usual is not None and usual.duration_ticks > 0.0 else None,
        ratio,
        error,
        _ratio(ended, usual, vibration),
        _ratio(ended, usual, feed),
        parts,
        "twin" if by_twin is not None else "parts",
        is_alarmed,
    )


def _load_beside_parts(model: PartsModel, ended: Ended, usual: Usual | None) -> tuple[float | None, float | None]:
    """Return the cutting load over that of the first healthy parts, and its standard error over the sections."""
    at = model.plan.load_at
    if at < 0 or usual is None:
        return None, None
    floor, rows = model.plan.floors[at], []
    for section, sums in ended.sections:
        if not 0 <= section < len(usual.marks) or not sums.count[at]:
            continue
        before = usual.frozen[section]
        level = ended.level[at] * cut_share(model.plan, usual.centre[section])
        now = usual.centre[section][at] + sums.total[at] / sums.count[at] + level
        if before is not None and math.exp(before) - floor >= CUT_PCT_MIN:
            rows.append((sums.count[at], max(0.0, math.exp(now) - floor), math.exp(before) - floor))
    if not rows:
        return None, None
    ratio = sum(n * cut for n, cut, _ in rows) / sum(n * usual_cut for n, _, usual_cut in rows)
    if len(rows) == 1:
        return ratio, None
    total = sum(n * usual_cut for n, _, usual_cut in rows)
    off = sum((n * (cut - ratio * usual_cut)) ** 2 for n, cut, usual_cut in rows) * len(rows) / (len(rows) - 1)
    return ratio, math.sqrt(off) / total


def _ratio(ended: Ended, usual: Usual | None, at: int) -> float | None:
    """Return a signal over what is usual now, as a ratio, levels of wear and material included."""
    if usual is None or at < 0:
        return None
    known = [(s.count[at], s.total[at]) for n, s in ended.sections if 0 <= n < len(usual.marks) and usual.told[n][at]]
    ticks = sum(count for count, _ in known)
    return math.exp(sum(total for _, total in known) / ticks + ended.level[at]) if ticks else None
