"""Part programs: FANUC-type mill dialect in, canonical moves out."""

from twin.gcode.canonical import (
    Arc,
    Coolant,
    Dwell,
    ExactStop,
    Linear,
    LookAhead,
    Move,
    Position,
    ProgramEnd,
    ProgramStop,
    Rapid,
    Spindle,
    SpindleOrient,
    ToolChange,
    ToolLength,
)
from twin.gcode.interpreter import interpret
from twin.gcode.settings import DwellUnit, IntegerWords, LeadIn, OffsetLookup, OutsideCorner, Settings, ToolOffset

__all__ = [
    "Arc",
    "Coolant",
    "Dwell",
    "DwellUnit",
    "ExactStop",
    "IntegerWords",
    "LeadIn",
    "Linear",
    "LookAhead",
    "Move",
    "OffsetLookup",
    "OutsideCorner",
    "Position",
    "ProgramEnd",
    "ProgramStop",
    "Rapid",
    "Settings",
    "Spindle",
    "SpindleOrient",
    "ToolChange",
    "ToolLength",
    "ToolOffset",
    "interpret",
]
