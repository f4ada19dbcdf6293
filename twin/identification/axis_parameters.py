"""The parameters that are identified of an axis, as factors on what the machine states.

A factor is exp(θ), so that a constant stays positive and its stated relative uncertainty is the standard deviation of θ. How far
friction differs by direction is a plain number a, with (1 − a) moving in − and (1 + a) moving in +. Static friction differs as
Coulomb friction does.

Air runs know mass and friction in units of the torque constant alone: (M, F, k) → (cM, cF, ck) changes nothing that is recorded.
The torque constant is therefore let go only where a force is known, in a run that cuts.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.machine import Axis, MachineFile, by_side

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AxisParameter:
    """One parameter of the fit.

    name: of the constant, or `effect__parameter`; unit of its estimate; relative: a factor exp(θ), else a plain number
    sigma: of its prior
    """

    name: str
    unit: str
    relative: bool
    sigma: float


GAINS = {"position_gain_per_s": "S_pp", "velocity_gain_a_s_per_mm": "S_vp", "velocity_integral_gain_a_per_mm": "S_vi"}
ASYMMETRY_SIGMA = 0.1


def axis_parameters(machine: MachineFile, letter: str, *, force_known: bool, free_gains: bool) -> tuple[AxisParameter, ...]:
    """The parameters to fit of an axis, with their priors from `[uncertainty]`: its relative one, or one given by path.

    A stated uncertainty of 0 takes a constant out of the fit. Gains are exact unless `free_gains` or one of their own is stated.
    """
    axis = machine.axes[letter]
    stated = machine.uncertainty

    def sigma(key: str) -> float:
        return stated.get(f"axes.{letter}.{key}", stated.get("relative", 0.05))

    force_key = "force_per_command_n" if axis.force_per_command_n is not None else "torque_constant_nm_per_a"
    wanted = [
        AxisParameter("mass_kg", "kg", True, sigma("mass_kg")),
        AxisParameter(
            "newton_per_command",
            "N·m/A" if axis.force_per_command_n is None else "N",
            True,
            sigma(force_key) if force_known else 0.0,
        ),
        AxisParameter("coulomb_n", "N", True, sigma("friction.coulomb_n")),
        AxisParameter("static_n", "N", True, sigma("friction.static_n")),
        AxisParameter("stribeck_velocity_mm_s", "mm/s", True, sigma("friction.stribeck_velocity_mm_s")),
        AxisParameter("viscous_n_s_per_mm", "N·s/mm", True, sigma("friction.viscous_n_s_per_mm")),
        AxisParameter("coulomb_asymmetry", "", False, ASYMMETRY_SIGMA),
        AxisParameter("viscous_asymmetry", "", False, ASYMMETRY_SIGMA),
    ]
    for gain in GAINS:
        given = stated.get(f"axes.{letter}.{gain}", 0.3 if free_gains else 0.0)
        wanted.append(AxisParameter(gain, "", True, given if getattr(axis, gain) > 0 else 0.0))
    return tuple(p for p in wanted if p.sigma > 0)


VELOCITY_DELAY = AxisParameter("velocity_feedback_delay__delay_s", "s", False, 0.0005)
"""Age of the velocity fed to the loop, nominally 0; a fit that leaves out a delay takes it for missing mass."""


def effects_of(parameters: tuple[AxisParameter, ...]) -> tuple[str, ...]:
    """The effects whose parameters are among these."""
    return tuple(dict.fromkeys(p.name.partition("__")[0] for p in parameters if "__" in p.name))


def constants_at(base: Mapping[str, float], parameters: tuple[AxisParameter, ...], theta: Floats) -> dict[str, Floats]:
    """The constants of `twin.servo` at each candidate, (candidates,); base: those of the stated axis; theta: (candidates, p)."""
    count = len(theta)
    factor = {p.name: np.exp(theta[:, i]) if p.relative else theta[:, i] for i, p in enumerate(parameters)}
    one, none = np.ones(count), np.zeros(count)
    constants = {name: np.full(count, value) for name, value in base.items()}
    constants |= {name: value for name, value in factor.items() if "__" in name}
    for name in ("mass_kg", "newton_per_command", *GAINS):
        constants[name] = constants[name] * factor.get(name, one)
    for side, sign in (("minus", -1.0), ("plus", 1.0)):
        dry = 1.0 + sign * factor.get("coulomb_asymmetry", none)
        coulomb = base[f"coulomb_{side}_n"] * factor.get("coulomb_n", one) * dry
        static = base[f"static_{side}_n"] * factor.get("static_n", one) * dry
        constants[f"coulomb_{side}_n"] = coulomb
        constants[f"static_{side}_n"] = np.maximum(static, coulomb)
        constants[f"stribeck_{side}_s_per_mm"] = base[f"stribeck_{side}_s_per_mm"] / factor.get("stribeck_velocity_mm_s", one)
        viscous = 1.0 + sign * factor.get("viscous_asymmetry", none)
        constants[f"viscous_{side}_n_s_per_mm"] = (
            base[f"viscous_{side}_n_s_per_mm"] * factor.get("viscous_n_s_per_mm", one) * viscous
        )
    return constants


def identified_axis(axis: Axis, parameters: tuple[AxisParameter, ...], theta: Floats) -> Axis:
    """The axis with the identified constants in it; friction by direction where it differs."""
    value = {p.name: float(np.exp(t)) if p.relative else float(t) for p, t in zip(parameters, theta, strict=True)}
    friction = axis.friction
    dry, wet = value.get("coulomb_asymmetry", 0.0), value.get("viscous_asymmetry", 0.0)

    def sides(stated: float | tuple[float, float], factor: float, skew: float) -> float | tuple[float, float]:
        low, high = by_side(stated, 0) * factor * (1.0 - skew), by_side(stated, 1) * factor * (1.0 + skew)
        return low if low == high else (low, high)

    static = [
        max(
            by_side(friction.static_n, i) * value.get("static_n", 1.0),
            by_side(friction.coulomb_n, i) * value.get("coulomb_n", 1.0),
        )
        for i in (0, 1)
    ]
    fitted_friction = friction.model_copy(
        update={
            "coulomb_n": sides(friction.coulomb_n, value.get("coulomb_n", 1.0), dry),
            "static_n": sides((static[0], static[1]), 1.0, dry),
            "stribeck_velocity_mm_s": sides(friction.stribeck_velocity_mm_s, value.get("stribeck_velocity_mm_s", 1.0), 0.0),
            "viscous_n_s_per_mm": sides(friction.viscous_n_s_per_mm, value.get("viscous_n_s_per_mm", 1.0), wet),
        }
    )
    force_key = "force_per_command_n" if axis.force_per_command_n is not None else "torque_constant_nm_per_a"
    scaled = {"mass_kg": "mass_kg", force_key: "newton_per_command"} | {gain: gain for gain in GAINS}
    update: dict[str, object] = {key: getattr(axis, key) * value.get(name, 1.0) for key, name in scaled.items()}
    return axis.model_copy(update=update | {"friction": fitted_friction})
