"""The columns that a run log can have: name, unit, kind, and whether a value holds until the next."""

from enum import Enum

from cnctwin.memory.store.run_export import column_name
from twin.rotary import inside_column
from twin.runlog import AXIS_COLUMN, TEXT_COLUMNS
from twin.vocabulary.signals import canonical

STATES = frozenset(
    {
        *("line", "tool_number", "tool_change_active", "coolant_on", "exec_state", "program"),
        *("feed_override_pct", "rapid_override_pct", "spindle_override_pct", "spindle_rpm_cmd"),
    }
)
"""Reported when they change and valid until then: a file that follows begins with what the one before ended with."""
FLAGS = frozenset({"coolant_on", "tool_change_active"})
TORQUE = "torque"
_ENDINGS = (
    ("_torque_a", TORQUE),
    ("_rpm", "rev/min"),
    ("_rpm_cmd", "rev/min"),
    ("_mm_min", "mm/min"),
    ("_mm_s", "mm/s"),
    ("_mm", "mm"),
    ("_deg", "deg"),
    ("_rad", "rad"),
    ("_pct", "%"),
    ("_kw", "kW"),
    ("_a", "A"),
    ("_n", "N"),
    ("_c", "°C"),
    ("_g", "g"),
)


class Kind(Enum):
    """The kind of a column's values."""

    NUMBER = "number"
    FLAG = "flag"
    TEXT = "text"


def run_column(name: str) -> str | None:
    """Return the column of a run log that a name is, of a column or of a canonical signal; None where it is none.

    >>> run_column("x_torque_a"), run_column("axis_b_pos_deg"), run_column("b_ref_deg"), run_column("Fx")
    ('x_torque_a', 'b_pos_deg', 'b_ref_deg', None)
    """
    if name == "t_s":
        return None
    return column_name(name) or (name if AXIS_COLUMN.match(inside_column(name)) else None)


def kind_of(column: str) -> Kind:
    """Return the kind of a column's values."""
    return Kind.TEXT if column in TEXT_COLUMNS else Kind.FLAG if column in FLAGS else Kind.NUMBER


def unit_of(column: str) -> str:
    """Return the unit of a column, as `cnctwin/importing/units.py` names it; "" where it has none.

    >>> unit_of("x_ref_mm"), unit_of("x_torque_a"), unit_of("spindle_current_a"), unit_of("tool_number")
    ('mm', 'torque', 'A', '')
    """
    if kind_of(column) is not Kind.NUMBER:
        return ""
    return next((unit for ending, unit in _ENDINGS if column.endswith(ending)), "")


def bounds_of(column: str) -> tuple[float, float] | None:
    """Return the bounds within which a column's values can be; None where nothing bounds them."""
    known = canonical("nc_line" if column == "line" else column)
    return None if known is None or known.low is None or known.high is None else (known.low, known.high)
