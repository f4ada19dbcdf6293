"""The standing of a tool in words and figures: level over a sharp one, slope, parts left, and why a figure is missing.

Parts left are given after `uses_min` parts of a life that was seen from its beginning, where the level at which such tools are
spent is known, the slope is above nothing by its band of 90 %, and the band of the parts left is finite.
"""

from math import exp, sqrt
from typing import Any, NamedTuple

from twin.wear.curve import at, slope
from twin.wear.fast import FAST_LIVES
from twin.wear.left import Left, left
from twin.wear.life import LIVES_MIN, Known, known
from twin.wear.machine import ANCHORS_MIN, Wear
from twin.wear.terms import Terms
from twin.wear.tool import Tool, wander_of
from twin.wear.trend import Trend

BAND_90 = 1.645


class Status(NamedTuple):
    """One tool. level, slope: in % over a sharp tool, and % a part, each with its band of 90 %; None has its reason beside it."""

    tool: int
    uses: int
    level_pct: float | None
    level_band_pct: tuple[float, float] | None
    why_no_level: str
    slope_pct: float | None
    slope_band_pct: tuple[float, float] | None
    why_no_slope: str
    left: Left | None
    why_not_left: str
    is_fast: bool | None
    why_not_fast: str
    basis: str
    vibration_pct: float | None

    def document(self) -> dict[str, Any]:
        """Return the tool as a row of `twin/tool_lives`."""
        return {
            "tool": self.tool,
            "parts": self.uses,
            "wear_pct": self.level_pct,
            "wear_band_pct": self.level_band_pct,
            "slope_pct": self.slope_pct,
            "slope_band_pct": self.slope_band_pct,
            "parts_left": None if self.left is None else self.left.middle,
            "parts_left_band": None if self.left is None else (self.left.low, self.left.high),
            "reason": self.why_not_left or self.why_no_level or None,
            "is_fast": self.is_fast,
            "vibration_pct": self.vibration_pct,
            "basis": self.basis,
        }


def status_of(number: str, tool: Tool, wear: Wear, terms: Terms) -> Status:
    """Return the standing of a tool."""
    life, trend = tool.known(terms), tool.trend
    no_level = _why_no_level(number, tool)
    steep, level = life.end * slope(life.curve, trend.share), life.end * at(life.curve, trend.share)
    off, rate = BAND_90 * steep * sqrt(trend.var), BAND_90 * sqrt(trend.rate_var)
    no_slope = no_level or ("" if tool.uses >= terms.uses_min else f"fewer than {terms.uses_min} parts of this tool")
    uses_left, no_left = (None, no_slope) if no_slope else _left(number, tool, trend, terms)
    not_fast = "" if tool.is_fast else _why_not_fast(number, tool)
    per_part = steep * exp(level)
    return Status(
        int(number),
        tool.uses,
        None if no_level else _pct(level),
        None if no_level else (_pct(level - off), _pct(level + off)),
        no_level,
        None if no_slope else round(100.0 * per_part * trend.rate, 3),
        None
        if no_slope
        else (round(100.0 * per_part * (trend.rate - rate), 3), round(100.0 * per_part * (trend.rate + rate), 3)),
        no_slope,
        uses_left,
        no_left,
        None if not_fast else tool.is_fast,
        not_fast,
        _basis(number, tool, wear, terms),
        None if tool.vibration is None else _pct(tool.vibration),
    )


def _why_no_level(number: str, tool: Tool) -> str:
    if not tool.is_whole:
        return f"no replacement of tool {number} has been seen yet, so the load of a sharp one is not known"
    return f"the load of a sharp tool {number} is being learned" if tool.is_learning else ""


def _no_lives(number: str) -> str:
    return f"fewer than {LIVES_MIN} whole lives of tool {number} have been seen"


def _why_not_fast(number: str, tool: Tool) -> str:
    if len(tool.lives) < FAST_LIVES:
        return f"not known yet: {len(tool.lives)} of {FAST_LIVES} lives of tool {number}"
    if not tool.is_whole:
        return f"the life of tool {number} was not seen from its beginning"
    return f"the load of tool {number} stepped up in this life" if tool.has_stepped else ""


def _left(number: str, tool: Tool, trend: Trend, terms: Terms) -> tuple[Left | None, str]:
    life = known(tool.lives, terms.wear_limit)
    if life is None:
        return None, f"{_no_lives(number)}, and no wear_limit_pct is configured"
    if trend.rate <= BAND_90 * sqrt(trend.rate_var):
        return None, f"the load of tool {number} does not clearly rise"
    found = left(trend, end_var(life), wander_of(life, trend).rate)
    return found, "" if found is not None else f"the band of the parts left of tool {number} is not finite"


def end_var(life: Known) -> float:
    """Return the variance of the share at which lives end: by the spread of their levels there."""
    return (life.end_spread / slope(life.curve, 1.0)) ** 2


def _pct(level: float) -> float:
    return round(100.0 * (exp(min(level, 5.0)) - 1.0), 2)


def _basis(number: str, tool: Tool, wear: Wear, terms: Terms) -> str:
    said = [f"tool {number}: {tool.uses} parts" + ("" if tool.is_whole else " since it was first seen")]
    if tool.replaced_part >= 0:
        said.append(
            f"replaced at part {tool.replaced_part}, inferred: its load fell by {_pct(tool.fell):g} % and the others' did not"
        )
    life = known(tool.lives, terms.wear_limit)
    if life is not None and life.lives >= LIVES_MIN:
        uses = sorted(one.uses for one in tool.lives)
        said.append(f"spent at {_pct(life.end):g} %, learned from {life.lives} lives of {uses[0]} to {uses[-1]} parts")
    elif life is not None:
        said.append(f"spent at {_pct(life.end):g} %, configured")
    if tool.has_stepped:
        said.append("its load stepped up in this life")
    if wear.anchors >= ANCHORS_MIN:
        said.append(f"{_pct(wear.material):+g} % that all tools share is taken off")
    else:
        said.append("material and wear can't be told apart: fewer than two tools of a part are known sharp")
    return "; ".join(said)
