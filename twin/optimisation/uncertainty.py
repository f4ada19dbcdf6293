"""The force limit under the twin's uncertainty: how likely it is kept, and by how much to stay below it so that it is.

Each uncertain constant x is drawn as x exp(σ z) with σ its relative standard deviation from [uncertainty], as identification and
diagnosis wrote it, and z standard normal, one draw for the whole program: a harder material is harder in every line.
Constants are taken to be independent of each other, since their intervals do not tell how they go together.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.assumed import is_assumed
from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.machine import MachineFile
from twin.optimisation.answer import Parted, Sensitivity
from twin.optimisation.forces import CutForces
from twin.process.kernel import process_quantities

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
DRAWS = 2000
CUTS_MAX = 48
BINDING = 0.75
PRICED = 0.95
TOOL_CONSTANTS = ("tangential_coefficient_n_per_mm2", "radial_ratio")
DEFAULT_RELATIVE = 0.05


class Uncertain(NamedTuple):
    """A constant of the cut: path as in [uncertainty]; relative: one standard deviation; identified: stated by its path."""

    path: str
    relative: float
    identified: bool


def uncertain_constants(machine: MachineFile, tools: tuple[str, ...] = ("tool",)) -> tuple[Uncertain, ...]:
    """The constants of the cut with their uncertainty, those left out that are exact. tools: where each is described."""
    stated = machine.uncertainty
    paths = [f"{tool}.{name}" for tool in dict.fromkeys(tools) for name in TOOL_CONSTANTS]
    for name, given in added_effects(machine, process_quantities()).items():
        effect = effect_named(name)
        paths += [
            f"effects.{name}.{key}" for key, value in effect.checked(given).items() if value and not key.endswith("phase_rad")
        ]

    def is_known(path: str) -> bool:
        return path in stated and not is_assumed(machine, path)

    found = [Uncertain(path, stated.get(path, stated.get("relative", DEFAULT_RELATIVE)), is_known(path)) for path in paths]
    return tuple(one for one in found if one.relative > 0.0)


def drawn(constants: tuple[Uncertain, ...], draws: int, seed: int) -> dict[str, Floats]:
    """Path → factors (draws,)."""
    chance = np.random.default_rng([seed, 4])
    return {one.path: np.exp(one.relative * chance.standard_normal(draws)) for one in constants}


def binding_cuts(forces: CutForces, advance_mm: Floats) -> tuple[Ints, Floats]:
    """The cuts that may become the one with the greatest force, and the force of each cut at these advances, (cuts,)."""
    peak = forces.peak_n(advance_mm)
    close = np.flatnonzero(peak >= BINDING * peak.max(initial=0.0))
    alike = np.column_stack([advance_mm, forces.cuts.axial_depth_mm, forces.cuts.entry_angle_rad, forces.cuts.exit_angle_rad])[
        close
    ]
    first = np.unique(np.round(alike, 6), axis=0, return_index=True)[1]
    close = close[np.sort(first)]
    return close[np.argsort(-peak[close], kind="stable")][:CUTS_MAX], peak


def greatest_forces_n(forces: CutForces, advance_mm: Floats, factors: Mapping[str, Floats]) -> Floats:
    """The greatest force of the program under each draw, (draws,)."""
    chosen, _ = binding_cuts(forces, advance_mm)
    return np.asarray(forces.drawn_peaks_n(chosen, advance_mm[chosen], factors).max(axis=1))


def margin_for(forces: CutForces, advance_mm: Floats, machine: MachineFile, probability: float, seed: int) -> float:
    """Return the divisor of the limit: the quantile of the greatest force over that with the constants as stated, at least 1."""
    constants = uncertain_constants(machine, forces.numbers)
    if not constants or not len(forces.cuts):
        return 1.0
    greatest = greatest_forces_n(forces, advance_mm, drawn(constants, 2 * DRAWS, seed))
    _, peak = binding_cuts(forces, advance_mm)
    return max(1.0, float(np.quantile(greatest, probability, method="higher") / peak.max()))


def sensitivity(
    forces: CutForces, advance_mm: Floats, machine: MachineFile, limit_n: float, asked: float | None, seed: int
) -> Sensitivity | None:
    """The force limit under the twin's uncertainty, its price left open; None where nothing is uncertain or nothing is cut.

    On draws of its own.
    """
    constants = uncertain_constants(machine, forces.numbers)
    if not constants or not len(forces.cuts):
        return None
    greatest = greatest_forces_n(forces, advance_mm, drawn(constants, DRAWS, seed + 1_000_003))
    _, peak = binding_cuts(forces, advance_mm)
    chosen = binding_cuts(forces, advance_mm)[0]
    parts = []
    for one in constants:
        more = forces.drawn_peaks_n(chosen, advance_mm[chosen], {one.path: np.array([np.exp(one.relative)])}).max()
        parts.append(Parted(one.path, one.relative, 100.0 * float(more / peak.max() - 1.0)))
    parts.sort(key=lambda part: -abs(part.force_pct))
    low, high = np.quantile(greatest, [0.05, 0.95])
    return Sensitivity(
        kept=float(np.mean(greatest <= limit_n)),
        asked=asked,
        draws=DRAWS,
        force_low_n=float(low),
        force_high_n=float(high),
        priced=PRICED if asked is None else asked,
        price_pct=float("nan"),
        parts=tuple(parts),
        source=_source(constants),
        identified=any(one.identified for one in constants),
    )


def _source(constants: tuple[Uncertain, ...]) -> str:
    known = [one.path for one in constants if one.identified]
    if len(known) == len(constants):
        return "intervals that identification or diagnosis gave"
    rest = f"{100 * next(one.relative for one in constants if not one.identified):g} % for each constant"
    return f"{rest}; of {', '.join(known)} the identified interval" if known else f"{rest}: nothing was identified"
