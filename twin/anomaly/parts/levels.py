"""Levels that follow wear and material from operation to operation, so that a change within a part stands out.

    r = mean of ln(measured / usual) over an operation − (m + l)         m: material, shared by all tools; l: of the tool
    K_m = P_m / (P_m + P_l + R),  K_l = P_l / (P_m + P_l + R)            m ← m + K_m r,  l ← l + K_l r,  P ← (1 − K) P + q

A Kalman filter with two levels. After a standstill or a change of program the material may be another one, so P_m grows to the
variance between batches; where a cut takes far less than before, the tool is a new one, so P_l grows to that of tools. What lies
beyond three standard deviations is cut off there; nothing is followed while a score is suspicious. A level that lasts becomes the
centre of the sections: it is forgotten by a hundredth at each operation.
"""

from collections.abc import Sequence
from typing import NamedTuple

BATCH_VAR = 0.06**2
MATERIAL_DRIFT = 0.003**2
TOOL_DRIFT = 0.005**2
TOOL_VAR = 0.05**2
"""Variance of the level of a tool that has not been followed yet."""
NOISE = 0.02**2
FORGETS = 0.01
LEVEL_MAX = 0.35
CUT_OFF = 3.0


class Level(NamedTuple):
    """A level for each signal, and the variance that they share."""

    values: tuple[float, ...]
    variance: float


def followed(
    material: Level, tool: Level, residual: Sequence[float | None], noise: float = 0.0, load_at: int = 0
) -> tuple[Level, Level]:
    """Return both levels after an operation whose mean residual is known for some signals.

    noise: variance of that residual beyond `NOISE`, as its override and its few ticks bring it

    >>> material, tool = followed(Level((0.0,), 0.0036), Level((0.0,), 0.0001), (0.05,))
    >>> round(material.values[0], 3), round(tool.values[0], 4), material.variance < 0.001
    (0.044, 0.0012, True)
    """
    load = residual[load_at] if load_at >= 0 else None
    if load is not None and load < -CUT_OFF * (material.variance + tool.variance + NOISE + noise) ** 0.5:
        tool = Level(tool.values, TOOL_VAR)
    total = material.variance + tool.variance + NOISE + noise
    limit = CUT_OFF * total**0.5
    k_m, k_l = material.variance / total, tool.variance / total
    steps = [0.0 if r is None else -limit if r < -limit else min(r, limit) for r in residual]
    return (
        Level(_moved(material.values, k_m, steps), (1.0 - k_m) * material.variance + MATERIAL_DRIFT),
        Level(_moved(tool.values, k_l, steps), min(TOOL_VAR, (1.0 - k_l) * tool.variance + TOOL_DRIFT)),
    )


def _moved(values: Sequence[float], gain: float, steps: Sequence[float]) -> tuple[float, ...]:
    keeps = 1.0 - FORGETS
    return tuple([max(-LEVEL_MAX, min(LEVEL_MAX, keeps * v + gain * step)) for v, step in zip(values, steps, strict=True)])


def another_material(material: Level) -> Level:
    """Return the level of the material once it may be another one."""
    return Level(material.values, max(material.variance, BATCH_VAR))
