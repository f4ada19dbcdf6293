"""Elastic wind-up between motor and table: screw, nut and bearings, or the gears of a joint, give under what they pass on.

    table = motor − (F_drive − b F_friction) / stiffness,       F_friction = F_drive + F_external − M a       b = before ≥ 0
    table = motor − (F_drive − |b| M a) / stiffness                                                             b = before < 0

Quasi-static: the mode of the two masses is far above what the loops excite. With b = 0 the whole drive force winds it up; with 1
all friction is that of the motor and its gears, before the elastic element, and what is left moves the mass. Motor and table do
not tell a mass before the element from friction behind it. So one number says which of the two there is more of; where a
part r of the mass is before it as well as friction, the stiffness is that of the element over 1 − r.
"""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site

RIGID = float("inf")


def table_mm(
    table_mm: float,
    drive_force_n: float,
    force_n: float,
    moving_mass_kg: float,
    velocity_mm_s: float,
    previous_mm_s: float,
    period_s: float,
    stiffness_n_per_mm: float,
    before: float,
) -> tuple[float, float]:
    """The table, behind the motor by the wind-up, and the velocity to take the next difference against."""
    inertia_n = 0.001 * moving_mass_kg * (velocity_mm_s - previous_mm_s) / period_s
    kept_n = before * (force_n - inertia_n) if before > 0.0 else -before * inertia_n
    return table_mm - (drive_force_n - kept_n) / stiffness_n_per_mm, velocity_mm_s


def first_guesses(_: Recorded) -> Guesses:
    """Friction behind the elastic element, and before it."""
    return ({"stiffness_n_per_mm": 8e4}, {"stiffness_n_per_mm": 8e4, "before": 0.8})


EFFECT = Effect(
    name="screw_compliance",
    says="the screw of {on} winds up",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(
        Parameter("stiffness_n_per_mm", "N/mm", RIGID, 2000.0, 1e7, 8e4, "axial, from motor to table"),
        Parameter(
            "before", "", 0.0, -1.0, 1.0, 0.5, "part of the friction that acts before the elastic element; < 0: of the mass"
        ),
    ),
    states={"previous_mm_s": "velocity_mm_s"},
    changes={"table_mm": table_mm},
    shows_in=("{a}_table_mm",),
    far_from_linear=True,
    first_guesses=first_guesses,
    likely_in={"reversal": 3, "acceleration": 1, "table": 2},
    equation="table = motor − (F_drive − before F_friction) / stiffness; before < 0: F_drive − |before| M a",
    reference="Altintas et al. 2011, CIRP Annals 60(2), axial stiffness of ball-screw drives",
)
