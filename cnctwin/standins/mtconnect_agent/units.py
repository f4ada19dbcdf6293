"""From the unit an adapter sends (nativeUnits) to the unit the agent reports (units), as the agent does it."""

from typing import NamedTuple

# Factor to the MTConnect unit of the same quantity; compound units are taken apart at the slash.
_LENGTH = {"MILLIMETER": 1.0, "CENTIMETER": 10.0, "DECIMETER": 100.0, "METER": 1000.0, "INCH": 25.4, "FOOT": 304.8}
_ANGLE = {"DEGREE": 1.0, "RADIAN": 57.29577951308232, "REVOLUTION": 360.0}
_TIME = {"SECOND": 1.0, "MINUTE": 60.0, "HOUR": 3600.0}
_MASS = {"KILOGRAM": 1.0, "GRAM": 0.001, "POUND": 0.45359237, "OUNCE": 0.028349523125}
_POWER = {"WATT": 1.0, "KILOWATT": 1000.0}
_FACTORS = (_LENGTH, _ANGLE, _TIME, _MASS, _POWER)


class Conversion(NamedTuple):
    """`reported = (native + offset) * factor`."""

    factor: float
    offset: float = 0.0

    def apply(self, value: float) -> float:
        return (value + self.offset) * self.factor


def conversion(native: str | None, units: str | None, native_scale: str | None = None) -> Conversion | None:
    """Return how to convert, or None where nothing is to be done or the units aren't known here.

    >>> round(conversion("INCH/MINUTE", "MILLIMETER/SECOND").apply(60.0), 9)
    25.4
    """
    scale = float(native_scale) if native_scale else 1.0
    if not native or not units or native == units:
        return Conversion(1.0 / scale) if scale != 1.0 else None
    if (native, units) == ("FAHRENHEIT", "CELSIUS"):
        return Conversion(5.0 / 9.0 / scale, -32.0 * scale)
    factor = 1.0
    native_parts, unit_parts = native.removesuffix("_3D").split("/"), units.removesuffix("_3D").split("/")
    if len(native_parts) != len(unit_parts):
        return None
    for place, (a, b) in enumerate(zip(native_parts, unit_parts, strict=True)):
        part = _factor(a, b)
        if part is None:
            return None
        factor = factor * part if place == 0 else factor / part
    return Conversion(factor / scale)


def _factor(native: str, unit: str) -> float | None:
    if native == unit:
        return 1.0
    if native.partition("^")[1] and native.partition("^")[2] == unit.partition("^")[2]:
        base = _factor(native.partition("^")[0], unit.partition("^")[0])
        power = native.partition("^")[2]
        return base ** int(power) if base is not None and power.isdigit() else None
    return next((table[native] / table[unit] for table in _FACTORS if native in table and unit in table), None)


def number_text(value: float) -> str:
    """Write a number as the agent does: 15 significant digits, no trailing zeros.

    >>> number_text(5 / 60), number_text(4850.0)
    ('0.0833333333333333', '4850')
    """
    return f"{value:.15g}"
