"""The spindle's heat as one lumped mass behind one resistance (an RC network).

    C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R

With the rise over ambient θ = T − T_ambient and a heat input P that is held constant over a step, the solution is exact:

    θ(t + dt) = P R + (θ(t) − P R) · exp(−dt / (R C))

so the answer does not depend on how a constant stretch is cut into steps, apart from rounding.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ThermalNetwork:
    """The four constants. From temperatures alone, alpha, beta, 1/R and C are known only up to one common factor.

    alpha_w_per_pct_rpm2: heat by load and speed, W per (% of rated power · (rev/min)²)
    beta_w_per_rpm: heat by speed alone (bearings, windage), W per rev/min
    resistance_k_per_w: to the surroundings, K/W
    capacity_j_per_k: of the lumped mass, J/K

    Raises ValueError where a constant is not finite, is negative, or R or C is zero.
    """

    alpha_w_per_pct_rpm2: float
    beta_w_per_rpm: float
    resistance_k_per_w: float
    capacity_j_per_k: float

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            least = "more than 0" if name in ("resistance_k_per_w", "capacity_j_per_k") else "0 or more"
            if not math.isfinite(value) or value < 0 or (value == 0 and least != "0 or more"):
                raise ValueError(f"{name} is {value!r}; it has to be finite and {least}")

    @property
    def time_constant_s(self) -> float:
        """R·C: after this time, 63 % of a change is through.

        >>> ThermalNetwork(0.0, 0.0, 0.18, 14500.0).time_constant_s
        2610.0
        """
        return self.resistance_k_per_w * self.capacity_j_per_k


def heat_input_w(network: ThermalNetwork, spindle_rpm: float, spindle_load_pct: float) -> float:
    """Heat that goes into the spindle, W. Heat does not know the sense of rotation, and braking does not cool.

    100 W of friction at 6,250 rev/min (0.016 W per rev/min), and 1e-8 · 50 · 6250² = 19.53 W by load:

    >>> round(heat_input_w(ThermalNetwork(1e-8, 0.016, 0.12, 9000.0), 6250.0, 50.0), 2)
    119.53
    """
    rpm = abs(spindle_rpm)
    load_pct = max(spindle_load_pct, 0.0)
    return network.alpha_w_per_pct_rpm2 * load_pct * rpm * rpm + network.beta_w_per_rpm * rpm


def rise_after(network: ThermalNetwork, rise_k: float, heat_w: float, duration_s: float) -> float:
    """Rise over ambient, K, after `duration_s` seconds of the constant heat input `heat_w`.

    Exact for any step length. After one time constant at 100 W behind 0.2 K/W, 63.2 % of 20 K are there:

    >>> network = ThermalNetwork(0.0, 0.0, 0.2, 5000.0)
    >>> round(rise_after(network, 0.0, 100.0, 1000.0), 3)
    12.642

    Raises ValueError where `duration_s` is negative: time does not run backwards through a resistance.
    """
    if duration_s < 0.0:
        raise ValueError(f"duration_s is {duration_s!r}; a step cannot be negative")
    final_k = heat_w * network.resistance_k_per_w
    return final_k + (rise_k - final_k) * math.exp(-duration_s / (network.resistance_k_per_w * network.capacity_j_per_k))
