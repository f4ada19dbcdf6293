"""Learned terms in plain words: what is there, how large it is, over what, and whether it repeats. No word of a cause."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.gap.wording import digits
from twin.learned.sites import unit_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite, word_of

Floats = NDArray[np.float64]
S = LearnedSite
SITE_WORDS: Mapping[LearnedSite, str] = {
    S.CONTROLLER: "an addition to the torque command",
    S.AXIS_FORCE: "a force",
    S.FRICTION: "an additional friction",
    S.TABLE_POSITION: "a displacement of the table",
    S.POSITION_READING: "an error of the position reading",
    S.TABLE_READING: "an error of the table reading",
    S.TORQUE_READING: "an error of the torque reading",
    S.CUT_FORCE: "an additional cutting force",
    S.FORCE_READING: "an error of the force reading",
    S.SPINDLE_POWER: "an additional power of the spindle",
    S.HEAT_INPUT: "an additional heat input",
    S.HEAT_LOSS: "an additional heat loss",
    S.TEMPERATURE_READING: "an error of the temperature reading",
    S.PROGRAM_TIME: "additional time of the program",
}
OVER: Mapping[str, tuple[str, str]] = {
    "position_mm": ("position", "mm"),
    "velocity_mm_s": ("velocity", "mm/s"),
    "direction": ("direction", ""),
    "acceleration_mm_s2": ("acceleration", "mm/s²"),
    "torque_a": ("load", "A"),
    "load_pct": ("load", "%"),
    "spindle_angle_rad": ("spindle angle", "rad"),
    "spindle_rpm": ("spindle speed", "rev/min"),
    "chip_mm": ("chip", "mm"),
    "axial_depth_mm": ("depth of cut", "mm"),
    "temperature_c": ("temperature", "°C"),
    "temperature_rise_k": ("rise of the temperature over the surroundings", "K"),
    "coolant_on": ("coolant", ""),
    "time_since_start_s": ("time since the start", "s"),
    "t_s": ("time", "s"),
}
"""Column → its name and unit."""
LOCAL_PART = 0.4
"""Part of the range within which a term lies that is called local."""


def sentence(term: Term, *, repeats: bool) -> str:
    """Return what a term is, in words."""
    on = f" on {term.on.partition('_')[0].upper() if len(term.on.partition('_')[0]) == 1 else term.on}" if term.on else ""
    columns = term.knots.columns
    said = _over_one(term, columns[0]) if len(columns) == 1 else _over_two(term)
    again = " in all runs" if repeats else ", not alike in all runs"
    way = ", in both directions and" if _both_ways(term) and repeats else (", in both directions" if _both_ways(term) else "")
    return f"{SITE_WORDS[term.site]}{on} {said}{way}{',' if repeats and not way else ''}{again}"


def _both_ways(term: Term) -> bool:
    return term.knots.columns == ("position_mm",) and term.on != "" and term.site in (S.AXIS_FORCE, S.FRICTION, S.TABLE_READING)


def _over_one(term: Term, column: str) -> str:
    at, value = term.knots.by_column[column], term.value
    name, unit = over(column)
    if column == "direction":
        return f"of {_value(term, value[0])} in − and {_value(term, value[-1])} in +"
    if column == "coolant_on":
        return f"of {_value(term, value[0])} with the coolant off and {_value(term, value[-1])} with it on"
    rest = float(np.median(value))
    local = np.abs(value - rest) > 0.5 * np.abs(value - rest).max(initial=0.0)
    where = np.flatnonzero(local)
    if len(where) and where[-1] - where[0] + 1 <= LOCAL_PART * len(at) and len(where) == where[-1] - where[0] + 1:
        first, last = max(where[0] - 1, 0), min(where[-1] + 1, len(at) - 1)
        peak = value[where[np.argmax(np.abs(value[where] - rest))]]
        between = f"between {_at(column, at[first])} and {_at(column, at[last], unit)}"
        return f"of {_value(term, peak)} {between} of {name}" if column != "position_mm" else f"of {_value(term, peak)} {between}"
    low, high = int(np.argmin(value)), int(np.argmax(value))
    one, other = sorted((low, high))
    return (
        f"that goes with the {name}: {_value(term, value[one])} at {_at(column, at[one], unit)}, "
        f"{_value(term, value[other])} at {_at(column, at[other], unit)}"
    )


def _over_two(term: Term) -> str:
    names = " and the ".join(over(column)[0] for column in term.knots.columns)
    return f"that goes with the {names}: between {_value(term, term.value.min())} and {_value(term, term.value.max())}"


def over(column: str) -> tuple[str, str]:
    """Return the name and unit of an argument.

    >>> over("y_acceleration_mm_s2")
    ('acceleration of Y', 'mm/s²')
    """
    if column in OVER:
        return OVER[column]
    letter = word_of(column).removeprefix("axis:")
    name, unit = OVER[column.partition("_")[2]]
    return f"{name} of {letter.upper()}", unit


def _value(term: Term, value: float) -> str:
    """A value with its sign and unit; small lengths in µm."""
    unit = unit_at(term.site, term.on)
    if unit == "mm" and np.abs(term.value).max(initial=0.0) < 0.1:
        value, unit = 1000.0 * value, "µm"
    return f"{'+' if value > 0.0 else ''}{digits(float(value))} {unit}"


def _at(column: str, value: float, unit: str = "") -> str:
    del column
    return f"{digits(float(value))} {unit}".strip()
