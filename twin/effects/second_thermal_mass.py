"""A second thermal mass: heat flows on from the spindle into head and column, and comes back while the spindle cools.

C dT/dt = P − (T − T_ambient) / R − g (T − T₂),   C₂ dT₂/dt = g (T − T₂)

Both start at the spindle's temperature. A step is exact: with deviations u, w from where both would settle,
d/dt (u, w) = A (u, w), A = [[−p, q], [r, −r]], and e^{At} = e^{mt} (cosh dt + sinh(dt)/d (A − m)), m ± d the rates of A.
"""

from math import exp, sqrt

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site


def temperature_next_c(
    alone_c: float,
    temperature_c: float,
    final_c: float,
    cooling_w_per_k: float,
    heat_capacity_j_per_k: float,
    duration_s: float,
    column_c: float,
    conductance_w_per_k: float,
    capacity_j_per_k: float,
) -> tuple[float, float]:
    """The spindle's temperature after the step, and the column's; `alone_c` is that of a spindle without a column."""
    p = (cooling_w_per_k + conductance_w_per_k) / heat_capacity_j_per_k
    q = conductance_w_per_k / heat_capacity_j_per_k
    r = conductance_w_per_k / capacity_j_per_k
    m = -0.5 * (p + r)
    d = sqrt(0.25 * (p - r) * (p - r) + q * r)
    slow = exp((m + d) * duration_s)
    fast = exp((m - d) * duration_s)
    even = 0.5 * (slow + fast)
    odd = 0.5 * (slow - fast) / d if d > 0.0 else 0.0
    u = temperature_c - final_c
    w = column_c - final_c
    spindle_c = final_c + even * u + odd * ((-p - m) * u + q * w)
    column_next_c = final_c + even * w + odd * (r * u + (-r - m) * w)
    there = conductance_w_per_k > 0.0
    return spindle_c if there else alone_c, column_next_c if there else column_c


def first_guesses(_: Recorded) -> Guesses:
    """Start from weak and strong paths into small and large masses: neither is linear in its size."""
    return tuple({"conductance_w_per_k": g, "capacity_j_per_k": c} for g in (1.5, 5.0) for c in (1.5e4, 6e4))


EFFECT = Effect(
    name="second_thermal_mass",
    says="heat flows on into head and column",
    site=Site.THERMAL,
    on=On.MACHINE,
    parameters=(
        Parameter("conductance_w_per_k", "W/K", 0.0, 0.0, 1000.0, 4.0, "g, heat that flows on by kelvin of difference"),
        Parameter("capacity_j_per_k", "J/K", None, 100.0, 1e7, 40000.0, "C₂, of the head and column"),
    ),
    states={"column_c": "temperature_c"},
    changes={"temperature_next_c": temperature_next_c},
    shows_in=("spindle_temp_c",),
    far_from_linear=True,
    first_guesses=first_guesses,
    equation="C dT/dt = P − (T − T_a)/R − g (T − T₂), C₂ dT₂/dt = g (T − T₂)",
    reference="the two-node lumped network; Incropera, DeWitt, Fundamentals of Heat and Mass Transfer, section 5.3",
)
