"""What an hour has to hold, each as a function that lists what does not hold.

The truth is the list of states that the control showed. A look shows one moment somewhere between question and answer.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator

from cnctwin.standins.focas_server.shown import CodedState
from cnctwin.standins.simulated_control.state import ToolChange, tool_changes
from edge.controls.focas.connection import HOLE_INTERVALS
from tests.edge.controls.changes_told import changes_told
from tests.edge.controls.focas.machine_hour import SWITCHED_ON_S, Hour

INTERVAL_S = 0.2
ROUNDED_S = 0.002  # two stamps in whole milliseconds
AT_REST = frozenset({"READY", "PROGRAM_COMPLETED"})
"""FOCAS has one word for both; an edge can tell them by the M30 that stands, where it can read that."""
Shown = Callable[[CodedState], object]


def _axis(at: int) -> dict[str, Shown]:
    letter = "xyz"[at]
    return {
        f"axis_{letter}_pos_mm": lambda state: round(state.axis_pos_mm[at], 3),
        f"axis_{letter}_load_pct": lambda state: round(state.axis_load_pct[at]),
    }


SHOWN: dict[str, Shown] = {
    "spindle_rpm": lambda state: round(state.spindle_rpm),
    "spindle_load_pct": lambda state: round(state.spindle_load_pct),
    "feed_mm_min": lambda state: round(state.feed_mm_min),
    "feed_override_pct": lambda state: state.feed_override_pct,
    "rapid_override_pct": lambda state: state.rapid_override_pct,
    "spindle_override_pct": lambda state: state.spindle_override_pct,
    "program": lambda state: state.program,
    "nc_block": lambda state: state.block,
    "nc_line": lambda state: state.line,
    "exec_state": lambda state: state.exec_state if state.exec_state == "ACTIVE" else AT_REST,
    "controller_mode": lambda state: state.mode,
    "alarm": lambda state: "" if state.alarm is None else state.alarm[1],
} | {name: shown for at in range(3) for name, shown in _axis(at).items()}
"""Each signal as the control shows it, which knows whole numbers of most things."""


def holes(hour: Hour) -> list[tuple[float, float]]:
    """The times in which nothing could be had, as stated."""
    return [(gap.first_sequence / 1000 - SWITCHED_ON_S, gap.last_sequence / 1000 - SWITCHED_ON_S) for gap in hour.gaps]


def looks_outside_of_holes(hour: Hour) -> list[str]:
    """Looks that were not made, or had no answer, and that no hole states."""
    stated = holes(hour)

    def lies_in_one(from_s: float, to_s: float) -> bool:
        return any(a - ROUNDED_S <= from_s and to_s <= b + ROUNDED_S for a, b in stated)

    found = [f"lost look at {look.from_s:.2f}" for look in hour.looks if look.is_lost and not lies_in_one(look.from_s, look.to_s)]
    for before, after in zip(hour.sweep_s, hour.sweep_s[1:], strict=False):
        if after - before > HOLE_INTERVALS * INTERVAL_S + ROUNDED_S and not lies_in_one(before, after):
            found.append(f"no look from {before:.2f} to {after:.2f}")
    return found


def holes_that_are_none(hour: Hour) -> list[str]:
    """Holes that do not lie between one look and the next, or that say too little of what they may have held."""
    found = list[str]()
    for (from_s, to_s), gap in zip(holes(hour), hour.gaps, strict=True):
        at = bisect_left(hour.sweep_s, from_s - ROUNDED_S)
        if (
            at + 1 >= len(hour.sweep_s)
            or abs(hour.sweep_s[at] - from_s) > ROUNDED_S
            or abs(hour.sweep_s[at + 1] - to_s) > ROUNDED_S
        ):
            found.append(f"{gap.reason}: {from_s:.2f} to {to_s:.2f}")
        if gap.lost < max(1, round((to_s - from_s) / INTERVAL_S) - 1):
            found.append(f"{gap.reason}: {gap.lost} lost in {to_s - from_s:.2f} s")
    return found


def values_that_were_not_shown(hour: Hour) -> list[str]:
    """Published values that the control did not show while it was asked, and nulls for which there was no fault."""
    found = list[str]()
    for sample in hour.samples:
        at_s = sample.timestamp_ms / 1000 - SWITCHED_ON_S
        if sample.signal not in SHOWN or not sample.observations:
            continue
        if sample.value is None:
            if not any(
                a - 0.1 <= at_s <= b + 1.0 for a, b, kind in hour.episodes if kind.startswith(("partial", "wrong: codes"))
            ):
                found.append(f"{sample.signal} null at {at_s:.2f}: {sample.reason}")
            continue
        look = hour.look_at(at_s)
        shown = {SHOWN[sample.signal](state) for state in hour.shown(look.from_s - ROUNDED_S, look.to_s + ROUNDED_S)}
        value = AT_REST if sample.signal == "exec_state" and sample.value in AT_REST else sample.value
        if value not in shown:
            found.append(f"{sample.signal} {sample.value!r} at {at_s:.2f}, shown was {shown}")
    return found


def changes_seen(hour: Hour) -> list[ToolChange]:
    """The true changes that no hole touches, and that are over before the last looks."""
    stated = holes(hour)
    return [
        change
        for change in tool_changes(hour.states)
        if change.to_s < hour.sweep_s[-1] - 3.0 and not any(a <= change.to_s and change.from_s <= b for a, b in stated)
    ]


def changes_told_wrongly(hour: Hour) -> list[str]:
    """Changes that were seen and not told from the first look that shows them to the first that shows the end."""
    told, found = changes_told(hour.samples, SWITCHED_ON_S), list[str]()
    for change in changes_seen(hour):
        overlapping = [(a, b) for a, b in told if a <= change.to_s and change.from_s <= b]
        if len(overlapping) != 1:
            found.append(f"{change} was told as {overlapping}")
            continue
        ((onset_s, end_s),) = overlapping
        for name, at_s, true_s in (("onset", onset_s, change.from_s), ("end", end_s, change.to_s)):
            first_s, last_s = next_look(hour, true_s)
            if not first_s - ROUNDED_S <= at_s <= last_s + ROUNDED_S:
                found.append(f"{name} of {change} told at {at_s:.2f}, not between {first_s:.2f} and {last_s:.2f}")
    return found


def changes_made_up(hour: Hour) -> list[str]:
    """Changes told in which there was none."""
    true = tool_changes([*hour.states, _over(hour.states[-1])])
    return [
        f"{a:.2f} to {b:.2f}"
        for a, b in changes_told(hour.samples, SWITCHED_ON_S)
        if not any(a <= next_look(hour, change.to_s)[1] and next_look(hour, change.from_s)[0] <= b for change in true)
    ]


def tool_numbers_that_are_not_in_the_spindle(hour: Hour) -> Iterator[str]:
    """Times at which the number that stands published is not that of the tool; while a change is in progress both are right."""
    told = _numbers(hour)
    times = [at_s for at_s, _ in told]
    for at_s in hour.sweep_s:
        look = hour.look_at(at_s)
        states = hour.shown(look.from_s, look.to_s)
        at = bisect_left(times, at_s + ROUNDED_S) - 1
        if at < 0 or told[at][1] is None or any(state.is_changing_tool for state in states):
            continue
        if told[at][1] not in {state.tool_number for state in states}:
            yield f"{told[at][1]} stands at {at_s:.2f}, in the spindle is {states[-1].tool_number}"


def tools_not_told(hour: Hour) -> list[str]:
    """Changes that were seen and at whose end neither the new tool's number is told nor that it is not known."""
    told = _numbers(hour)
    found = list[str]()
    for change in changes_seen(hour):
        (_, last_s), at = next_look(hour, change.to_s), len(told) - 1
        while at > 0 and told[at][0] > last_s + ROUNDED_S:
            at -= 1
        if told[at][1] is not None and (told[at][1] != change.tool_number or told[at][0] < change.from_s - ROUNDED_S):
            found.append(f"{change}, {told[at][1]} stands since {told[at][0]:.2f}")
    return found


def _numbers(hour: Hour) -> list[tuple[float, object]]:
    numbers = [sample for sample in hour.samples if sample.signal == "tool_number"]
    return sorted(((sample.timestamp_ms / 1000 - SWITCHED_ON_S, sample.value) for sample in numbers), key=lambda entry: entry[0])


def next_look(hour: Hour, at_s: float) -> tuple[float, float]:
    """When the first look is stamped that may show what begins at this time, and when the first that must."""
    may = must = bisect_left(hour.sweep_s, at_s)
    while may > 0 and hour.look_at(hour.sweep_s[may - 1]).to_s >= at_s:
        may -= 1
    while must < len(hour.sweep_s) and hour.look_at(hour.sweep_s[must]).from_s < at_s:
        must += 1
    return _stamp(hour, may), _stamp(hour, must)


def _stamp(hour: Hour, number: int) -> float:
    return hour.sweep_s[number] if number < len(hour.sweep_s) else float("inf")


def _over(state: CodedState) -> CodedState:
    """A change that the hour cuts off is one nevertheless."""
    return CodedState(at_s=state.at_s + 10.0, tool_number=state.tool_number)
