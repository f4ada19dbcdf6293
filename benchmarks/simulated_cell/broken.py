"""The faults of a machine as they act on it, second by second: what `fault.py` says, put on quantities of the machine."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell import fault
from benchmarks.simulated_cell.fault import Fault, FaultKind

Floats = NDArray[np.float64]
FACTORS = ("load", "feed", "turning_vibration", "cut_vibration", "material", "cuts", "idle", "flow")
SUMS = ("temp_k", "wear", "deeper_mm")


@dataclass(frozen=True, slots=True)
class Broken:
    """Factors and sums, (T,) each, as float32.

    load, feed: of the readings in the cut; turning_vibration, cut_vibration: of the vibration while it turns, in the cut
    material: of coefficient and edge; cuts: 0 where the tool has no edge left; idle: of idle power; flow: of the coolant
    temp_k: of the spindle; wear: beyond that of the tool; deeper_mm: of the cut
    chipped: stretches of time in which a tool has a tooth that is shorter: from, to, tool, mm
    """

    acts: dict[str, NDArray[np.float32]]
    chipped: tuple[tuple[int, int, int, float], ...] = field(default=())

    def __getitem__(self, name: str) -> NDArray[np.float32]:
        return self.acts[name]


def broken_of(faults: Sequence[Fault], place: int, tool: NDArray[np.integer], is_wet: NDArray[np.bool_]) -> Broken:
    """The faults of the machine at `place`; tool, is_wet: of the operation at each second."""
    ticks = len(tool)
    acts = {name: np.ones(ticks, dtype=np.float32) for name in FACTORS}
    acts |= {name: np.zeros(ticks, dtype=np.float32) for name in SUMS}
    chipped: list[tuple[int, int, int, float]] = []
    for one in faults:
        if one.machine != place:
            continue
        part = slice(int(one.start_s), min(ticks, int(one.end_s) + 1))
        share = fault.course(one, np.arange(part.start, part.stop, dtype=np.float64))
        if one.tool:
            share = np.where(tool[part] == one.tool, share, 0.0)
        if one.kind is FaultKind.BROKEN_INSERT:
            chipped.append((part.start, part.stop, one.tool, one.size * fault.CHIPPED_MM))
        else:
            _act(acts, one, part, one.size * share, is_wet[part])
    return Broken(acts, tuple(chipped))


def _act(acts: dict[str, NDArray[np.float32]], one: Fault, part: slice, size: Floats, is_wet: NDArray[np.bool_]) -> None:
    """Put one fault on; size: at each second of its part."""
    kind = one.kind
    if kind is FaultKind.BEARING:
        acts["turning_vibration"][part] *= 2.5**size
        acts["temp_k"][part] += 3.0 * size
    elif kind is FaultKind.CHIP_PACKING:
        acts["load"][part] *= 1.5**size
        acts["cut_vibration"][part] *= 1.4**size
    elif kind is FaultKind.SPINDLE_HEAT:
        acts["temp_k"][part] += 12.0 * size
    elif kind is FaultKind.FEED_MISMATCH:
        acts["feed"][part] /= 1.0 + size
    elif kind is FaultKind.INTERMITTENT:
        acts["cut_vibration"][part] *= 2.5**size
        acts["load"][part] *= 1.25**size
    elif kind is FaultKind.DULLING_TOOL:
        acts["wear"][part] += np.minimum(size, fault.WEAR_MAX)
    elif kind is FaultKind.BROKEN_TOOL:
        acts["cuts"][part] *= np.where(size > 0.0, 0.0, 1.0)
    elif kind is FaultKind.TOOL_TOO_LONG:
        acts["deeper_mm"][part] += fault.LONGER_MM * size
    elif kind is FaultKind.WRONG_MATERIAL:
        acts["material"][part] *= 1.3**size
    elif kind is FaultKind.COOLANT_OFF:
        acts["flow"][part] *= 1.0 - np.minimum(size, 1.0)
        acts["material"][part] *= np.where(is_wet, 1.2**size, 1.0)
    else:
        acts["idle"][part] *= 1.3**size
        acts["turning_vibration"][part] *= 1.5**size
