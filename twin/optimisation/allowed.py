"""The room that the limits leave each line: the speeds it may have, and the highest feed at each of them.

    f_max(n) = min(f_high, c_max N n, c_P(n) N n),      V = π D n in its range,      n in the stable lobes

c_max: the advance a tooth period at which force, torque or chip thickness of the worst cut meet their limits; c_P(n): that at
which the power of the cut is what the spindle leaves at this speed. A feed may not be below f_low, nor the chip below its lowest.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.errors import MachineError
from twin.learned.standing import terms_at
from twin.learned.words import LearnedSite
from twin.machine import Limits, MachineFile, Tool
from twin.optimisation.answer import Binds
from twin.optimisation.forces import ADVANCE_MAX_MM, CutForces, advance_at
from twin.optimisation.program import FeedLine, Programmed
from twin.optimisation.spindle_power import SpindlePower
from twin.process.stability import ChatterCut, stable_speeds

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Span = tuple[float, float]
NODES, NODES_FROM, ADVANCE_TOP_MM, SPEEDS = 129, 1e-5, 10.0, 33
HAIR = 1e-9
STEADY_TEETH = 4
INTERRUPTED = 2.0
"""Depth that has to be stable over the programmed one, where teeth come one by one: zero order promises too much."""
ADVANCE_REASONS = (Binds.FORCE, Binds.TORQUE, Binds.CHIP)


class Impossible(NamedTuple):
    """A line (`at` in `Programmed.lines`) for which the limits leave nothing, and why, a sentence without the line's number."""

    at: int
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Allowed:
    """The feed lines that may be changed, (lines,); arrays of speeds and feeds are (…, lines). mm/min, rev/min.

    index: of the line in `Programmed.lines`; cutting: it meets material, so it has a speed of its own
    teeth: of its tool, 1 where it has none; advance_max_mm with its reason; feed_low, feed_high: range of the feed word
    feed_ratio: real feed over the programmed one; spans: speeds that each may have
    nodes_mm, nodes_n: (lines, NODES) greatest mean tangential force at advances; power_w(n) from `spindle`, None = no limit
    diameter_mm: of its tool; advance_low_mm: the advance that makes the lowest chip
    """

    index: Ints
    cutting: NDArray[np.bool_]
    teeth: Floats
    diameter_mm: Floats
    advance_max_mm: Floats
    reason: tuple[Binds, ...]
    feed_low: float
    feed_high: float
    feed_ratio: float
    spans: tuple[tuple[Span, ...], ...]
    nodes_mm: Floats
    nodes_n: Floats
    spindle: SpindlePower | None
    advance_low_mm: Floats

    def __len__(self) -> int:
        return len(self.index)

    def advance_by_power_mm(self, rpm: Floats) -> Floats:
        """c_P(n), (…, lines): infinite where power is no limit."""
        if self.spindle is None or not len(self):
            return np.full(np.shape(rpm), np.inf)
        speed_m_s = np.pi * self.diameter_mm * rpm / 60_000.0
        with np.errstate(divide="ignore"):
            force = self.spindle.allowed_cutting_w(rpm) / np.maximum(speed_m_s, 1e-12)
        out = np.full(np.shape(rpm), np.inf)
        may_bind = self.cutting & (force < self.nodes_n[:, -1])
        for line in np.flatnonzero(may_bind.reshape(-1, len(self)).any(axis=0)):
            wanted = force[..., line]
            with np.errstate(divide="ignore"):
                inside = np.exp(np.interp(np.log(wanted), np.log(self.nodes_n[line]), np.log(self.nodes_mm[line]), left=-np.inf))
            out[..., line] = np.where(wanted >= self.nodes_n[line, -1], np.inf, inside)
        return out

    def feed_max(self, rpm: Floats) -> Floats:
        """The highest feed word at these speeds, (…, lines); below `feed_low` = none is allowed there."""
        by_chip = np.minimum(self.advance_max_mm, self.advance_by_power_mm(rpm)) * self.teeth * rpm / self.feed_ratio
        return np.where(self.cutting, np.minimum(self.feed_high, by_chip), self.feed_high)

    def feed_min(self, rpm: Floats) -> Floats:
        """The lowest feed word at these speeds, (…, lines)."""
        return np.where(
            self.cutting, np.maximum(self.feed_low, self.advance_low_mm * self.teeth * rpm / self.feed_ratio), self.feed_low
        )

    def line(self, line: int) -> "Allowed":
        """One line by itself."""
        return self.lines(np.array([line]))

    def lines(self, chosen: Ints) -> "Allowed":
        """Some lines; each as often as it is named."""
        return _with_spans(self, chosen, [self.spans[int(k)] for k in chosen])

    def with_spans(self, spans: Sequence[tuple[Span, ...]]) -> "Allowed":
        """The same lines with other speeds."""
        return _with_spans(self, np.arange(len(self)), list(spans))


def allowed(
    program: Programmed, forces: CutForces, limits: Limits, feed_ratio: float = 1.0
) -> tuple[Allowed, tuple[Impossible, ...]]:
    """Return what the limits leave each line that may be changed, and the lines for which they leave nothing (not in it)."""
    free = [k for k, line in enumerate(program.lines) if not line.left_alone]
    advance, reasons = _advances(program, forces, limits)
    spindle = SpindlePower.of(program.machine)
    chip = forces.chip_ratio() if len(forces.cuts) else np.empty(0)
    rows: list[tuple[int, tuple[Span, ...], float]] = []
    impossible: list[Impossible] = []
    for k in free:
        line = program.lines[k]
        mine = slice(*line.cuts)
        lowest = 0.0
        if line.cutting and limits.chip_mm is not None and chip[mine].max() > 0.0:
            lowest = limits.chip_mm[0] / float(chip[mine].max())
        spans, why = _spans(program, line, limits) if line.cutting else ((_range(limits),), "")
        why = why or _too_much(program, line, limits, float(advance[k]), lowest, reasons[k], forces, mine, feed_ratio)
        if why:
            impossible.append(Impossible(k, why))
        else:
            rows.append((k, spans, lowest))
    kept = [k for k, _, _ in rows]
    made = _allowed(program, forces, limits, feed_ratio, kept, advance[kept], [reasons[k] for k in kept], spindle, rows)
    return _where_fast_enough(made, impossible)


def _allowed(
    program: Programmed, forces: CutForces, limits: Limits, feed_ratio: float, kept: list[int], advance: Floats,
    reasons: list[Binds], spindle: SpindlePower | None, rows: list[tuple[int, tuple[Span, ...], float]],
) -> Allowed:  # fmt: skip
    lines = [program.lines[k] for k in kept]
    tools = [program.tools[line.tool][1] if line.tool >= 0 else None for line in lines]
    nodes_mm, nodes_n = _nodes(lines, forces, advance, spindle, limits.spindle_rpm[1])
    return Allowed(
        index=np.array(kept, dtype=np.int64),
        cutting=np.array([line.cutting for line in lines], dtype=np.bool_),
        teeth=np.array([tool.teeth if tool is not None else 1 for tool in tools], dtype=np.float64),
        diameter_mm=np.array([tool.diameter_mm if tool is not None else 0.0 for tool in tools], dtype=np.float64),
        advance_max_mm=advance,
        reason=tuple(reasons),
        feed_low=limits.feed_mm_min[0],
        feed_high=limits.feed_mm_min[1],
        feed_ratio=feed_ratio,
        spans=tuple(spans for _, spans, _ in rows),
        nodes_mm=nodes_mm,
        nodes_n=nodes_n,
        spindle=spindle,
        advance_low_mm=np.array([low for _, _, low in rows], dtype=np.float64),
    )


def _advances(program: Programmed, forces: CutForces, limits: Limits) -> tuple[Floats, list[Binds]]:
    """The greatest advance of each line, and which limit it comes from."""
    count = len(forces.cuts)
    each = np.full((3, count), ADVANCE_MAX_MM)
    if count:
        if limits.force_n is not None:
            each[0] = advance_at(forces.peak_n, np.full(count, limits.force_n), count)
        if limits.torque_nm is not None:
            each[1] = advance_at(forces.tangential_n, 2000.0 * limits.torque_nm / forces.diameter_mm, count)
        if limits.chip_mm is not None:
            each[2] = limits.chip_mm[1] / np.maximum(forces.chip_ratio(), 1e-12)
    advance, reasons = np.full(len(program.lines), ADVANCE_MAX_MM), [Binds.FORCE] * len(program.lines)
    for k, line in enumerate(program.lines):
        if line.cutting:
            mine = each[:, slice(*line.cuts)].min(axis=1)
            advance[k], reasons[k] = float(mine.min()), ADVANCE_REASONS[int(np.argmin(mine))]
    return advance, reasons


def _nodes(
    lines: list[FeedLine], forces: CutForces, advance: Floats, spindle: SpindlePower | None, high_rpm: float
) -> tuple[Floats, Floats]:
    """The mean tangential force of the worst cut of each line at advances up to its greatest, evenly in their logarithm.

    Where power cannot bind, at no speed and at the greatest advance, the greatest alone is worked out.
    """
    # without a limit of the advance, power alone is one: the table then ends at a chip that no tool takes
    top = np.minimum(np.where(advance > 0.0, advance, 1.0), ADVANCE_TOP_MM)
    nodes_mm = np.ascontiguousarray(top[:, None] * np.geomspace(NODES_FROM, 1.0, NODES))
    nodes_n = np.zeros((len(lines), NODES))
    nodes_n[:, -1] = _worst_tangential(lines, forces, top, range(len(lines)))
    grid = np.linspace(high_rpm / SPEEDS, high_rpm, SPEEDS)
    for k, line in enumerate(lines):
        if spindle is None or not line.cutting:
            continue
        speed_m_s = np.pi * forces.diameter_mm[line.cuts[0]] * grid / 60_000.0
        if (nodes_n[k, -1] * speed_m_s > spindle.allowed_cutting_w(grid)).any():
            for node in range(NODES - 1):
                nodes_n[k, node] = _worst_tangential(lines, forces, nodes_mm[:, node], [k])[k]
    return nodes_mm, nodes_n


def _worst_tangential(lines: list[FeedLine], forces: CutForces, advance: Floats, which: Iterable[int]) -> Floats:
    out = np.zeros(len(lines))
    chosen = [k for k in which if lines[k].cutting]
    if chosen:
        rows = np.concatenate([np.arange(*lines[k].cuts) for k in chosen])
        force = forces.tangential_n(
            np.concatenate([np.full(lines[k].cuts[1] - lines[k].cuts[0], advance[k]) for k in chosen]), rows
        )
        ends = np.cumsum([lines[k].cuts[1] - lines[k].cuts[0] for k in chosen])
        for k, part in zip(chosen, np.split(force, ends[:-1]), strict=True):
            out[k] = part.max()
    return out


def _range(limits: Limits) -> Span:
    return limits.spindle_rpm


def _spans(program: Programmed, line: FeedLine, limits: Limits) -> tuple[tuple[Span, ...], str]:
    """The speeds of a cutting line: in the spindle's range, with the surface speed in its range, outside chatter."""
    tool = program.tools[line.tool][1]
    low, high = limits.spindle_rpm
    if limits.surface_speed_m_min is not None:
        per_rpm = np.pi * tool.diameter_mm / 1000.0
        low, high = max(low, limits.surface_speed_m_min[0] / per_rpm), min(high, limits.surface_speed_m_min[1] / per_rpm)
        if low > high:
            asked = " to ".join(f"{v:g}" for v in limits.surface_speed_m_min)
            return (), f"no speed of the spindle gives {asked} m/min on {tool.diameter_mm:g} mm"
    spans: tuple[Span, ...] = ((low, high),)
    if tool.modes:
        hardness, cuts = _hardness(program.machine, tool), program.cuts
        arcs = np.round(np.column_stack([cuts.entry_angle_rad, cuts.exit_angle_rad, cuts.heading_rad]), 2)[slice(*line.cuts)]
        for entry, leaving, heading in np.unique(arcs, axis=0).tolist():
            same = (arcs == (entry, leaving, heading)).all(axis=1)
            depth = float(cuts.axial_depth_mm[slice(*line.cuts)][same].max())
            spans = tuple(s for a, b in spans for s in _stable(tool, hardness, entry, leaving, heading, depth, a, b))
            if not spans:
                return (), f"a cut {depth:.3g} mm deep chatters at every speed from {low:.0f} to {high:.0f} rev/min"
    return spans, ""


@lru_cache(maxsize=4096)
def _stable(
    tool: Tool, hardness: float, entry: float, leaving: float, heading: float, depth_mm: float, low: float, high: float
) -> tuple[Span, ...]:
    """Stable speeds of a cut, with the margin that zero order needs where the cut is interrupted."""
    cut = ChatterCut(tool.teeth, hardness * tool.tangential_coefficient_n_per_mm2, tool.radial_ratio, entry, leaving, heading)
    steady = tool.teeth >= STEADY_TEETH and leaving - entry >= np.pi - 0.02
    return stable_speeds(tool.modes, cut, depth_mm * (1.0 if steady else INTERRUPTED), low, high)


def _hardness(machine: MachineFile, tool: Tool) -> float:
    """K_t over the stated one, where the diagnosis found another material; the greatest that learned terms make it."""
    learned = terms_at(machine.learned, (LearnedSite.CUT_FORCE,), "")
    more = sum(max(float(term.value.max()), 0.0) for term in learned) / tool.tangential_coefficient_n_per_mm2
    factors = ((e, effect_named(e.effect).multiplies.get("tangential_coefficient_n_per_mm2")) for e in machine.effects)
    return (1.0 + more) * math.prod(added.parameters.get(factor, 1.0) for added, factor in factors if factor)


def _too_much(
    program: Programmed, line: FeedLine, limits: Limits, advance: float, lowest: float, reason: Binds, forces: CutForces,
    mine: slice, feed_ratio: float,
) -> str:  # fmt: skip
    """Why the slowest feed at the highest speed is still too much; empty = it is not."""
    if not line.cutting:
        return ""
    tool = program.tools[line.tool][1]
    least = limits.feed_mm_min[0] * feed_ratio / (tool.teeth * limits.spindle_rpm[1])
    if advance >= max(least, lowest) * (1.0 - HAIR):
        return ""
    if advance < least and reason is Binds.FORCE:
        force = forces.peak_n(np.full(len(forces.cuts), least))[mine].max()
        slowest = f"{limits.feed_mm_min[0]:g} mm/min at {limits.spindle_rpm[1]:g} rev/min"
        return f"even {slowest} give {force:.1f} N, more than {limits.force_n:.4g} N; a cut less deep, or another limit"
    what = f"the greatest chip {advance * 1000:.1f} µm that {reason} allows is below "
    return what + (
        f"the lowest of {lowest * 1000:.1f} µm" if advance < lowest else "what the slowest feed at the highest speed makes"
    )


def _where_fast_enough(made: Allowed, impossible: list[Impossible]) -> tuple[Allowed, tuple[Impossible, ...]]:
    """Spans without the speeds at which no feed of the range is allowed; lines without any go to the impossible ones."""
    spans: list[tuple[Span, ...]] = []
    for line in range(len(made)):
        left = tuple(s for a, b in made.spans[line] if (s := _fast_part(made, line, a, b)) is not None)
        if not left:
            impossible.append(
                Impossible(int(made.index[line]), "no speed allows a feed within its range; look at power and chip limits")
            )
        spans.append(left)
    keep = np.array([bool(left) for left in spans], dtype=np.bool_)
    if keep.all():
        return _with_spans(made, np.arange(len(made)), spans), tuple(impossible)
    return _with_spans(made, np.flatnonzero(keep), [s for s in spans if s]), tuple(impossible)


def _with_spans(made: Allowed, kept: Ints, spans: list[tuple[Span, ...]]) -> Allowed:
    return Allowed(
        made.index[kept], made.cutting[kept], made.teeth[kept], made.diameter_mm[kept], made.advance_max_mm[kept],
        tuple(made.reason[int(k)] for k in kept), made.feed_low, made.feed_high, made.feed_ratio, tuple(spans),
        made.nodes_mm[kept], made.nodes_n[kept], made.spindle, made.advance_low_mm[kept],
    )  # fmt: skip


def _fast_part(made: Allowed, line: int, low: float, high: float) -> Span | None:
    """The part of a span in which a feed is allowed; f_max − f_min grows to its peak and falls, so that it is one interval."""
    if not made.cutting[line]:
        return (low, high)
    made = made.line(line)
    grid = np.linspace(low, high, 129)
    room = _room(made, grid)
    fits = np.flatnonzero(room >= -HAIR * made.feed_low)
    if not len(fits):
        return None
    ends = [low, high]
    for side, k, out in ((0, fits[0], fits[0] - 1), (1, fits[-1], fits[-1] + 1)):
        if 0 <= out < len(grid):
            inside, outside = float(grid[k]), float(grid[out])
            for _ in range(60):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if _room(made, np.array([middle]))[0] >= 0.0 else (inside, middle)
            ends[side] = inside
    return (ends[0], ends[1])


def _room(one: Allowed, rpm: Floats) -> Floats:
    """By how much the highest feed of the one line is above the lowest, at speeds (n,)."""
    return np.asarray((one.feed_max(rpm[:, None]) - one.feed_min(rpm[:, None]))[:, 0])


def check_tools(machine: MachineFile) -> None:
    """Raises MachineError where no tool is described, before anything else that is missing: nothing else would help."""
    if machine.tool is None and not machine.tools:
        raise MachineError(
            "no [tool]: no force is computed, so that there is nothing to choose; describe the end mill in [tool] or [tools.N] "
            "(turning has no model of force)"
        )


def limits_of(machine: MachineFile, force_limit_n: float | None) -> Limits:
    """[limits] of a machine, with the force limit that was asked for. Raises MachineError where there is none."""
    if machine.limits is None:
        raise MachineError(
            "no [limits]: write feed_mm_min and spindle_rpm, what machine and tool allow, or give --feed-range and --speed-range"
        )
    return machine.limits if force_limit_n is None else machine.limits.model_copy(update={"force_n": force_limit_n})
