"""Lines that cut nothing by the stock and yet run along the work: spring passes, and finishing passes over what is done.

By its plan such a line cuts nothing. On the machine it takes off what the tool had been pushed away from, so that its chip
matters: it needs the speed it was written for. Found by cutting the stock once more, with the tools of these lines a little
thicker: a line that then cuts along half of its way or more touches the work; an approach does so at its end only.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.engagement.along_path import Section, engaged_along
from twin.machine import Stock
from twin.motion.path import Path

Ints = NDArray[np.int64]
THICKER_MM = 0.05
PART = 0.5


def touching(path: Path, stock: Stock, sections: Sequence[Section], segments: Sequence[Ints]) -> list[bool]:
    """Return True for each line, by its segments, that touches the work along half of its way or more."""
    if not segments:
        return []
    suspected = np.zeros(len(path), dtype=np.bool_)
    suspected[np.concatenate(segments)] = True
    thicker: list[Section] = []
    for section in sections:
        own = suspected[section.first : section.stop]
        edges = [0, *(np.flatnonzero(np.diff(own.astype(np.int8))) + 1).tolist(), len(own)]
        for a, b in pairwise(edges):
            more = 2.0 * THICKER_MM if b > a and own[a] and section.tool_diameter_mm > 0.0 else 0.0
            thicker.append(Section(section.first + a, section.first + b, section.tool_diameter_mm + more))
    rows = engaged_along(path, stock, thicker)
    cut_mm = np.zeros(len(path))
    np.add.at(cut_mm, rows.segment, np.where(rows.axial_depth_mm > 0.0, rows.length_mm, 0.0))
    return [bool(cut_mm[mine].sum() >= PART * path.length_mm[mine].sum()) for mine in segments]
