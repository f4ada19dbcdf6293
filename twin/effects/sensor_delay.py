"""A reading that is late against the others: a bus that is asked later, a filter of dead time, a row filled from two clocks.

    reading(t) = value(t − delay)

Between samples the value is taken to be linear; before the first one it is the first. The loops see their own feedback in time:
only the recording of it is late. A table that is read late departs from the motor by v · delay, in proportion to the speed, where
play is the same at every speed and wind-up follows the force.
"""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site


def age_s(age_s: float, delay_s: float) -> float:
    """The age of the value that is read."""
    return age_s + delay_s


def first_guesses(recorded: Recorded) -> Guesses:
    """Start from a half to thirty periods: a shift by more than a transient lasts says nothing of a smaller one."""
    return tuple({"delay_s": min(periods * recorded.period_s, LONGEST_S)} for periods in (0.5, 2.0, 8.0, 30.0))


LONGEST_S, POLLED_S = 300.0, 10.0
"""The longest delay that is looked for, and the longest in which a gateway asks each of its devices once."""

EFFECT = Effect(
    name="sensor_delay",
    says="{on} is read late",
    site=Site.SENSOR,
    on=On.SIGNAL,
    parameters=(Parameter("delay_s", "s", 0.0, 0.0, LONGEST_S, 0.002, "age of the value that is read", POLLED_S),),
    changes={"age_s": age_s},
    shows_in=("{s}",),
    first_guesses=first_guesses,
    equation="reading(t) = value(t − delay)",
    reference="JCGM 200:2012 (VIM) 4.23, step response time; IEEE 1451.0-2007, sampling latency of a transducer channel",
)
