"""When a value is looked at: the reference by the loop, the feedback by the clock that stamps it.

Nominally both at their own time. Effects that shift or stretch time are at these two places; a series is then read between its
samples, linearly, and held at its ends.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.sites import Site, at

Floats = NDArray[np.float64]


class ReferenceTime(NamedTuple):
    """Time of the reference that the loop sees, s."""

    reference_time_s: float


def looked_at(time_s: float) -> ReferenceTime:
    """The loop sees the reference of its own time.

    >>> looked_at(1.5).reference_time_s
    1.5
    """
    reference_time_s = at(Site.REFERENCE, time_s)
    return ReferenceTime(reference_time_s)


class FeedbackTime(NamedTuple):
    """Time of the feedback that a stamp of the reference's clock names, s."""

    feedback_time_s: float


def stamped(time_s: float) -> FeedbackTime:
    """Feedback and reference are stamped by one clock.

    >>> stamped(1.5).feedback_time_s
    1.5
    """
    feedback_time_s = at(Site.CLOCK, time_s)
    return FeedbackTime(feedback_time_s)


def resampled(values: Floats, period_s: float, at_s: Floats) -> Floats:
    """The evenly sampled `values`, (…, n), at other times, (n,), s.

    >>> resampled(np.array([0.0, 1.0, 2.0]), 0.001, np.array([-1.0, 0.0005, 9.0])).tolist()
    [0.0, 0.5, 2.0]
    """
    place = np.clip(at_s / period_s, 0.0, values.shape[-1] - 1.0)
    left = np.minimum(place.astype(np.intp), max(values.shape[-1] - 2, 0))
    part = place - left
    right = np.minimum(left + 1, values.shape[-1] - 1)
    return np.asarray(values[..., left] * (1.0 - part) + values[..., right] * part)
