"""Units of recordings from elsewhere, and how each becomes the unit of a run log.

value in the run log = scale · value + offset. A name that is not in the table has no conversion: the map says `scale` and
`offset` then.
"""

import math
import re
from typing import NamedTuple


class Conversion(NamedTuple):
    """The line from one unit to another: `scale · value + offset`."""

    scale: float
    offset: float = 0.0


IN_MM = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "µm": 1e-3, "nm": 1e-6, "in": 25.4, "ft": 304.8}
IN_DEG = {"deg": 1.0, "rad": math.degrees(1.0), "mrad": math.degrees(1e-3), "rev": 360.0, "arcsec": 1.0 / 3600.0}
IN_MM_S = {f"{name}/s": size for name, size in IN_MM.items()} | {f"{name}/min": size / 60.0 for name, size in IN_MM.items()}
TABLE: dict[str, dict[str, float]] = {
    "mm": IN_MM,
    "deg": IN_DEG,
    "rad": {name: math.radians(size) for name, size in IN_DEG.items()},
    "A": {"A": 1.0, "mA": 1e-3, "kA": 1e3},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "daN": 10.0, "lbf": 4.4482216152605, "kgf": 9.80665},
    "kW": {"kW": 1.0, "W": 1e-3, "MW": 1e3, "hp": 0.74569987158227, "PS": 0.73549875},
    "rev/min": {"rev/min": 1.0, "rev/s": 60.0, "rad/s": 30.0 / math.pi, "deg/s": 1.0 / 6.0, "deg/min": 1.0 / 360.0, "Hz": 60.0},
    "mm/s": IN_MM_S,
    "mm/min": {name: 60.0 * size for name, size in IN_MM_S.items()},
    "%": {"%": 1.0, "1": 100.0, "‰": 0.1},
    "g": {"g": 1.0, "mg": 1e-3, "m/s²": 1.0 / 9.80665, "mm/s²": 1e-3 / 9.80665},
    "s": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
}
"""Unit of a run log → unit of the recording → how many of the first one of the second is."""
IN_CELSIUS = {
    "°C": Conversion(1.0),
    "°F": Conversion(5.0 / 9.0, -160.0 / 9.0),
    "K": Conversion(1.0, -273.15),
}
DRIVE_TORQUE = {
    "A": 1.0,
    "mA": 1e-3,
    "N m": 1.0,
    "mN m": 1e-3,
    "kN m": 1e3,
    "N": 1.0,
    "kN": 1e3,
    "%": 1.0,
    "ft lbf": 1.3558179483314,
}
"""Units of a torque command: a run log keeps the drive's own where it is not amperes (formats, section 3)."""
SPELLINGS = {
    "mm": ("millimeter", "millimetre", "millimeters", "millimetres"),
    "µm": ("um", "μm", "micron", "microns", "micrometer", "mikrometer"),
    "in": ("inch", "inches", '"', "zoll"),
    "m": ("meter", "metre"),
    "deg": ("°", "grad", "degree", "degrees", "º"),
    "rev": ("turn", "turns", "u", "rev.", "revolution", "revolutions"),
    "arcsec": ("''",),
    "A": ("amp", "amps", "ampere", "amperes", "arms", "a_rms", "a rms", "aeff"),
    "N": ("newton", "newtons"),
    "N m": ("nm", "n.m", "n·m", "n*m", "n-m", "newtonmeter"),
    "mN m": ("mnm", "mn.m", "mn·m"),
    "kN m": ("knm", "kn.m", "kn·m"),
    "ft lbf": ("ft-lbf", "ftlbf", "lbf ft", "lb-ft", "ft-lb", "ft lb"),
    "rev/min": ("rpm", "1/min", "u/min", "min-1", "min^-1", "r/min", "/min", "min⁻¹"),
    "rev/s": ("1/s", "u/s", "rps", "r/s"),
    "°C": ("degc", "c", "celsius", "deg c", "ºc", "℃"),
    "°F": ("degf", "f", "fahrenheit", "deg f", "ºf", "℉"),
    "K": ("kelvin",),
    "%": ("percent", "pct", "prozent"),
    "1": ("-", "ratio", "fraction", "[1]"),
    "s": ("sec", "second", "seconds", "sek", "secs"),
    "ms": ("msec", "millisecond", "milliseconds", "msek"),
    "µs": ("us", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("nanosecond", "nanoseconds", "nsec"),
    "h": ("hour", "hours", "std"),
    "min": ("minute", "minutes"),
    "m/s²": ("m/s2", "m/s^2", "m/s/s"),
    "mm/s²": ("mm/s2", "mm/s^2"),
    "in/min": ("ipm", "inch/min", "in./min", "inches/min"),
    "in/s": ("ips", "inch/s", "inches/s"),
    "mm/min": ("mmpm",),
    "µm/s": ("um/s", "μm/s"),
}
_EVERY = {*(name for units in TABLE.values() for name in units), *IN_CELSIUS, *DRIVE_TORQUE}
_BY_SPELLING = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings}
_BY_LOWER: dict[str, str | None] = {}
for _name in sorted(_EVERY):
    _BY_LOWER[_name.lower()] = None if _name.lower() in _BY_LOWER else _name


def unit_named(text: str) -> str | None:
    """Return the unit that a recording's text means, as this table spells it; None where the table has it not.

    >>> unit_named("[mm/min]"), unit_named("Nm"), unit_named("U/min"), unit_named("deg C"), unit_named("parsec")
    ('mm/min', 'N m', 'rev/min', '°C', None)
    """
    word = re.sub(r"\s+", " ", text.strip().strip("[](){}").strip())
    for found in (word, word.replace(" ", "")):
        if found in _EVERY:
            return found
        if named := _BY_SPELLING.get(found.lower()) or _BY_LOWER.get(found.lower()):
            return named
    return None


def conversion(text: str, into: str) -> Conversion | None:
    """Return how a unit becomes `into`, a unit of a run log; None where it cannot.

    >>> conversion("inch", "mm"), conversion("°F", "°C").scale * 212 + conversion("°F", "°C").offset, conversion("N", "mm")
    (Conversion(scale=25.4, offset=0.0), 100.0, None)
    """
    unit = unit_named(text)
    if unit is None:
        return None
    if into == "°C":
        return IN_CELSIUS.get(unit)
    size = (DRIVE_TORQUE if into == "torque" else TABLE.get(into, {})).get(unit)
    return None if size is None else Conversion(size)


def units_for(into: str) -> str:
    """Return the units that become `into`, for a message."""
    return ", ".join(IN_CELSIUS if into == "°C" else DRIVE_TORQUE if into == "torque" else TABLE.get(into, {}))
