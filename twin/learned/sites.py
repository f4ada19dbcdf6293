"""The sites of learned terms: what a term there is added to, in which unit, and what it is put on.

A term has the unit and the sign of what it is added to: a force on an axis pushes towards +, friction resists motion, and a term
of the cut is a specific cutting force on top of K_t (on nothing) or a force on the tool in one direction (on x or y).
"""

from collections.abc import Iterable

from twin.errors import EffectError
from twin.learned.words import LearnedSite

QUANTITIES = {
    LearnedSite.AXIS_FORCE: {"external_force_n": 1.0},
    LearnedSite.FRICTION: {"friction_n": 1.0, "breakaway_n": 1.0},
    LearnedSite.CONTROLLER: {"torque_command_a": 1.0},
    LearnedSite.TABLE_POSITION: {"table_mm": 1.0},
}
"""Site → quantities of the axis kernel that a term there is added to, with its sign: a force of + pushes towards +."""
MACHINE_QUANTITIES = {
    LearnedSite.SPINDLE_POWER: {"electrical_power_kw": 1.0},
    LearnedSite.HEAT_INPUT: {"heat_w": 1.0},
    LearnedSite.HEAT_LOSS: {"heat_w": -1.0},
}
"""Site → quantities of the spindle's kernels, likewise: a loss of + cools."""
READINGS = {
    LearnedSite.POSITION_READING: "pos_mm",
    LearnedSite.TABLE_READING: "table_mm",
    LearnedSite.TORQUE_READING: "torque_a",
}
"""Site → column, without the letter, whose reading a term there is added to."""
MACHINE_READINGS = {
    LearnedSite.FORCE_READING: ("force_x_n", "force_y_n"),
    LearnedSite.TEMPERATURE_READING: ("spindle_temp_c",),
}
"""Site → columns of the machine as a whole whose readings a term there may be added to."""
AXIS_SITES = (LearnedSite.CONTROLLER, LearnedSite.AXIS_FORCE, LearnedSite.FRICTION, LearnedSite.TABLE_POSITION)
UNITS = {
    LearnedSite.CONTROLLER: ("A",),
    LearnedSite.AXIS_FORCE: ("N",),
    LearnedSite.FRICTION: ("N",),
    LearnedSite.TABLE_POSITION: ("mm",),
    LearnedSite.POSITION_READING: ("mm",),
    LearnedSite.TABLE_READING: ("mm",),
    LearnedSite.TORQUE_READING: ("A",),
    LearnedSite.CUT_FORCE: ("N/mm²", "N"),
    LearnedSite.FORCE_READING: ("N",),
    LearnedSite.SPINDLE_POWER: ("kW",),
    LearnedSite.HEAT_INPUT: ("W",),
    LearnedSite.HEAT_LOSS: ("W",),
    LearnedSite.TEMPERATURE_READING: ("°C", "K"),
    LearnedSite.PROGRAM_TIME: ("s",),
}
"""Site → its units; of the cut the second one where it is a force in one direction. Those of rotary axes: `twin.rotary`."""
DIRECTIONS = ("x", "y")


def unit_at(site: LearnedSite, on: str = "") -> str:
    """Return the unit of a term.

    >>> unit_at(LearnedSite.CUT_FORCE), unit_at(LearnedSite.CUT_FORCE, "x")
    ('N/mm²', 'N')
    """
    return UNITS[site][1 if site is LearnedSite.CUT_FORCE and on else 0]


def check_place(site: LearnedSite, on: str, axes: Iterable[str]) -> None:
    """Raises EffectError where a term at this site cannot be put on this."""
    letters = tuple(axes)
    if site in AXIS_SITES:
        right: tuple[str, ...] = letters
    elif site in READINGS:
        right = tuple(name for letter in letters for name in (letter, f"{letter}_{READINGS[site]}"))
    elif site in MACHINE_READINGS:
        right = MACHINE_READINGS[site] + (() if site is LearnedSite.FORCE_READING else ("",))
    else:
        right = ("", *((*DIRECTIONS, *MACHINE_READINGS[LearnedSite.FORCE_READING]) if site is LearnedSite.CUT_FORCE else ()))
    if on not in right:
        there = ", ".join(name or "nothing (leave `on` out)" for name in right) or "no axis of this machine"
        raise EffectError(f"a learned term at {site.value} is put on {on!r}; it can be on {there}")
