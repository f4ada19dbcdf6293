"""The column of a run log that a name in a recording probably means.

A guess is sure where the name is that of the run log, or tells axis and quantity and the unit is known; anything else is drafted
for a person to check. Positions that are neither called a reference nor an actual value are taken as the feedback.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

from cnctwin.importing.dialects.contract import SourceColumn
from cnctwin.importing.dialects.layout import named
from cnctwin.importing.run_columns import TORQUE, run_column, unit_of
from cnctwin.importing.units import conversion, unit_named


class Guess(NamedTuple):
    """A column of a run log, and the unit of what comes (None: unknown, so that of the run log is only assumed)."""

    column: str
    unit: str | None
    is_sure: bool


ROTARY = "abc"
REFERENCE = {"ref", "reference", "set", "setp", "setpoint", "setval", "cmd", "command", "commanded", "soll", "sollwert"}
REFERENCE |= {"nominal", "nom", "desired", "demand", "target", "sollpos", "noml"}
ACTUAL = {
    "act",
    "actual",
    "actl",
    "ist",
    "istwert",
    "meas",
    "measured",
    "feedback",
    "fbk",
    "fb",
    "enc",
    "encoder",
    "motor",
    "istpos",
}
TABLE = {"table", "direct", "scale", "linear", "secondary", "2nd", "enc2", "encoder2", "glass"}
POSITION = {"pos", "position", "posn", "actpos", "setpos", "sollpos", "istpos", "poserr", "lage"}
CURRENTS = {"current", "curr", "strom", "iq", "isq"}
TORQUES = {"torque", "trq", "tcmd", "moment", "drehmoment"} | CURRENTS
OTHER_MOTION = {
    "vel",
    "velo",
    "velocity",
    "speed",
    "geschwindigkeit",
    "acc",
    "acceleration",
    "jerk",
    "lag",
    "error",
    "err",
    "diff",
}
OTHER_MOTION |= {
    "dev",
    "deviation",
    "following",
    "difference",
    "contour",
    "schleppabstand",
    "schleppfehler",
    "feedforward",
    "limit",
}
SPINDLE = {"spindle", "sp", "spdl", "spindel", "s1", "smode"}
TIME = {"time", "t", "timestamp", "zeit", "datetime", "date", "stamp", "ts", "elapsed", "seconds", "sampletime"}
_WORDS = REFERENCE | ACTUAL | TABLE | POSITION | TORQUES | {"load", "force", "temp", "power"}
_LONGEST = "|".join(sorted(map(re.escape, _WORDS), key=len, reverse=True))
_JOINED = re.compile(rf"^(?:([xyz])({_LONGEST})|({_LONGEST})([xyz]))$")
_SECOND = re.compile(r"(?i)2nd|(?:enc|encoder|geber|messsystem|measuring system)[ _.-]?2(?!\d)")
"""Words for the second measuring system, which is on the table's side."""
_UNIT_INDEX = re.compile(r"\[\s*u?\d+\s*,\s*(\d+)\s*\]|\[\s*(\d+)\s*\]")
_PLAIN: tuple[tuple[set[str], set[str], str], ...] = (
    ({"feed", "feedrate", "vorschub", "fact"}, set(), "feed_mm_min"),
    ({"coolant", "kühlmittel", "kss", "m8"}, set(), "coolant_on"),
    ({"tool", "werkzeug"}, {"number", "no", "nr", "num", "t", "nummer"}, "tool_number"),
    ({"line", "block", "seq", "satz", "n"}, {"number", "no", "nr", "num", "nummer"}, "line"),
    ({"program", "programm"}, set(), "program"),
    ({"execution", "exec"}, set(), "exec_state"),
    ({"ambient", "room", "umgebung"}, set(), "ambient_temp_c"),
    ({"vibration", "accelerometer"}, set(), "vibration_rms_g"),
)
_OF_SPINDLE = (
    ({"override", "ovr"}, "spindle_override_pct"),
    ({"load", "auslastung"}, "spindle_load_pct"),
    ({"power", "leistung"}, "spindle_power_kw"),
    ({"temp", "temperature", "temperatur"}, "spindle_temp_c"),
    ({"current", "curr", "strom"}, "spindle_current_a"),
    ({"angle", "winkel"}, "spindle_angle_rad"),
    ({"speed", "rpm", "drehzahl", "velocity"}, "spindle_rpm"),
)


def guess(column: SourceColumn, units: Mapping[str, str]) -> Guess | None:
    """Return what a column probably is. units: of what the dialect's columns mean where a file doesn't state it.

    >>> guess(SourceColumn("X_ref [mm]", "mm"), {}), guess(SourceColumn("vaTorqueAtMotor[u1,2]"), {"torque": "N m"})
    (Guess(column='x_ref_mm', unit='mm', is_sure=True), Guess(column='y_torque_a', unit='N m', is_sure=False))
    >>> guess(SourceColumn("Fx", "N"), {}), guess(SourceColumn("vibes"), {})
    (Guess(column='force_x_n', unit='N', is_sure=True), None)
    """
    bare = named(column.name)[0].strip().lower()
    if exact := run_column(bare):
        return Guess(exact, column.unit or None, True)
    target, is_named = _target(column)
    if target is None:
        return None
    into = unit_of(target)
    stated = column.unit if column.unit and into and conversion(column.unit, into) else ""
    if column.unit and unit_named(column.unit) and into and not stated:
        return None  # of another quantity
    unit = stated or units.get("A" if into == TORQUE and _is_current(column) else into) or None
    return Guess(target, unit, is_named and (unit is not None or not into))


def words_of(text: str) -> list[str]:
    """Split a name into its words, in lower case.

    >>> words_of("Axes.X1.ActPos [mm]"), words_of("vaTorqueAtMotor")
    (['axes', 'x1', 'act', 'pos', 'mm'], ['va', 'torque', 'at', 'motor'])
    """
    spaced = re.sub(r"(?<=[a-zà-ü0-9])(?=[A-ZÀ-Ü])", " ", text)
    return [word.lower() for word in re.split(r"[^A-Za-zÀ-ü0-9]+", spaced) if word]


def _target(column: SourceColumn) -> tuple[str | None, bool]:
    """Return the column of the run log and whether the names told its axis or quantity, rather than a number."""
    text = f"{named(column.name)[0]} {column.description}"
    index = _UNIT_INDEX.search(text)
    plain = words_of(_UNIT_INDEX.sub(" ", text))
    words = {*plain}
    axis = None
    for word in plain:
        joined = _JOINED.match(word)
        if joined:
            axis = axis or joined[1] or joined[4]
            words.add(joined[2] or joined[3])
    axis = axis or _axis(plain)
    if words & SPINDLE and (found := next((name for some, name in _OF_SPINDLE if words & some), None)):
        return ("spindle_rpm_cmd" if found == "spindle_rpm" and words & REFERENCE else found), True
    if words & {"override", "ovr"}:
        return ("rapid_override_pct" if words & {"rapid", "eilgang"} else "feed_override_pct"), True
    if not axis and (force := re.match(r"^f_?([xy])$|^force_?([xy])$", named(column.name)[0].strip().lower())):
        return f"force_{force[1] or force[2]}_n", True
    if (force_words := words & {"force", "kraft"}) and axis in {"x", "y"} and force_words:
        return f"force_{axis}_n", True
    told = axis is not None
    if axis is None and index is not None and 1 <= int(index[1] or index[2]) <= 3:
        axis = "xyz"[int(index[1] or index[2]) - 1]
    words |= {"2nd"} if _SECOND.search(text) else set()
    if axis is not None and (of_axis := _of_axis(axis, words, column.unit)):
        return of_axis, told
    return next((name for some, more, name in _PLAIN if words & some and (not more or words & more)), None), True


def _is_current(column: SourceColumn) -> bool:
    """Return True where a torque command is told as a current: by its name, else by its description."""
    name = {word.rstrip("0123456789") for word in words_of(named(column.name)[0])}
    words = name if name & TORQUES else {*words_of(column.description)}
    return bool(words & CURRENTS) and not words & (TORQUES - CURRENTS)


def _axis(words: list[str]) -> str | None:
    """Return the letter of the axis that stands alone among the words, perhaps as X1 or MX1."""
    for letters in ("xyz", "abcuvw"):
        found = [match[1] for word in words if (match := re.match(rf"^(?:m|ax|axis)?([{letters}])\d?$", word))]
        if found and len(set(found)) == 1:
            return found[0]
    return None


def _of_axis(axis: str, words: set[str], unit: str) -> str | None:
    ending = "deg" if axis in ROTARY else "mm"
    into = unit_named(unit) if unit else None
    if words & {"load", "auslastung"}:
        return f"axis_{axis}_load_pct"
    if words & OTHER_MOTION:
        return None
    if words & TORQUES or (into is not None and conversion(into, TORQUE) and not words & POSITION):
        return f"{axis}_torque_a"
    if into is not None and not conversion(into, ending):
        return None
    if words & TABLE:
        return f"{axis}_table_{ending}"
    if words & REFERENCE:
        return f"{axis}_ref_{ending}"
    return f"{axis}_pos_{ending}" if words & (ACTUAL | POSITION) or into is not None else None
