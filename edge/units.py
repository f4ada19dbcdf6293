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


# Units of values that a configuration chooses by address, by quantity: value in its base unit = value * factor + offset. First
# MTConnect's name, then symbols as people and OPC UA servers write them.
_CHOSEN: dict[str, dict[str, Conversion]] = {
    "length": {
        "MILLIMETER mm": IDENTITY,
        "CENTIMETER cm": Conversion(10.0),
        "METER m": Conversion(1000.0),
        "MICROMETER µm μm um": Conversion(0.001),
        "INCH in": Conversion(25.4),
        "FOOT ft": Conversion(304.8),
    },
    "speed": {
        "MILLIMETER/MINUTE mm/min": IDENTITY,
        "MILLIMETER/SECOND mm/s": Conversion(60.0),
        "METER/MINUTE m/min": Conversion(1000.0),
        "METER/SECOND m/s": Conversion(60_000.0),
        "INCH/MINUTE in/min": Conversion(25.4),
    },
    "speed of rotation": {
        "REVOLUTION/MINUTE RPM rev/min rpm 1/min U/min min-1": IDENTITY,
        "REVOLUTION/SECOND rev/s": Conversion(60.0),
        "DEGREE/SECOND deg/s °/s": Conversion(1 / 6),
    },
    "angle": {"DEGREE deg °": IDENTITY, "RADIAN rad": Conversion(57.29577951308232), "REVOLUTION rev": Conversion(360.0)},
    "time": {
        "SECOND s": IDENTITY,
        "MILLISECOND ms": Conversion(0.001),
        "MINUTE min": Conversion(60.0),
        "HOUR h": Conversion(3600.0),
    },
    "temperature": {
        "CELSIUS °C degC C": IDENTITY,
        "FAHRENHEIT °F degF F": Conversion(5 / 9, -160 / 9),
        "KELVIN K": Conversion(1.0, -273.15),
    },
    "pressure": {
        "PASCAL Pa": IDENTITY,
        "KILOPASCAL kPa": Conversion(1e3),
        "MEGAPASCAL MPa": Conversion(1e6),
        "BAR bar": Conversion(1e5),
        "MILLIBAR mbar": Conversion(100.0),
        "PSI psi": Conversion(6894.757293168),
    },
    "power": {"WATT W": IDENTITY, "KILOWATT kW": Conversion(1e3), "HORSEPOWER hp": Conversion(745.699872)},
    "energy": {
        "JOULE WATT_SECOND J Ws": IDENTITY,
        "WATT_HOUR Wh": Conversion(3600.0),
        "KILOWATT_HOUR kWh": Conversion(3.6e6),
    },
    "current": {"AMPERE A": IDENTITY, "MILLIAMPERE mA": Conversion(0.001)},
    "voltage": {"VOLT V": IDENTITY, "MILLIVOLT mV": Conversion(0.001)},
    "force": {"NEWTON N": IDENTITY, "KILONEWTON kN": Conversion(1e3)},
    "torque": {"NEWTON_METER Nm N·m N.m": IDENTITY},
    "frequency": {"HERTZ Hz": IDENTITY, "KILOHERTZ kHz": Conversion(1e3)},
    "share": {"PERCENT % pct": IDENTITY, "RATIO": Conversion(100.0)},
    "volume": {"LITER l L": IDENTITY, "MILLILITER ml mL": Conversion(0.001)},
    "flow": {"LITER/MINUTE l/min L/min": IDENTITY, "LITER/SECOND l/s L/s": Conversion(60.0)},
}
_BY_NAME = {name: (kind, way) for kind, units in _CHOSEN.items() for names, way in units.items() for name in names.split()}


def between(native: str, wanted: str) -> Conversion:
    """Return how to get from the unit that a control states to the one that a configuration wants; ConfigError where they differ.

    A unit that is not known here converts to nothing and contradicts nothing.

    >>> between("PASCAL", "bar").apply(450_000.0)
    4.5
    >>> between("celsius", "K").apply(20.0)
    293.15
    """
    (kind, given), (wanted_kind, asked) = _chosen(native), _chosen(wanted)
    if native == wanted or not kind or not wanted_kind:
        return IDENTITY
    if kind != wanted_kind:
        raise ConfigError(f"{native} is a {kind} and {wanted} a {wanted_kind}")
    return Conversion(given.factor / asked.factor, (given.offset - asked.offset) / asked.factor)


def _chosen(name: str) -> tuple[str, Conversion]:
    """Return quantity and conversion of a unit: a symbol as it is written, a word in any case; "" for one that is not known."""
    word = name.strip()
    return _BY_NAME.get(word) or _BY_NAME.get(word.upper() if len(word) > 2 else word) or ("", IDENTITY)
