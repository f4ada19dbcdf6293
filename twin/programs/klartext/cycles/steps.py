"""The steps that cycles are made of: along the tool's axis, across it, pauses. Heights are program coordinates, mm."""

import math
from collections.abc import Iterator
from typing import Final

from twin.programs.canonical import Dwell, Linear, Position, Rapid
from twin.programs.klartext import motion
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.state import State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

ROUNDING_MM: Final = 1e-9


def height(state: State) -> float:
    """Return where the tool is along its axis."""
    return state.frame.to_program(state.position)[state.normal]


def to(state: State, level_mm: float, feed_mm_min: float = math.inf, per_rev_mm: float | None = None) -> None:
    """Move along the tool's axis; no feed: in rapid."""
    here = list(state.frame.to_program(state.position))
    here[state.normal] = level_mm
    moved = list(state.position)
    moved[state.normal] = state.frame.to_machine(tuple(here))[state.normal]
    if abs(moved[state.normal] - state.position[state.normal]) > ROUNDING_MM:
        go(state, tuple(moved), feed_mm_min, per_rev_mm)


def go(state: State, end: Position, feed_mm_min: float = math.inf, per_rev_mm: float | None = None) -> None:
    """Move to a machine position; no feed: in rapid."""
    state.checked(end)
    if math.isinf(feed_mm_min):
        motion.add(state, Rapid(state.line, end, state.program))
    else:
        motion.add(state, Linear(state.line, end, feed_mm_min, per_rev_mm, state.program))


def across(state: State, first_mm: float, second_mm: float, feed_mm_min: float = math.inf) -> None:
    """Move in the working plane to program coordinates."""
    end = placed_in_plane(state, first_mm, second_mm)
    if math.dist(end, state.position) > ROUNDING_MM:
        go(state, end, feed_mm_min)


def placed_in_plane(state: State, first_mm: float, second_mm: float) -> Position:
    """The machine position over that point of the working plane, at the height where the tool is."""
    here = list(state.frame.to_program(state.position))
    first, second, _ = PLANES[state.plane]
    here[first], here[second] = first_mm, second_mm
    return state.frame.to_machine(tuple(here))


def in_plane(state: State) -> tuple[float, float]:
    """Program coordinates of the tool in the working plane."""
    here = state.frame.to_program(state.position)
    first, second, _ = PLANES[state.plane]
    return here[first], here[second]


def pause(state: State, seconds: float) -> None:
    if seconds > 0.0:
        state.emit(Dwell(state.line, seconds, state.program))


def begin(state: State, cycle: Definition) -> float:
    """In rapid to the set-up clearance above the surface; returns it."""
    clearance = cycle.surface_mm() + cycle.length(200, 0.0)
    state.take_length()
    to(state, clearance)
    return clearance


def finish(state: State, cycle: Definition) -> None:
    """In rapid to the second set-up clearance, which counts where it is not below the first."""
    if cycle.length(204) >= cycle.length(200):
        to(state, cycle.surface_mm() + cycle.length(204))


def pecks(state: State, cycle: Definition, total_mm: float, first_mm: float, less_mm: float, least_mm: float) -> Iterator[float]:
    """The depths that are reached one after the other, the last one being the whole.

    Each plunge is `less_mm` smaller than the one before, down to `least_mm`.
    """
    done, count = 0.0, 0
    while done < total_mm:
        size = first_mm if less_mm <= 0.0 else max(first_mm - count * less_mm, least_mm)
        if size <= 0.0:
            raise cycle.refusal(205 if count else 202, f"a plunging depth is more than 0 in {cycle.text}")
        count += 1
        if count > state.settings.pecks_max:
            raise RefusedError(cycle.text, f"makes more than {state.settings.pecks_max} plunges; Settings.pecks_max")
        # A remainder that is only rounding is no plunge of its own.
        done = total_mm if done + size > total_mm - ROUNDING_MM else done + size
        yield done
