"""A load meter that jumps to a peak and falls back slowly.

load = max(load, peak · exp(−T / hold)),   peak = load

On recordings with this effect, the meter that holds what it shows and falls towards 0 leaves nothing but the noise of the sensor.
A fall towards the present load leaves twice as much, a latch, a linear fall or the greatest of the last `hold_s` ten times.
"""

from math import exp

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site


def spindle_load_pct(load_pct: float, peak_pct: float, period_s: float, hold_s: float) -> tuple[float, float]:
    """Return the load that the meter shows, and remembers."""
    held_pct = peak_pct * exp(-period_s / hold_s) if hold_s > 0.0 else load_pct
    shown_pct = held_pct if held_pct > load_pct else load_pct
    return shown_pct, shown_pct


def first_guesses(_: Recorded) -> Guesses:
    """Start from short, middling and long holds: a meter that holds its peaks is not linear in how long."""
    return tuple({"hold_s": hold_s} for hold_s in (0.15, 0.5, 1.5))


EFFECT = Effect(
    name="load_peak_hold",
    says="the load meter holds its peaks",
    site=Site.SPINDLE,
    on=On.MACHINE,
    parameters=(Parameter("hold_s", "s", 0.0, 0.0, 20.0, 0.5, "time in which a peak falls to 37 %"),),
    states={"peak_pct": 0.0},
    changes={"spindle_load_pct": spindle_load_pct},
    shows_in=("spindle_load_pct",),
    far_from_linear=True,
    shows_only_fast=True,
    first_guesses=first_guesses,
    equation="load = max(load, peak exp(−T / hold))",
    reference="the peak-hold load meters of FANUC spindle drives; a peak detector with exponential release",
)
