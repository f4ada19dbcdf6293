"""Native units to canonical units, as `value * factor + offset`.

MTConnect writes units as SCREAMING words with a slash (ANSI/MTC1.4, part 2, table of units); a configuration may use the same
words or the canonical unit itself. Case and `REV`/`REVOLUTION` do not matter.

>>> conversion("INCH/MINUTE", "mm/min").apply(10.0)
254.0
>>> conversion("MILLIMETER/SECOND", "mm/min").apply(2.0)
120.0
"""

from typing import NamedTuple

from edge.errors import ConfigError


class Conversion(NamedTuple):
    """canonical = native * factor + offset"""

    factor: float
    offset: float = 0.0

    def apply(self, value: float) -> float:
        """The value in the canonical unit."""
        return value * self.factor + self.offset


IDENTITY = Conversion(1.0)
_LENGTH_MM = {
    "MILLIMETER": 1.0,
    "INCH": 25.4,
    "FOOT": 304.8,
    "METER": 1000.0,
    "CENTIMETER": 10.0,
    "DECIMETER": 100.0,
    "MICROMETER": 0.001,
}
_MINUTE = {"MINUTE": 1.0, "SECOND": 60.0}
_GRAVITY_MM_S2 = 9806.65

_TO: dict[str, dict[str, Conversion]] = {
    "mm": {word: Conversion(factor) for word, factor in _LENGTH_MM.items()},
    "mm/min": {
        f"{length}/{time}": Conversion(mm * per_minute)
        for length, mm in _LENGTH_MM.items()
        for time, per_minute in _MINUTE.items()
    },
    "mm/s": {f"{length}/SECOND": Conversion(mm) for length, mm in _LENGTH_MM.items()},
    "rev/min": {
        "REVOLUTION/MINUTE": IDENTITY,
        "RPM": IDENTITY,
        "REVOLUTION/SECOND": Conversion(60.0),
        "DEGREE/SECOND": Conversion(1 / 6),
        "DEGREE/MINUTE": Conversion(1 / 360),
        "RADIAN/SECOND": Conversion(9.549296585513721),
        "RADIAN/MINUTE": Conversion(0.15915494309189535),
    },
    "deg": {"DEGREE": IDENTITY, "RADIAN": Conversion(57.29577951308232), "REVOLUTION": Conversion(360.0)},
    "%": {"PERCENT": IDENTITY, "RATIO": Conversion(100.0), "COUNT": IDENTITY},
    "kW": {"KILOWATT": IDENTITY, "WATT": Conversion(0.001), "HORSEPOWER": Conversion(0.745699872)},
    "A": {"AMPERE": IDENTITY, "MILLIAMPERE": Conversion(0.001)},
    "°C": {"CELSIUS": IDENTITY, "FAHRENHEIT": Conversion(5 / 9, -160 / 9), "KELVIN": Conversion(1.0, -273.15)},
    "g": {
        "GRAVITATIONAL_ACCELERATION": IDENTITY,
        "MILLIMETER/SECOND^2": Conversion(1 / _GRAVITY_MM_S2),
        "METER/SECOND^2": Conversion(1000 / _GRAVITY_MM_S2),
    },
    "s": {"SECOND": IDENTITY, "MILLISECOND": Conversion(0.001), "MINUTE": Conversion(60.0)},
    "": {},
}


def conversion(native: str, canonical: str) -> Conversion:
    """Return how to get from a native unit to a canonical one; ConfigError where there is no way."""
    word = native.strip().upper().replace("REV/", "REVOLUTION/")
    if not word or native == canonical or not canonical:
        return IDENTITY
    found = _TO.get(canonical, {}).get(word)
    if found is None:
        ways = ", ".join(_TO.get(canonical, {})) or "none"
        raise ConfigError(f"native unit {native!r} cannot become {canonical}; it may be {ways}")
    return found
