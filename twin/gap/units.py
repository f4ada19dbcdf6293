"""The units of what a diagnosis reads and answers, by name."""

from twin.effects.effect import OF_SIGNAL

UNITS = {"mm": "mm", "deg": "deg", "a": "A", "n": "N", "pct": "%", "c": "°C", "s": "s"}


def unit_of(signal: str) -> str:
    """The unit of a column, by its name."""
    return UNITS.get(signal.rpartition("_")[2], "")


def unit_on(unit: str, on: str) -> str:
    """Return the unit of an effect's parameter where it acts: a bias has that of its signal, and one of a temperature is in K.

    >>> unit_on(OF_SIGNAL, "spindle_temp_c"), unit_on(OF_SIGNAL, "spindle_load_pct"), unit_on("N", "x")
    ('K', '%', 'N')
    """
    return unit if unit != OF_SIGNAL else {"°C": "K"}.get(unit_of(on), unit_of(on))
