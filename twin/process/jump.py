"""Ticks at which the force hangs by a hair: a tooth that enters or leaves the cut as closely as the angle is known.

A log has the spindle's angle to so many digits. Where the force jumps (at exit off the middle of a slot, with edge forces, with
runout) a rounded angle does not say on which side of the jump a tooth was, so such a sample of a dynamometer cannot be predicted.
The mean over a tick does not mind.
"""

import math

import numpy as np
from numpy.typing import NDArray

from twin.process.milling import Milling


def at_a_jump(motion: Milling, teeth: int, resolution_rad: float = 1e-4) -> NDArray[np.bool_]:
    """Return True where a tooth is as near as `resolution_rad` to entry or exit, (motions, ticks).

    Two teeth in a slot along x change places at the angle 0:

    >>> motion = Milling(np.array([0.00005, 0.1]), *[np.full(2, v) for v in (3000.0, 10.0, 0.0, 1.0, 0.0, math.pi)])
    >>> at_a_jump(motion, 2).tolist()
    [[True, False]]
    """
    angle, _, x_mm_s, y_mm_s, _, entry, exit_ = motion.rows()
    pitch = 2.0 * math.pi / teeth
    near = np.zeros(angle.shape, dtype=bool)
    for side in (entry, exit_):
        off = angle - np.arctan2(y_mm_s, x_mm_s) - side
        near |= np.abs(off - pitch * np.round(off / pitch)) <= resolution_rad
    return near
