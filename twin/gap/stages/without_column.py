"""The gap of stages whose signal is no column of a recording: lengths of tool changes beside temperatures and loads."""

from collections.abc import Sequence

import numpy as np

from twin.gap.diagnosis import Effected
from twin.gap.fitting import Left, left_by
from twin.gap.score import Squares
from twin.gap.stages.stage import Model
from twin.gap.stages.tool_change import ToolChangeStage
from twin.gap.verdict import Judged


def beside_columns(stages: Sequence[Judged], some: frozenset[Effected] | None) -> dict[str, Squares]:
    """Return signal → its gap on the runs to be judged on, with some of the causes in the twin; None: the machine as stated."""
    found: dict[str, Squares] = {}
    for judged in stages:
        stage, explained = judged.explained.stage, judged.explained
        if isinstance(stage, ToolChangeStage):
            if some is None:
                left = left_by(stage, Model((), ()), np.zeros(0), fitted=False)
            else:
                left = (explained.best if any(e in some for e in explained.best.effects) else explained.base).left
            found |= _squares(left, stage.floor_s)
    return found


def _squares(left: Left, floor: float) -> dict[str, Squares]:
    there = left.counts > 0.0
    return {
        signal: Squares(left.squares[there[:, n], n], left.counts[there[:, n], n] / floor**2, left.counts[there[:, n], n])
        for n, signal in enumerate(left.signals)
    }
