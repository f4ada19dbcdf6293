"""A sensor: its reading of a value. Nominally the value itself, at once."""

from collections.abc import Sequence
from typing import NamedTuple

from twin.kernels.assembly import Assembly
from twin.sites import Site, at


class Reading(NamedTuple):
    """The reading of the sensor, and the age, s, of the value that it reads."""

    reading: float
    age_s: float


def earlier(values: Sequence[float], since: Sequence[float], sample: int, age_s: float) -> float:
    """Return the value of `age_s` before a sample, between those that there are; before the first one, that.

    >>> earlier([0.0, 1.0, 3.0], [0.0, 0.1, 0.1], 2, 0.05)
    2.0
    """
    right: float = values[sample]
    near_s = 0.0
    far_s = 0.0
    while sample > 0 and near_s < age_s:
        far_s += since[sample]
        sample -= 1
        left = values[sample]
        if abs(left) >= 0.0:  # a number
            if far_s >= age_s:
                right = right + (left - right) * (age_s - near_s) / (far_s - near_s)
                break
            right = left
            near_s = far_s
    return right


def sense(values: Sequence[float], since: Sequence[float], sample: int) -> Reading:
    """One sample.

    >>> sense([21.5], [0.0], 0).reading
    21.5
    """
    age_s = at(Site.SENSOR, 0.0)
    value = earlier(values, since, sample, age_s)
    reading = at(Site.SENSOR, value)
    return Reading(reading, age_s)


SENSOR = Assembly((sense,), acts_on="a sensor", owner="a sensor")
FED = ("values", "since", "sample", "is_first", "since_s", "temperature_rise_k")


def sensor_quantities() -> dict[str, str]:
    """The quantities of a sensor that an effect can change, with their sites."""
    return SENSOR.quantities()
