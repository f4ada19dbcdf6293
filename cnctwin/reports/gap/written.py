"""Figures in writing: few digits, true minus signs, a dash for what there is none of.

>>> times(12.37), share(0.9962), figure(-0.000123), p_value(2e-4)
('12.4', '99.6 %', '−0.000123', '2 · 10⁻⁴')
"""

import math

from twin.gap.diagnosis import Interval

NONE = "–"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def known(value: float | None) -> bool:
    """Return True if there is a number at all."""
    return value is not None and math.isfinite(value)


def figure(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits, and no zeros that say nothing."""
    if value is None or math.isnan(value):
        return NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        return ten_to_the(value, digits)
    before = math.floor(math.log10(abs(value))) if value else 0
    places = max(0, digits - 1 - before)
    text = f"{round(value, digits - 1 - before):.{places}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text.replace("-", "−")


def ten_to_the(value: float, digits: int) -> str:
    """A very small or very large number."""
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa} · 10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")


def stated(sentence: str) -> str:
    """A sentence as it begins and ends.

    >>> stated("the Z torque at rest: mean 0.6 A")
    'The Z torque at rest: mean 0.6 A.'
    """
    text = sentence.strip()
    return text[:1].upper() + text[1:] + ("" if not text or text[-1] in ".!?…:" else ".")


def times(value: float | None) -> str:
    """A gap over the floor: three digits up to a thousand, whole ones above."""
    if value is None or not math.isfinite(value):
        return figure(value)
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:.1f}" if abs(value) >= 9.995 else f"{value:.2f}"


def share(value: float | None) -> str:
    """A share as per cent; near nothing and near all with a digit more, so that neither is claimed."""
    if value is None or not math.isfinite(value):
        return NONE
    if value in (0.0, 1.0):
        return f"{100 * value:.0f} %"
    if 0.0 < value < 0.0005:
        return "< 0.1 %"
    if 0.9995 < value < 1.0:
        return "> 99.9 %"
    near = 0.0 < abs(value) < 0.0095 or 0.985 <= value < 1.0
    return f"{100 * value:.{1 if near else 0}f} %".replace("-", "−")


def p_value(value: float | None) -> str:
    """A p value: two digits, or a power of ten; nobody needs to know how far it is below a millionth."""
    if value is None or not math.isfinite(value):
        return NONE
    if value < 1e-6:
        return "< 10⁻⁶"
    return ten_to_the(value, 1) if value < 0.001 else figure(value, 2)


def interval(given: Interval) -> tuple[str, str]:
    """A figure and its interval, with as many digits as the interval is worth.

    >>> interval(Interval(-310.27, -322.4, -298.1, "N"))
    ('−310 N', '−322 … −298')
    """
    unit = f" {given.unit}" if given.unit else ""
    if not (known(given.value) and known(given.low) and known(given.high)):
        missing = not known(given.low) and not known(given.high)
        return figure(given.value) + unit, NONE if missing else f"{figure(given.low)} … {figure(given.high)}"
    width, size = abs(given.high - given.low), max(abs(given.low), abs(given.value), abs(given.high))
    digits = 3 if not width or not size else min(6, max(2, 2 + math.floor(math.log10(size)) - math.floor(math.log10(width))))
    return figure(given.value, digits) + unit, f"{figure(given.low, digits)} … {figure(given.high, digits)}"
