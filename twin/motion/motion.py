"""The motion: reference position, feed, spindle and tool at every tick of the servo loops."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class ExecState(IntEnum):
    """Code of `exec_state`; the names are those of MTConnect's Execution."""

    READY = 0
    ACTIVE = 1
    PROGRAM_COMPLETED = 2


@dataclass(frozen=True, slots=True)
class Motion:
    """Arrays of n ticks.

    t_s; reference_mm (n, axes); feed_mm_min: speed along the path; line: source line being executed
    spindle_rpm ≥ 0 and spindle_direction +1, −1, 0; tool_number 0 = none, tool_change_active
    segment, s_mm: place on the path, to look up what belongs to the path
    exec_state: codes of ExecState
    """

    axes: tuple[str, ...]
    t_s: Floats
    reference_mm: Floats
    line: Ints
    feed_mm_min: Floats
    spindle_rpm: Floats
    spindle_direction: Ints
    tool_number: Ints
    tool_change_active: NDArray[np.bool_]
    segment: Ints
    s_mm: Floats
    exec_state: Ints

    def __len__(self) -> int:
        return len(self.t_s)
