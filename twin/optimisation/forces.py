"""The forces of a cut at an advance c in a tooth period: peak force, mean tangential force, chip. All of them grow with c.

Nothing else of feed and speed goes into the force (formats, section 4), so a limit of force is a limit of c: c_max, from which
the feed at any speed n is c_max · N · n. Nominally the force is c times a figure, and c_max is exact; with an edge force or a
size effect it is the root of a growing function, found to 1e-12. What the learned terms of a machine make of it is sampled.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.machine import MachineFile, Tool
from twin.optimisation.learned_forces import LearnedForces
from twin.optimisation.program import Cuts, Programmed
from twin.process.kernel import process_quantities
from twin.process.milling import Milling, milling_force, peak_force, tool_constants

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
RPM = 1000.0
"""Any speed will do: the force depends on the advance."""
ITERATIONS_MAX = 200
ADVANCE_MAX_MM = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class CutForces:
    """The cuts of a program with the tools that make them. Advances c are mm a tooth period, (cuts,) or a number.

    numbers: where each tool is described: `tool`, or `tools.7`; learned: what the learned terms of the machine make of them
    """

    cuts: Cuts
    tools: tuple[Tool, ...]
    numbers: tuple[str, ...]
    tool_of_cut: Ints
    effects: tuple[str, ...]
    effect_constants: Mapping[str, float] = field(default_factory=dict)
    learned: LearnedForces | None = None

    @classmethod
    def of(cls, program: Programmed) -> "CutForces":
        """The forces of a program on its machine, effects included."""
        constants = process_constants(program.machine)
        added = added_effects(program.machine, process_quantities())
        tool = np.array([program.lines[int(line)].tool for line in program.cuts.line], dtype=np.int64)
        named = tuple(f"tools.{n}" if str(n) in program.machine.tools else "tool" for n, _ in program.tools)
        tools, cuts = tuple(tool for _, tool in program.tools), program.cuts
        rows = np.array([cuts.axial_depth_mm, cuts.entry_angle_rad, cuts.exit_angle_rad])
        learned = LearnedForces.of(program.machine.learned, rows, tools, tool, tuple(added), constants)
        return cls(cuts, tools, named, tool, tuple(added), constants, learned)

    @property
    def teeth(self) -> Ints:
        """The teeth of the tool of each cut."""
        return np.array([tool.teeth for tool in self.tools], dtype=np.int64)[self.tool_of_cut]

    @property
    def diameter_mm(self) -> Floats:
        """The diameter of the tool of each cut."""
        return np.array([tool.diameter_mm for tool in self.tools], dtype=np.float64)[self.tool_of_cut]

    def peak_n(self, advance_mm: ArrayLike) -> Floats:
        """Greatest resultant of each cut over a tooth period, (cuts,)."""
        every = np.arange(len(self.cuts))
        return np.asarray(self.peaks_n(every, np.broadcast_to(np.asarray(advance_mm, dtype=np.float64), every.shape)[None])[0])

    def peaks_n(self, chosen: Ints, advance_mm: Floats) -> Floats:
        """Greatest resultant of some cuts at many advances in one batch, (candidates, chosen)."""
        out = np.zeros(advance_mm.shape)
        for index, tool in enumerate(self.tools):
            mine = np.flatnonzero(self.tool_of_cut[chosen] == index)
            if len(mine):
                constants: dict[str, ArrayLike] = {**tool_constants(tool), **self.effect_constants}
                cuts = np.tile(chosen[mine], len(advance_mm))
                out[:, mine] = self._peak(tool, constants, cuts, advance_mm[:, mine].ravel())[0].reshape(len(advance_mm), -1)
        return out if self.learned is None else self.learned.peaks_n(chosen, advance_mm, out)

    def tangential_n(self, advance_mm: ArrayLike, chosen: Ints | None = None) -> Floats:
        """Mean over a turn of the tangential force of all teeth, of all cuts or of the chosen ones."""
        rows = np.arange(len(self.cuts)) if chosen is None else chosen
        advance = np.broadcast_to(np.asarray(advance_mm, dtype=np.float64), rows.shape)
        out = np.zeros(len(rows))
        for index, tool in enumerate(self.tools):
            mine = np.flatnonzero(self.tool_of_cut[rows] == index)
            if len(mine):
                out[mine] = self._tangential_of_tool(tool, rows[mine], advance[mine])
        return out if self.learned is None else self.learned.tangential_n(rows, advance, out)

    def chip_ratio(self) -> Floats:
        """Greatest chip thickness over c: 1 where the arc goes through the middle, else the larger sine of its ends, (cuts,)."""
        entry, leaving = self.cuts.entry_angle_rad, self.cuts.exit_angle_rad
        middle = (entry <= np.pi / 2.0) & (leaving >= np.pi / 2.0)
        return np.where(middle, 1.0, np.maximum(np.sin(entry), np.sin(leaving)))

    def drawn_peaks_n(self, chosen: Ints, advance_mm: Floats, drawn: Mapping[str, Floats]) -> Floats:
        """Peak force of some cuts under drawn constants, (draws, chosen).

        drawn: path as in [uncertainty] (`tool.radial_ratio`, `effects.edge_force.radial_n_per_mm`) → factor on it, (draws,)
        """
        draws = len(next(iter(drawn.values())))
        out = np.zeros((draws, len(chosen)))
        for index, tool in enumerate(self.tools):
            mine = np.flatnonzero(self.tool_of_cut[chosen] == index)
            if len(mine):
                constants: dict[str, ArrayLike] = {**tool_constants(tool), **self.effect_constants}
                for path, factor in drawn.items():
                    where, name = constant_name(path)
                    if name in constants and where in ("", self.numbers[index]):
                        constants[name] = np.asarray(constants[name]) * factor
                out[:, mine] = self._peak(tool, constants, chosen[mine], advance_mm[mine])
        return out if self.learned is None else self.learned.peaks_n(chosen, advance_mm, out)

    def _peak(self, tool: Tool, constants: Mapping[str, ArrayLike], mine: Ints, advance: Floats) -> Floats:
        cuts, feed = self.cuts, advance * tool.teeth * RPM
        arcs = (cuts.entry_angle_rad[mine], cuts.exit_angle_rad[mine])
        return peak_force(constants, tool.teeth, RPM, feed, cuts.axial_depth_mm[mine], *arcs, effects=self.effects)

    def _tangential_of_tool(self, tool: Tool, mine: Ints, advance: Floats) -> Floats:
        cuts = self.cuts
        arcs = (cuts.axial_depth_mm[mine], cuts.entry_angle_rad[mine], cuts.exit_angle_rad[mine])
        return mean_tangential_n({**tool_constants(tool), **self.effect_constants}, self.effects, tool.teeth, arcs, advance)


def mean_tangential_n(
    constants: Mapping[str, ArrayLike],
    effects: Sequence[str],
    teeth: int,
    arcs: tuple[Floats, Floats, Floats],
    advance_mm: Floats,
) -> Floats:
    """Return the mean over a turn of the tangential force of all teeth, (cuts,). arcs: depth, entry and exit of each cut

    A tick lasts a whole turn: at 60 rev/min one of 1 s.
    """
    zero = np.zeros(len(advance_mm))
    motion = Milling(zero, np.full(len(advance_mm), 60.0), advance_mm * teeth, zero, *arcs)
    return np.asarray(milling_force(constants, teeth, motion, period_s=1.0, effects=tuple(effects)).mean_tangential_n[0])


def process_constants(machine: MachineFile) -> dict[str, float]:
    """Return the constants of the effects on the force of the cut, as the kernels name them."""
    added = added_effects(machine, process_quantities())
    return {f"{e}__{k}": v for e, given in added.items() for k, v in effect_named(e).checked(given).items()}


def constant_name(path: str) -> tuple[str, str]:
    """Return whose constant of the cut a path of [uncertainty] names (of all tools: empty), and which.

    >>> constant_name("tools.7.radial_ratio"), constant_name("effects.edge_force.radial_n_per_mm")
    (('tools.7', 'radial_ratio'), ('', 'edge_force__radial_n_per_mm'))
    """
    first, *rest = path.split(".")
    return ("", "__".join(rest)) if first == "effects" else (".".join([first, *rest[:-1]]), rest[-1])


def advance_at(force: Callable[[Floats], Floats], limit: Floats, count: int) -> Floats:
    """The greatest c (count,) at which a growing `force` of c is not above `limit`; 0 where it is above it for any chip.

    Regula falsi in the Illinois form between 0 and a c that is too much: superlinear, and it never leaves its bracket.
    """
    high = np.full(count, 0.05)
    over = force(high)
    for _ in range(60):
        low_yet = (over <= limit) & (high < ADVANCE_MAX_MM)
        if not low_yet.any():
            break
        high = np.where(low_yet, high * 4.0, high)
        over = force(high)
    never = over <= limit
    low, below = np.full(count, 1e-9), force(np.full(count, 1e-9)) - limit
    hopeless = below > 0.0
    above = over - limit
    for _ in range(ITERATIONS_MAX):
        with np.errstate(divide="ignore", invalid="ignore"):
            middle = low - below * (high - low) / (above - below)
        middle = np.where(np.isfinite(middle) & (middle > low) & (middle < high), middle, 0.5 * (low + high))
        value = force(middle) - limit
        is_low = value <= 0.0
        above = np.where(is_low, 0.5 * above, value)
        below = np.where(is_low, value, 0.5 * below)
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        if np.all((np.abs(value) <= 1e-13 * np.abs(limit)) | (high - low <= 1e-13 * high) | hopeless | never):
            low = np.where(np.abs(value) <= 1e-13 * np.abs(limit), middle, low)
            break
    return np.where(hopeless, 0.0, np.where(never, ADVANCE_MAX_MM, low))
