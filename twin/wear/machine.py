"""The wear of all tools of a machine: cuts come in, parts are judged when they have ended.

A part is what its cuts have in common, program and number. It is judged when a cut of another part comes: first which batch it
is of and which tools were replaced (twin/wear/material.py), then all tools together (twin/wear/joint.py), then what each
operation tells of itself (twin/wear/tool.py). A tool is taken to be replaced when its level has fallen back to that of a sharp
one, and the others have not, in two of its parts in a row; before a sharp one is known, when it has fallen alone in three.
"""

from collections.abc import Mapping
from math import log
from typing import NamedTuple

from twin.wear.curve import at, slope
from twin.wear.cut import Cut
from twin.wear.joint import MATERIAL, PART, Joint, Observed, passed, trend_of, with_tool
from twin.wear.material import Batches, Explained, Seen, explained, followed
from twin.wear.terms import Terms
from twin.wear.tool import (
    MEMORY_USES,
    REPLACED_USES,
    STEPPED_USES,
    Level,
    Told,
    Tool,
    doubted,
    leap,
    learned,
    level_of,
    new_tool,
    replaced,
    rises_freely,
    used,
    wander_of,
)
from twin.wear.trend import Trend, advanced

TOOLS_MAX = 120
CUTS_MAX = 200
ANCHORS_MIN = 2
DUE = 0.7
ODD_OFF = 4.0
LEAP, FALL_MIN = 0.4, 0.1
"""A tool was replaced if the level of the very operation leapt by this part of its wear; by FALL_MIN it is enough on its own."""
REPLACED_MIN = 0.04
"""Less wear than this can't be told from the spread of sharp tools: its replacement is not looked for."""


class Wear(NamedTuple):
    """The state of a machine's tools, by number as text. parts: that were judged; cuts: of the part that runs; at_s: its last end

    anchors: tools of the last part whose sharp level is known, by which material and wear are told apart
    """

    tools: Mapping[str, Tool] = {}
    joint: Joint = Joint()
    batches: Batches = Batches()
    cuts: tuple[Cut, ...] = ()
    parts: int = 0
    at_s: float = 0.0
    anchors: int = 0

    @property
    def material(self) -> float:
        """The level that all tools share in the batch that runs, as a logarithm, and 0 in the first batch that was seen."""
        return self.joint.means[MATERIAL]


def cut_added(wear: Wear, cut: Cut, terms: Terms) -> tuple[Wear, bool]:
    """Return the state with one more cut, and whether a part was judged by that."""
    if wear.cuts and (wear.cuts[0].program, wear.cuts[0].part) != (cut.program, cut.part):
        return judged(wear, terms)._replace(cuts=(cut,)), True
    if len(wear.cuts) >= CUTS_MAX or any(one.operation == cut.operation and one.tool == cut.tool for one in wear.cuts):
        return wear, False
    return wear._replace(cuts=(*wear.cuts, cut)), False


def judged(wear: Wear, terms: Terms) -> Wear:
    """Return the state after the part that runs has ended."""
    cuts: dict[str, list[Cut]] = {}
    for cut in wear.cuts:
        if cut.load_ratio is not None:
            cuts.setdefault(str(cut.tool), []).append(cut)
    if not cuts:
        return wear._replace(cuts=())
    at_s = max(cut.ended_s for cut in wear.cuts)
    tools = {name: wear.tools.get(name) or new_tool(terms) for name in cuts}
    joint = wear.joint
    for name, tool in tools.items():
        joint = joint if name in joint.names else with_tool(joint, name, tool.trend)
    joint = passed(joint, terms.part, {name: wander_of(tool.known(terms), tool.trend) for name, tool in tools.items()})
    told = {name: _told(own) for name, own in cuts.items()}
    levels = {name: level_of(tools[name], told[name].logs, wear_of(tools[name], terms)) for name in cuts}
    seen = [_seen(name, tools[name], level, joint, terms) for name, level in levels.items() if level is not None]
    found = explained(joint, seen, wear.batches, terms)
    joint = found.joint
    for name, own in cuts.items():
        tool = _after(tools[name], name, terms, told[name], levels[name], found, wear.parts)
        if tool.trend[:5] != trend_of(joint, name)[:5]:
            joint = with_tool(joint, name, tool.trend)
        tools[name] = _shaken(tool._replace(seen_s=at_s), own)
    batches = followed(wear.batches, wear.material) if found.is_batch else wear.batches
    return Wear(
        _bounded({**wear.tools, **tools}), joint, batches, (), wear.parts + 1, at_s,
        sum(tools[one.worn.name].sharp_lives > 0 for one in seen),
    )  # fmt: skip


def _bounded(tools: dict[str, Tool]) -> dict[str, Tool]:
    for name in sorted(tools, key=lambda one: tools[one].seen_s)[: max(len(tools) - TOOLS_MAX, 0)]:
        del tools[name]
    return tools


def _told(cuts: list[Cut]) -> Told:
    """Return what cuts tell. A ratio over another reference has another sharp level, so it counts as another operation."""
    known = {f"{cut.operation} over {cut.reference}": cut for cut in cuts if cut.load_ratio}
    logs = {name: log(cut.load_ratio) for name, cut in known.items() if cut.load_ratio}
    return Told(logs, {name: cut.load_ratio_sd for name, cut in known.items() if cut.load_ratio_sd})


def _seen(name: str, tool: Tool, level: Level, joint: Joint, terms: Terms) -> Seen:
    """Return a tool as the explanation of a part takes it."""
    life, trend = tool.known(terms), trend_of(joint, name)
    sharp = Observed(name, level.level, level.noise + terms.sharp**2, 0.0, 0.0)
    if tool.is_learning:
        return Seen(sharp)
    end = level.gain * life.end
    worn = Observed(name, level.level, level.noise, end * at(life.curve, trend.share), end * slope(life.curve, trend.share))
    can_be_new = tool.sharp_lives > 0 and worn.expected > REPLACED_MIN
    return Seen(worn, sharp if can_be_new else None, trend.share > DUE)


def _after(tool: Tool, name: str, terms: Terms, told: Told, level: Level | None, found: Explained, part: int) -> Tool:
    """Return a tool after a part that was explained like this."""
    joint = found.joint
    shared = joint.means[MATERIAL] + joint.means[PART]
    trend = trend_of(joint, name, tool.trend.fit)
    if level is None:
        return used(learned(tool, told, shared, wear_of(tool, terms)), terms, trend, None, 0.0, 0.0)
    far = found.off[name]
    wear = wear_of(tool, terms)
    rows = joint.rows
    shared_var = rows[MATERIAL][MATERIAL] + 2.0 * rows[MATERIAL][PART] + rows[PART][PART]
    moved = leap(tool, told, shared)
    far_enough = max(LEAP * wear * level.gain, REPLACED_MIN)
    has_fallen = moved is not None and moved < -max(far_enough, FALL_MIN)
    is_low = name in found.replaced or ((far < -ODD_OFF or has_fallen) and not tool.is_learning)
    is_high = far > ODD_OFF and not tool.is_learning and not rises_freely(tool, terms, level, shared, shared_var)
    if (is_low or is_high) and moved is not None and abs(moved) <= far_enough and len(tool.bases) > 1:
        return used(doubted(tool, told, shared, wear), terms, trend, None, 0.0, 0.0)._replace(low=0, high=0)
    if is_low:
        low = tool.low + 1
        if low < (REPLACED_USES if name in found.replaced or has_fallen else STEPPED_USES):
            return tool._replace(low=low, high=0, trend=trend)
        return _new_life(tool._replace(low=low), terms, told, shared, part, wear - (level.level - shared) / level.gain)
    if is_high:
        if tool.high + 1 < STEPPED_USES:
            return tool._replace(high=tool.high + 1, low=0, trend=trend)
        return _stepped(tool, trend, ((level.level - shared) / level.gain - wear) / tool.known(terms).end)
    after = used(tool, terms, trend, level, shared, shared_var)
    wear = 0.0 if tool.is_learning else wear_of(after, terms)
    return learned(after._replace(uses=tool.uses), told, shared, wear)._replace(uses=after.uses, low=0, high=0)


def _new_life(tool: Tool, terms: Terms, told: Told, shared: float, part: int, fell: float) -> Tool:
    """Return the tool in its new life, of which it has gone through the parts in which it seemed to be replaced."""
    fresh = replaced(tool, terms, part - tool.low + 1, fell)
    for _ in range(tool.low):
        fresh = used(fresh, terms, advanced(fresh.trend, 1.0, wander_of(fresh.known(terms), fresh.trend)), None, 0.0, 0.0)
    return learned(fresh._replace(uses=0), told, shared, 0.0)._replace(uses=fresh.uses)


def _stepped(tool: Tool, trend: Trend, share: float) -> Tool:
    """Return the tool after a rise of its share of life that has lasted, as of a chipped edge."""
    trend = trend._replace(share=trend.share + share, var=trend.var + share * share)
    wide = tool.wide._replace(share=trend.share, var=trend.var)
    return tool._replace(trend=trend, wide=wide, high=0, low=0, has_stepped=True, uses=tool.uses + STEPPED_USES)


def wear_of(tool: Tool, terms: Terms) -> float:
    """Return the level of a tool over that of a sharp one."""
    life = tool.known(terms)
    return life.end * at(life.curve, tool.trend.share)


def _shaken(tool: Tool, cuts: list[Cut]) -> Tool:
    """Return the tool with the mean of its vibration over some uses."""
    logs = [log(cut.vibration_ratio) for cut in cuts if cut.vibration_ratio]
    if not logs:
        return tool
    now = sum(logs) / len(logs)
    return tool._replace(vibration=now if tool.vibration is None else tool.vibration + (now - tool.vibration) / MEMORY_USES)
