"""The words of a learned term: the sites where it may act, and the variables that it may depend on (formats, section 6)."""

from enum import StrEnum

from twin.errors import EffectError


class LearnedSite(StrEnum):
    """The place in the machine where a learned term acts."""

    CONTROLLER = "controller"
    AXIS_FORCE = "axis_force"
    FRICTION = "friction"
    TABLE_POSITION = "table_position"
    POSITION_READING = "position_reading"
    TABLE_READING = "table_reading"
    TORQUE_READING = "torque_reading"
    CUT_FORCE = "cut_force"
    FORCE_READING = "force_reading"
    SPINDLE_POWER = "spindle_power"
    HEAT_INPUT = "heat_input"
    HEAT_LOSS = "heat_loss"
    TEMPERATURE_READING = "temperature_reading"
    PROGRAM_TIME = "program_time"


WORDS = {
    "position_mm": "position",
    "velocity_mm_s": "velocity",
    "direction": "direction",
    "acceleration_mm_s2": "acceleration",
    "torque_a": "load",
    "load_pct": "load",
    "spindle_angle_rad": "spindle_angle",
    "spindle_rpm": "spindle_rpm",
    "chip_mm": "chip",
    "axial_depth_mm": "chip",
    "temperature_c": "temperature",
    "temperature_rise_k": "temperature",
    "coolant_on": "coolant",
    "time_since_start_s": "time_since_start",
    "t_s": "time",
}
"""Column of a table → the word of it in `depends_on`."""
OF_AXIS = ("position_mm", "velocity_mm_s", "acceleration_mm_s2")
"""Columns of another axis, behind its letter: `y_acceleration_mm_s2`."""
PERIODS = {"spindle_angle_rad": 6.283185307179586}
"""Columns that come round again, with their period."""
TIME = "t_s"


def word_of(column: str) -> str:
    """Return the word of an argument column.

    Raises EffectError where there is no such column.

    >>> word_of("position_mm"), word_of("y_acceleration_mm_s2")
    ('position', 'axis:y')
    """
    if column in WORDS:
        return WORDS[column]
    letter, _, rest = column.partition("_")
    if letter and rest in OF_AXIS:
        return f"axis:{letter}"
    raise EffectError(
        f"a learned term cannot depend on {column!r}; it can on {', '.join(WORDS)}, or on another axis as y_{OF_AXIS[0]}"
    )
