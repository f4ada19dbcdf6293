"""The measures of an axis: sums and peaks over the ticks, for searches that need no traces."""

from typing import NamedTuple


class AxisMetrics(NamedTuple):
    """Sums and peaks so far. The root mean square is the root of a sum over the number of ticks."""

    following_error_sum_mm2: float
    following_error_peak_mm: float
    torque_sum_a2: float
    torque_peak_a: float


def measure(
    following_error_mm: float,
    torque_a: float,
    following_error_sum_mm2: float,
    following_error_peak_mm: float,
    torque_sum_a2: float,
    torque_peak_a: float,
) -> AxisMetrics:
    """Adds a tick.

    >>> measure(-0.5, 2.0, 0.0, 0.25, 1.0, 3.0)
    AxisMetrics(following_error_sum_mm2=0.25, following_error_peak_mm=0.5, torque_sum_a2=5.0, torque_peak_a=3.0)
    """
    following_error_sum_mm2 = following_error_sum_mm2 + following_error_mm * following_error_mm
    following_error_over_mm = abs(following_error_mm) - following_error_peak_mm
    following_error_peak_mm = following_error_peak_mm + (following_error_over_mm if following_error_over_mm > 0.0 else 0.0)
    torque_sum_a2 = torque_sum_a2 + torque_a * torque_a
    torque_over_a = abs(torque_a) - torque_peak_a
    torque_peak_a = torque_peak_a + (torque_over_a if torque_over_a > 0.0 else 0.0)
    return AxisMetrics(following_error_sum_mm2, following_error_peak_mm, torque_sum_a2, torque_peak_a)
