"""The cost of a second: labour and depreciation, and the life of the tool (reference paper, Eq. 19 to 22).

    C_p = C_m + C_t,   C_m = T_p (E_p + C_d),   C_t = (T_p / T_l) (P_t + T_c (E_p + C_d)),   V T_l^n = C,   V = π D n_s

with V in m/min and T_l in min. At a speed the tool loses 1/T_l of its life each minute; a program of several speeds loses the
sum.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.machine import Cost, ToolWears

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Economy:
    """per_second: E_p + C_d; per_tool: P_t + T_c (E_p + C_d); exponent: 1/n of Taylor

    wears_in_cut: only while the edge cuts; else all the time (Eq. 20)
    """

    currency: str
    per_second: float
    per_tool: float
    taylor_c_m_per_min: float
    exponent: float
    wears_in_cut: bool

    @classmethod
    def of(cls, cost: Cost) -> Self:
        """Return the economy of [cost].

        The reference paper's machine: 3.001 KRW a second, and a tool costs 28,000 + 60 · 3.001 = 28,180 KRW:

        >>> made = Economy.of(Cost(currency="KRW", tool_price=28000.0, tool_change_s=60.0, labour_per_s=2.544,
        ...     depreciation_per_s=0.457, taylor_c_m_per_min=689.8, taylor_n=0.25))
        >>> round(made.per_second, 3), round(made.per_tool, 2), round(1.0 / float(made.lives_per_s(6.0, 8000.0)) / 60.0, 1)
        (3.001, 28180.06, 437.9)
        """
        second = cost.labour_per_s + cost.depreciation_per_s
        return cls(
            currency=cost.currency,
            per_second=second,
            per_tool=cost.tool_price + cost.tool_change_s * second,
            taylor_c_m_per_min=cost.taylor_c_m_per_min,
            exponent=1.0 / cost.taylor_n,
            wears_in_cut=cost.tool_wears is ToolWears.IN_CUT,
        )

    def wear_factor(self, diameter_mm: Floats | float) -> Floats:
        """A of a tool: it loses A n^exponent of its life each second at n rev/min."""
        return np.asarray((np.pi * np.asarray(diameter_mm) / 1000.0 / self.taylor_c_m_per_min) ** self.exponent / 60.0)

    def lives_per_s(self, diameter_mm: Floats | float, rpm: Floats | float) -> Floats:
        """Part of the tool's life that a second at this speed takes."""
        return np.asarray(self.wear_factor(diameter_mm) * np.abs(rpm) ** self.exponent)
