"""The columns of a run log of kind `program`, made from a motion that was planned instead of recorded."""

import numpy as np
from numpy.typing import NDArray

from twin.motion.motion import ExecState, Motion


def program_columns(motion: Motion) -> dict[str, NDArray[np.generic]]:
    """Return the columns of the run log by name, each (n,)."""
    names = np.array([state.name for state in ExecState])
    return {
        "t_s": motion.t_s,
        "line": motion.line,
        "feed_mm_min": motion.feed_mm_min,
        "spindle_rpm": motion.spindle_rpm,
        "tool_number": motion.tool_number,
        "tool_change_active": motion.tool_change_active,
        "exec_state": names[motion.exec_state],
    }
