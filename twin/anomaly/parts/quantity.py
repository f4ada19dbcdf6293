"""The quantity of a signal that repeats from part to part, and the ticks that tell of it.

    load, power      x = ln(max(0, load − idle(speed)) / override^p + floor)
    vibration        x = ln(vibration + floor) − p · ln override
    feed             x = ln(feed / override + floor)
    speed            x = ln(speed / override + floor)
    temperature      x = value − heat(speed, load): `heat.py`
    others           x = value

A floor keeps the rounding of a meter from becoming a large ratio. While the spindle stands only temperatures tell anything.
"""

from enum import IntEnum

from twin.vocabulary import twin_signals

SPEED, FEED, LOAD = "spindle_rpm", "feed_mm_min", "spindle_load_pct"
TURNS_RPM_MIN = 50.0


class Kind(IntEnum):
    """The kind of quantity that a signal is."""

    LOAD = 0
    VIBRATION = 1
    FEED = 2
    SPEED = 3
    TEMPERATURE = 4
    PLAIN = 5


FLOORS = {"spindle_load_pct": 2.0, "spindle_power_kw": 0.1, "spindle_current_a": 0.5, "feed_mm_min": 20.0, "spindle_rpm": 20.0}
FLOORS |= {"vibration_velocity_mm_s": 0.3, twin_signals.VIBRATION_VELOCITY_MM_S: 0.3}
VIBRATION_FLOOR = 0.05
LOAD_FLOOR = 3.0
RPM_MAX = 60_000.0
UNITS = {
    **{Kind.LOAD: "%", Kind.VIBRATION: "g", Kind.FEED: "mm/min", Kind.SPEED: "rpm", Kind.TEMPERATURE: "K"},
    Kind.PLAIN: None,
}
SPREADS = {Kind.LOAD: 0.1, Kind.VIBRATION: 0.2, Kind.FEED: 0.2, Kind.SPEED: 0.02, Kind.TEMPERATURE: 1.0, Kind.PLAIN: 1.0}
"""Spreads of a tick before training knows better."""
SPREAD_LEAST = {
    Kind.LOAD: 0.02,
    Kind.VIBRATION: 0.03,
    Kind.FEED: 0.02,
    Kind.SPEED: 0.006,
    Kind.TEMPERATURE: 0.6,
    Kind.PLAIN: 1e-6,
}
"""Least spreads: a signal that is rounded, or that a control repeats, has none in some sections."""
POWERS = {Kind.LOAD: 0.75, Kind.VIBRATION: 0.5}
"""Powers of the feed override, before training knows better."""


def kind_of(signal: str) -> Kind:
    """Return the kind of a signal.

    >>> kind_of("spindle_load_pct").name, kind_of("twin/spindle_temp_residual_k").name, kind_of("feed_override_pct").name
    ('LOAD', 'TEMPERATURE', 'PLAIN')
    """
    if signal in (FEED, SPEED):
        return Kind.FEED if signal == FEED else Kind.SPEED
    if signal.endswith("_load_pct") or signal in ("spindle_power_kw", "spindle_current_a", twin_signals.CUTTING_FORCE_N):
        return Kind.LOAD
    if signal.endswith(("_temp_c", "_residual_k")):
        return Kind.TEMPERATURE
    if "vibration_rms" in signal or "vibration_velocity" in signal:
        return Kind.VIBRATION
    return Kind.PLAIN


def floor_of(signal: str) -> float:
    """Return the floor that is added before the logarithm, in the signal's unit."""
    kind = kind_of(signal)
    return FLOORS.get(signal, VIBRATION_FLOOR if kind is Kind.VIBRATION else LOAD_FLOOR if kind is Kind.LOAD else 0.0)
