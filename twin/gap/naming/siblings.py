"""Two names for one effect: a second one that alone looks like the first, and beside it only mends its form.

Friction that differs by direction and a constant force show nearly the same where an axis moves at one speed. Where one of two
such names takes next to nothing that the other leaves, it is there because a real machine is not quite the catalogue's equation.
"""

import numpy as np

from twin.gap.fitting import Left

ALIKE = 0.5
"""Part of what the first closes that the second closes alone, from which on it looks like the first."""
OF_ITS_OWN = 0.01
"""Part of all that the two close, which the second has to take by itself."""


def above(left: Left) -> float:
    """Return what is left above the floor, in floors², all signals together."""
    return float(np.sum(np.maximum(left.rms() ** 2 - 1.0, 0.0)))


def only_completes(base: Left, first: Left, second: Left, both: Left) -> bool:
    """Return True where the second is another name for the first.

    base: without either; first, second: with one of them alone; both: with the two
    """
    nothing = above(base)
    one, other, all_of_it = (nothing - above(left) for left in (first, second, both))
    return other > ALIKE * one > 0.0 and all_of_it - one < OF_ITS_OWN * all_of_it
