"""Cycles 200, 201, 203, 205, 240, 241: drilling, reaming, centring (Cycle Programming TNC 640, "Fixed cycles: drilling").

Every one goes in rapid to the set-up clearance Q200 above the surface Q203, does its work, and ends at the set-up clearance or,
in rapid, at the second one, Q204.
"""

from typing import Final

from twin.programs.klartext import spindle
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.state import State

CHIP_RETRACT_MM_MIN: Final = 3000.0
"""The feed at which a chip is broken (205, Q256)."""


def tip_only(cycle: Definition) -> None:
    """The depth counts to the tool's tip; to the full diameter it would need the point angle of the tool table."""
    if cycle.number_of(395, 0, 1) == 1:
        raise cycle.refusal(395, "needs the point angle of the tool, which is not known; write 0 and a depth to the tip")


def drilling(state: State, cycle: Definition) -> None:
    """200: out to the set-up clearance in rapid after each plunge, back in rapid to Q200 above the last depth."""
    tip_only(cycle)
    total, surface, clear = cycle.depth_mm(), cycle.surface_mm(), cycle.length(200, 0.0)
    if total == 0.0:
        return
    feed, first = cycle.cutting_feed(206), cycle.length(202)
    clearance = steps.begin(state, cycle)
    done = 0.0
    for depth in steps.pecks(state, cycle, total, first, 0.0, 0.0):
        if done > 0.0:
            steps.to(state, clearance)
            steps.pause(state, cycle.seconds(210))
            steps.to(state, surface - done + clear)
        steps.to(state, surface - depth, feed)
        done = depth
    steps.pause(state, cycle.seconds(211))
    steps.to(state, clearance)
    steps.finish(state, cycle)


def reaming(state: State, cycle: Definition) -> None:
    """201: in with Q206, a pause, out with Q208; Q208 = 0 is Q206."""
    total = cycle.depth_mm()
    if total == 0.0:
        return
    feed, back = cycle.cutting_feed(206), cycle.feed(208, instead=206)
    clearance = steps.begin(state, cycle)
    steps.to(state, cycle.surface_mm() - total, feed)
    steps.pause(state, cycle.seconds(211))
    steps.to(state, clearance, back)
    steps.finish(state, cycle)


def universal_drilling(state: State, cycle: Definition) -> None:
    """203: plunges that grow smaller by Q212 down to Q205; Q213 times a chip is broken by Q256 before the tool comes out."""
    tip_only(cycle)
    total, surface, clear = cycle.depth_mm(), cycle.surface_mm(), cycle.length(200, 0.0)
    if total == 0.0:
        return
    feed, back = cycle.cutting_feed(206), cycle.feed(208, instead=206)
    breaks, retract = cycle.number_of(213, 0, 99_999), cycle.length(256, 0.0)
    clearance = steps.begin(state, cycle)
    done, broken = 0.0, 0
    plunges = steps.pecks(state, cycle, total, cycle.length(202), cycle.length(212, 0.0), cycle.length(205, 0.0))
    for depth in plunges:
        if done > 0.0 and broken < breaks:
            broken += 1
            steps.to(state, surface - done + retract, CHIP_RETRACT_MM_MIN)
        elif done > 0.0:
            broken = 0
            steps.to(state, clearance, back)
            steps.pause(state, cycle.seconds(210))
            steps.to(state, surface - done + clear)
        steps.to(state, surface - depth, feed)
        done = depth
    steps.pause(state, cycle.seconds(211))
    steps.to(state, clearance, back)
    steps.finish(state, cycle)


def universal_pecking(state: State, cycle: Definition) -> None:
    """205: back in rapid to the advanced stop distance, from Q258 at the second plunge to Q259 at the last; chips are broken
    every Q257; from a deepened starting point Q379 on."""
    tip_only(cycle)
    total, surface, clear = cycle.depth_mm(), cycle.surface_mm(), cycle.length(200, 0.0)
    if total == 0.0:
        return
    feed, back, start = cycle.cutting_feed(206), cycle.feed(208, instead=206), cycle.length(379, 0.0)
    if start >= total:
        raise cycle.refusal(379, "the starting point lies below the depth Q201")
    first, last = cycle.length(258, 0.0), cycle.length(259, 0.0)
    clearance = steps.begin(state, cycle)
    if start > 0.0:
        steps.to(state, surface - start + clear, cycle.feed(253))
    plunges = steps.pecks(state, cycle, total - start, cycle.length(202), cycle.length(212, 0.0), cycle.length(205, 0.0))
    depths = [start + depth for depth in plunges]
    done = start
    for at, depth in enumerate(depths):
        if at > 0:
            share = (at - 1) / (len(depths) - 2) if len(depths) > 2 else 0.0
            steps.to(state, clearance)
            steps.to(state, surface - done + first + (last - first) * share)
        plunge(state, cycle, done, depth, feed)
        done = depth
    steps.pause(state, cycle.seconds(211))
    steps.to(state, clearance, back)
    steps.finish(state, cycle)


def plunge(state: State, cycle: Definition, done_mm: float, depth_mm: float, feed: float) -> None:
    """One plunge of 205, with a chip broken every Q257."""
    surface, every, retract = cycle.surface_mm(), cycle.length(257, 0.0), cycle.length(256, 0.0)
    if every <= 0.0:
        steps.to(state, surface - depth_mm, feed)
        return
    for part in steps.pecks(state, cycle, depth_mm - done_mm, every, 0.0, 0.0):
        steps.to(state, surface - done_mm - part, feed)
        if done_mm + part < depth_mm - steps.ROUNDING_MM:
            steps.to(state, surface - done_mm - part + retract, CHIP_RETRACT_MM_MIN)


def centring(state: State, cycle: Definition) -> None:
    """240: to the depth Q201; to a diameter it would need the point angle of the tool table."""
    if cycle.number_of(343, 0, 1) == 1:
        raise cycle.refusal(343, "needs the point angle of the tool, which is not known; write 0 and a depth")
    total = cycle.depth_mm()
    if total == 0.0:
        return
    clearance = steps.begin(state, cycle)
    steps.to(state, cycle.surface_mm() - total, cycle.cutting_feed(206))
    steps.pause(state, cycle.seconds(211))
    steps.to(state, clearance)
    steps.finish(state, cycle)


def deep_drilling(state: State, cycle: Definition) -> None:
    """241: to the starting point Q379 with Q253 and the speed Q427, on to the depth with Q206 and the speed Q428."""
    tip_only(cycle)
    if cycle.values.get(435, 0.0) != 0.0 or cycle.values.get(202, 0.0) != 0.0:
        raise cycle.refusal(435 if cycle.values.get(435) else 202, f"is not modelled in {cycle.text}; write 0")
    total, surface, clear = cycle.depth_mm(), cycle.surface_mm(), cycle.length(200, 0.0)
    if total == 0.0:
        return
    start, feed = cycle.length(379, 0.0), cycle.cutting_feed(206)
    into, drill = cycle.value(427), cycle.value(428)
    clearance = steps.begin(state, cycle)
    state.rpm = into
    spindle.turn(state, {3: 1, 4: -1, 5: 0}[cycle.number_of(426, 3, 5)])
    steps.to(state, surface - start + (clear if start == 0.0 else 0.0), cycle.feed(253))
    state.rpm = drill
    spindle.turn(state, 1)
    spindle.coolant(state, True)
    steps.to(state, surface - total, feed)
    steps.pause(state, cycle.seconds(211))
    spindle.coolant(state, False)
    state.rpm = into
    spindle.turn(state, 1)
    steps.to(state, clearance, cycle.feed(208, instead=206))
    steps.finish(state, cycle)
