"""A sensor, or a filter behind it, that takes its time: first order.

    τ d(reading)/dt = value − reading

Exact for a value that is held between samples. The first reading is settled.
"""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.kernels.elementary import exp_of_minus
from twin.sites import Site


def reading(reading: float, lagging: float, is_first: float, since_s: float, time_constant_s: float) -> tuple[float, float]:
    """The reading, which is also what the next one starts from."""
    keep = exp_of_minus(since_s / time_constant_s) if time_constant_s > 0.0 else 0.0
    keep = keep if is_first == 0.0 else 0.0
    lagging = keep * lagging + (1.0 - keep) * reading if keep > 0.0 else reading
    return lagging, lagging


def first_guesses(recorded: Recorded) -> Guesses:
    """Start from half a period to forty: what a lag of one of 50 periods does says little of one of a half."""
    return tuple({"time_constant_s": periods * recorded.period_s} for periods in (0.5, 2.0, 8.0, 40.0))


EFFECT = Effect(
    name="sensor_lag",
    says="{on} is read by a slow sensor",
    site=Site.SENSOR,
    on=On.SIGNAL,
    parameters=(Parameter("time_constant_s", "s", 0.0, 0.0, 3600.0, 0.05, "time after which 63 % of a step is read"),),
    states={"lagging": 0.0},
    changes={"reading": reading},
    shows_in=("{s}",),
    shows_only_fast=True,
    settles_s=lambda time_constant_s: time_constant_s,
    first_guesses=first_guesses,
    equation="tau dreading/dt = value − reading",
    reference="JCGM 200:2012 (VIM) 4.23, step response time; first-order low pass",
)
