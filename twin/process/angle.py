"""Angles of the cut: where a tooth stands on the arc, and sines of the small steps between the nodes of a quadrature.

Plain arithmetic, in the part of Python that numba compiles: the kernels hold the text of these functions.
"""

from math import floor


def wrapped(angle_rad: float) -> float:
    """The angle from 0 up to, and not with, 2π.

    >>> wrapped(7.0 - 6.283185307179586 * 3) == wrapped(7.0)
    True
    >>> wrapped(-1e-20)
    0.0
    """
    turned = angle_rad - 6.283185307179586 * floor(angle_rad * 0.15915494309189535)
    return turned if 0.0 <= turned < 6.283185307179586 else 0.0


def small_sine(y: float) -> float:
    """sin y for |y| ≤ 0.5, by Taylor's series to the 11th power, good to 1e-14.

    >>> round(small_sine(0.5), 13)
    0.4794255386042
    """
    s = y * y
    return y * (1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))))


def small_cosine(y: float) -> float:
    """cos y for |y| ≤ 0.5, by Taylor's series to the 12th power, good to 1e-15.

    >>> round(small_cosine(0.5), 13)
    0.8775825618904
    """
    s = y * y
    return 1.0 - s / 2.0 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0)))))
