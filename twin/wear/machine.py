"""The wear of all tools of a machine: cuts come in, parts are judged when they have ended.

A part is what its cuts have in common, program and number. It is judged when a cut of another part comes: first what all tools share
(twin/wear/material.py), then each tool by what is left (twin/wear/tool.py). A tool is taken to be replaced when its level has fallen
back to that of a sharp one, and the others have not, in two of its parts in a row.
"""

from collections.abc import Mapping
from math import log
from typing import NamedTuple

from twin.wear.curve import at, slope
from twin.wear.cut import Cut
from twin.wear.material import Explained, Material, Seen, explained, followed
from twin.wear.terms import Terms
from twin.wear.tool import (
    MEMORY_USES,
    REPLACED_USES,
    STEPPED_USES,
    Level,
    Told,
    Tool,
    learned,
    level_of,
    new_tool,
    replaced,
    used,
    wander_of,
)
from twin.wear.trend import advanced

TOOLS_MAX = 120
CUTS_MAX = 200
ANCHORS_MIN = 2
DUE = 0.7
ODD_OFF = 4.0
REPLACED_MIN = 0.04
"""Less wear than this can't be told from the spread of sharp tools: its replacement is not looked for."""


class Wear(NamedTuple):
    """The state of a machine's tools, by number as text. parts: that were judged; cuts: of the part that runs; at_s: its last end

    anchors: tools of the last part whose sharp level is known, by which material and wear are told apart
    """

    tools: Mapping[str, Tool] = {}
    material: Material = Material()
    cuts: tuple[Cut, ...] = ()
    parts: int = 0
    at_s: float = 0.0
    anchors: int = 0


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
    told = {name: _told(own) for name, own in cuts.items()}
    levels = {name: level_of(tools[name], told[name].logs, _wear(tools[name], terms)) for name in cuts}
    names = [name for name in cuts if levels[name] is not None]
    found = explained([_seen(tools[name], levels[name], terms) for name in names], wear.material, terms)
    anchors = sum(tools[name].sharp_lives > 0 for name in names)
    for name, own in cuts.items():
        place = names.index(name) if name in names else None
        tools[name] = _after(tools[name], terms, told[name], levels[name], found, place, wear.parts)
        tools[name] = _shaken(tools[name]._replace(seen_s=at_s), own)
    all_tools = {**wear.tools, **tools}
    for name in sorted(all_tools, key=lambda one: all_tools[one].seen_s)[: max(len(all_tools) - TOOLS_MAX, 0)]:
        del all_tools[name]
    material = followed(wear.material, found, terms) if names else wear.material
    return Wear(all_tools, material, (), wear.parts + 1, at_s, anchors)


def _told(cuts: list[Cut]) -> Told:
    logs = {cut.operation: log(cut.load_ratio) for cut in cuts if cut.load_ratio}
    return Told(logs, {cut.operation: cut.load_ratio_sd for cut in cuts if cut.load_ratio_sd})


def _seen(tool: Tool, level: Level | None, terms: Terms) -> Seen:
    """Return a tool as the explanation of a part takes it."""
    assert level is not None
    life = tool.known(terms)
    trend = advanced(tool.trend, 1.0, wander_of(life, tool.trend))
    wear, steep = life.end * at(life.curve, trend.share), life.end * slope(life.curve, trend.share)
    var = steep * steep * trend.var
    if tool.is_learning:
        return Seen(level.level, level.noise, 0.0, terms.sharp**2)
    can_be_new = tool.sharp_lives > 0 and wear > REPLACED_MIN
    return Seen(level.level, level.noise, level.gain * wear, level.gain**2 * var, terms.sharp**2 if can_be_new else None, trend.share > DUE)


def _after(
    tool: Tool,
    terms: Terms,
    told: Told,
    level: Level | None,
    found: Explained,
    place: int | None,
    part: int,
) -> Tool:
    """Return a tool after a part of which this much is shared."""
    if place is None or level is None:
        return used(learned(tool, told, found.level, _wear(tool, terms)), terms, None, found.level, found.var)
    off = found.off(place)
    if place in found.replaced or (off < -ODD_OFF and not tool.is_learning):
        low = tool.low + 1
        if low < (REPLACED_USES if place in found.replaced else STEPPED_USES):
            return tool._replace(low=low, high=0, trend=advanced(tool.trend, 1.0, wander_of(tool.known(terms), tool.trend)))
        fell = _wear(tool, terms) - (level.level - found.level) / level.gain
        fresh = replaced(tool, terms, part - low + 1, fell)
        for _ in range(low):
            fresh = used(fresh, terms, None, 0.0, 0.0)
        return learned(fresh, told, found.level, 0.0) if not fresh.sharp_lives else fresh
    if off > ODD_OFF and not tool.is_learning:
        if tool.high + 1 < STEPPED_USES:
            return tool._replace(high=tool.high + 1, low=0)
        rise = (level.level - found.level) / level.gain - _wear(tool, terms)
        share = rise / tool.known(terms).end
        trend = tool.trend._replace(share=tool.trend.share + share, var=tool.trend.var + share * share)
        wide = tool.wide._replace(share=tool.wide.share + share, var=tool.wide.var + share * share)
        return tool._replace(trend=trend, wide=wide, high=0, low=0, has_stepped=True, uses=tool.uses + STEPPED_USES)
    shared, shared_var = found.without(place)
    after = used(tool, terms, level, shared, shared_var)
    wear = 0.0 if tool.is_learning else _wear(after, terms)
    return learned(after._replace(uses=tool.uses), told, found.level, wear)._replace(uses=after.uses, low=0, high=0)


def _wear(tool: Tool, terms: Terms) -> float:
    life = tool.known(terms)
    return life.end * at(life.curve, tool.trend.share)


def _shaken(tool: Tool, cuts: list[Cut]) -> Tool:
    """Return the tool with the mean of its vibration over some uses."""
    logs = [log(cut.vibration_ratio) for cut in cuts if cut.vibration_ratio]
    if not logs:
        return tool
    now = sum(logs) / len(logs)
    return tool._replace(vibration=now if tool.vibration is None else tool.vibration + (now - tool.vibration) / MEMORY_USES)
