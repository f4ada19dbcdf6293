"""Quantities of an optimisation in writing, and the figures that its limits, which are words, hold.

>>> quantity(29.481, "s"), change(29.48, 24.51), change(1.0, 1.0052), percent(0.00042)
('29.48 s', '−16.9 %', '+0.52 %', '0.042 %')
"""

import math
import re
from collections.abc import Mapping

from cnctwin.reports.gap.markup import Markup, joined, tag
from cnctwin.reports.gap.written import NONE, figure, known

NAMED = {
    "force": ("force", r"N"),
    "power": ("power", r"kW"),
    "torque": ("torque", r"N[· ]?m"),
    "chip": ("chip", r"µm"),
    "feed": ("feed", r"mm/min"),
    "speed": ("spindle speed|spindle_rpm", r"(?:rev/min|rpm|/min)"),
}
"""The quantity of a limit → how its name is recognised, and its unit."""


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """A figure with its unit; a dash alone where there is none."""
    return f"{figure(value, digits)} {unit}".strip() if known(value) else figure(value)


def column(value: float | None, digits: int = 4) -> str:
    """A figure in a column of such: so many digits, zeros too, so that the points stand below each other.

    >>> column(14.0), column(14.305), column(1048.2), column(0.0), column(None)
    ('14.00', '14.30', '1048', '0', '–')
    """
    if value is None or not math.isfinite(value) or value == 0.0 or not 1e-3 <= abs(value) < 1e6:
        return figure(value, digits)
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{places}f}".replace("-", "−")


def written_s(seconds: float | None) -> str:
    """The seconds of a program, in the one form that all tables have.

    >>> written_s(5.469), written_s(1845.3), written_s(None)
    ('5.47', '1845.30', '–')
    """
    return f"{seconds:.2f}" if known(seconds) and seconds is not None else figure(seconds)


def length_of_time(seconds: float | None) -> str:
    """Seconds as a person says them, from two minutes on; empty below.

    >>> length_of_time(1845.3), length_of_time(90.0)
    ('30 min 45 s', '')
    """
    if seconds is None or not math.isfinite(seconds) or seconds < 120.0:
        return ""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {whole % 60:02d} s"


def percent(relative: float | None, digits: int = 3) -> str:
    """A ratio as per cent with so many digits; what is there but next to nothing is not called nothing."""
    if relative is None or not math.isfinite(relative):
        return NONE
    if relative != 0.0 and abs(relative) < 1e-5:
        return "< 0.001 %"
    return f"{figure(100.0 * relative, digits)} %"


def probability(value: float | None) -> str:
    """A probability as per cent, with a digit more near all.

    >>> probability(0.95), probability(0.9534), probability(0.99962), probability(1.0)
    ('95 %', '95.3 %', '99.96 %', '100 %')
    """
    if value is None or not math.isfinite(value):
        return NONE
    return f"{figure(round(100.0 * value, 2 if value > 0.99 else 1), 4)} %"


def change(before: float | None, after: float | None) -> str:
    """By how much, relative, with its sign; in words where it is nothing."""
    if before is None or after is None or not (known(before) and known(after)) or before == 0.0:
        return NONE
    relative = (after - before) / abs(before)
    if abs(relative) < 1e-4:
        return "no change"
    said = column(100.0 * relative, 3) if abs(relative) >= 0.01 else f"{100.0 * relative:.2f}".replace("-", "−")
    return f"{'+' if relative > 0.0 else ''}{said} %"


def to(before: str, after: str) -> Markup:
    """From one to the other; one alone where they are the same."""
    if before == after:
        return joined([before])
    arrow = joined([tag("span", " → ", class_="arrow", aria_hidden="true"), tag("span", " to ", class_="unseen")])
    return joined([before, arrow, tag("b", after)])


def limit_text(limits: Mapping[str, str], of: str) -> str:
    """The words of the limit of `of` (a key of NAMED); empty where there is none.

    >>> limit_text({"cutting force": "60 N", "feed range": "100 to 500 mm/min"}, "feed")
    '100 to 500 mm/min'
    """
    pattern = re.compile(NAMED[of][0], re.I)
    return next((text for name, text in limits.items() if pattern.search(name)), "")


def limit_figure(limits: Mapping[str, str], of: str) -> float | None:
    """The upper figure of that limit; None where its words have none in the unit of it.

    >>> limits = {"cutting force": "60 N with 95 %", "spindle speed range": "1,000 … 8,000 rev/min"}
    >>> limit_figure(limits, "force"), limit_figure(limits, "speed"), limit_figure(limits, "torque")
    (60.0, 8000.0, None)
    """
    unit = NAMED[of][1]
    found = re.findall(rf"(\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?)\s*{unit}(?![\w/·])", limit_text(limits, of)[:1000])
    return float(found[-1].replace(",", "")) if found else None


def shortened(text: str, length: int = 90) -> str:
    """The beginning of a text that is too long to be shown.

    >>> shortened("G1 X10. F400", 5)
    'G1 X…'
    """
    return text if len(text) <= length else text[: length - 1] + "…"
