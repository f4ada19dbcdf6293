"""The problem: genes in, seconds and cost out, for many candidates in one batch.

A candidate has a gene for each line and one for each group of lines that share a speed, each from 0 to 1. The first is the feed,
between the lowest and the highest that the limits allow at the speed; the second is the speed, on the spans that the group may
have. So every candidate keeps every limit: the force limit is a bound of a gene, and no penalty is needed.

A spindle event of the program takes the speed of the stretch that it is in, else that of the first line after it that has a speed
of its own. Beyond these events a line that has another speed than the one in force gets one, and so does a line that is left
alone, which needs the speed it was written for.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.machine import MachineFile
from twin.motion.candidates import Candidates, Wear, no_wear
from twin.motion.control import LENGTH_OVER_FEED, Control, changed, program_effects
from twin.motion.limits import ACCELERATION_MAX_MM_S2, Limits
from twin.motion.path import Event, EventKind, Kind, Path
from twin.optimisation.allowed import Allowed, Span
from twin.optimisation.closed_form import Worth
from twin.optimisation.economy import Economy
from twin.optimisation.program import Programmed
from twin.optimisation.speeds.groups import NOBODY, SpeedGroups

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SNAP = 0.03


class Evaluated(NamedTuple):
    """The figures of each candidate, (candidates,): seconds, and cost (zeros without [cost])."""

    seconds: Floats
    cost: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Speeds:
    """The source of speeds. owner: (events,) row of `Allowed` whose speed the event takes, NOBODY = the event's own value."""

    candidates: Candidates
    owner: Ints


class FixedTime(NamedTuple):
    """The time that no feed of a line changes, and the tools that it wears.

    by_line_s: (lines,) the share of each; unshared_s: what no line has a share in
    unshared_worn: tools worn on lines that are left alone
    """

    by_line_s: Floats
    unshared_s: float
    unshared_worn: float


@dataclass(frozen=True, eq=False)
class Problem:
    """A program, what the limits leave its lines, and what a second costs.

    allowed: with the speeds that the groups leave each line; economy: None where only time counts
    """

    program: Programmed
    allowed: Allowed
    groups: SpeedGroups
    economy: Economy | None
    control: Control

    @cached_property
    def cutting(self) -> Ints:
        """Rows of the lines that have a speed of their own."""
        return np.flatnonzero(self.allowed.cutting)

    @property
    def genes(self) -> int:
        """The number of genes of a candidate."""
        return len(self.allowed) + len(self.groups)

    @cached_property
    def _group_of_cutting(self) -> Ints:
        return self.groups.of_row[self.cutting]

    def each_of(self, speeds: Floats) -> Floats:
        """The speed of each line (…, lines) by those of the groups (…, groups); of a line in air 0."""
        rpm = np.zeros((*speeds.shape[:-1], len(self.allowed)))
        rpm[..., self.cutting] = speeds[..., self._group_of_cutting]
        return rpm

    @cached_property
    def spans(self) -> tuple[tuple[Span, ...], ...]:
        """The speeds that each group may have."""
        return tuple(self.allowed.spans[row] for row in self.groups.lead.tolist())

    @cached_property
    def _edges(self) -> tuple[Floats, Floats, list[int]]:
        """Lowest and highest speed of each group, and the groups of several spans."""
        low, high = (np.array([spans[k][k] for spans in self.spans], dtype=np.float64) for k in (0, -1))
        return low, high, [group for group, spans in enumerate(self.spans) if len(spans) > 1]

    @cached_property
    def row_of_segment(self) -> Ints:
        """Row of `Allowed` that gives each segment its feed, NOBODY where it keeps its own."""
        rows = np.full(len(self.program.path), NOBODY, dtype=np.int64)
        for row, index in enumerate(self.allowed.index.tolist()):
            for a, b in self.program.lines[index].executions:
                rows[a:b] = row
        return rows

    @cached_property
    def speeds(self) -> Speeds:
        """The events of a candidate, and whose speed each takes."""
        return _speeds(self)

    def limits(self) -> Limits:
        """The limits of the control, effects of the machine included."""
        return self.control.limits

    def ideal_control(self) -> Control:
        """The control with a spindle that takes no time."""
        ideal = self.limits().with_(spindle_acceleration_rpm_s=np.inf, spindle_deceleration_rpm_s=None)
        return Control(ideal, self.control.feed_ratio, self.control.rapid_ratio)

    def decoded(self, genes: Floats) -> tuple[Floats, Floats]:
        """Feed word and speed of each line, (candidates, lines) each; the speed of a line in air is 0."""
        allowed = self.allowed
        low, high, several = self._edges
        part = genes[:, len(allowed) :]
        speeds = np.minimum(low + part * (high - low), high)
        for group in several:
            speeds[:, group] = _on_spans(self.spans[group], part[:, group])
        if self.changes_cost:
            self._snap(speeds)
        rpm = self.each_of(speeds)
        least, most = allowed.feed_min(rpm), allowed.feed_max(rpm)
        return least + genes[:, : len(allowed)] * (most - least), rpm

    @cached_property
    def changes_cost(self) -> bool:
        """Return True where a change of speed takes time: a spindle that ramps, or axes that stop for it."""
        limits = self.limits()
        ideal = np.min(np.asarray(limits.acceleration_mm_s2)) >= ACCELERATION_MAX_MM_S2
        return bool(np.isfinite(limits.spindle_acceleration_rpm_s) or limits.in_position_s > 0.0 or not ideal)

    def _snap(self, speeds: Floats) -> None:
        """A speed that is nearly that of the group before becomes it, where it may: genes alone would never meet."""
        before: Floats | None = None
        for group, spans in enumerate(self.spans):
            if before is not None:
                fits = np.zeros(len(speeds), dtype=np.bool_)
                for a, b in spans:
                    fits |= (before >= a) & (before <= b)
                near = fits & (np.abs(speeds[:, group] - before) <= SNAP * before)
                speeds[:, group] = np.where(near, before, speeds[:, group])
            before = speeds[:, group]

    def encoded(self, feed: Floats, rpm: Floats) -> Floats:
        """Genes (p,) of feeds and speeds (lines,), brought within the limits; of lines that share a speed the longest one's."""
        allowed = self.allowed
        wanted = rpm[self.groups.lead]
        slowest, fastest, several = self._edges
        width = fastest - slowest
        second = np.where(width > 0.0, np.clip((wanted - slowest) / np.where(width > 0.0, width, 1.0), 0.0, 1.0), 0.0)
        speeds = np.minimum(slowest + second * width, fastest)
        for group in several:
            second[group] = _place_on_spans(self.spans[group], float(wanted[group]))
            speeds[group] = _on_spans(self.spans[group], second[group : group + 1])[0]
        speed = self.each_of(speeds)
        low, high = allowed.feed_min(speed[None])[0], allowed.feed_max(speed[None])[0]
        room = np.maximum(high - low, 1e-12)
        return np.concatenate([np.clip((feed - low) / room, 0.0, 1.0), second])

    def evaluate(self, genes: Floats) -> Evaluated:
        """Seconds and cost of candidates, genes (candidates, p)."""
        return self.evaluate_words(*self.decoded(np.atleast_2d(genes)))

    def evaluate_words(self, feed: Floats, rpm: Floats) -> Evaluated:
        """Seconds and cost under these feed words and speeds, (candidates, lines) each."""
        seconds, worn = self.speeds.candidates.seconds_and_wear(*self._brought(feed, rpm), self.wear)
        return Evaluated(seconds, self._cost(seconds, worn))

    def as_programmed(self) -> Evaluated:
        """Evaluate the program as it is."""
        seconds, cost = self.evaluate_path(self.program.path)
        return Evaluated(np.array([seconds]), np.array([cost]))

    def evaluate_path(self, path: Path) -> tuple[float, float]:
        """Seconds and cost of a program that goes the same way, with its own feeds and speeds."""
        plain = Candidates.of(path, self.limits(), (), self.control.feed_ratio, self.control.rapid_ratio)
        feed = np.where(path.kind == Kind.RAPID, 1.0, path.feed_mm_min)[None]
        values = np.array([[event.value for event in path.events]])
        seconds, worn = plain.seconds_and_wear(feed, values, self.wear)
        return float(seconds[0]), float(self._cost(seconds, worn)[0])

    @cached_property
    def wear(self) -> Wear | None:
        """The wear of the tools. In cut only; or all the time (Eq. 20), which lines share by the way that they cut."""
        if self.economy is None:
            return None
        path, economy = self.program.path, self.economy
        factor, cut_mm = np.zeros(len(path)), np.zeros(len(path))
        for line in self.program.lines:
            if not line.cutting or line.tool < 0:
                continue
            of_tool = float(economy.wear_factor(self.program.tools[line.tool][1].diameter_mm))
            part = line.cut_mm / max(line.length_mm, 1e-12)
            for a, b in line.executions:
                feeding = path.kind[a:b] != Kind.RAPID
                factor[a:b] = np.where(feeding, of_tool * (part if economy.wears_in_cut else 1.0), 0.0)
                cut_mm[a:b] = np.where(feeding, path.length_mm[a:b] * part, 0.0)
        whole = cut_mm.sum()
        share = np.zeros(len(path)) if economy.wears_in_cut or whole <= 0.0 else cut_mm / whole
        return Wear(factor, share, economy.exponent)

    def worth(self, per_second: float, of_wear: float) -> Worth:
        """Return what a second and a tool are worth, for the closed form: (1, 0) is time, (per_second, per_tool) cost."""
        lines = [self.program.lines[int(k)] for k in self.allowed.index]
        length = np.array([line.length_mm for line in lines], dtype=np.float64)
        fixed_s = self.fixed_time.by_line_s
        if self.economy is None or of_wear == 0.0:
            zero = np.zeros(len(lines))
            return Worth(length, fixed_s, zero, zero, per_second, 2.0)
        factor = self.economy.wear_factor(self.allowed.diameter_mm) * of_wear
        if not self.economy.wears_in_cut:
            return Worth(length, fixed_s, factor, factor, per_second, self.economy.exponent)
        part = np.array([line.cut_mm / max(line.length_mm, 1e-12) for line in lines])
        return Worth(length, fixed_s, factor * part, 0.0 * factor, per_second, self.economy.exponent)

    def _brought(self, feed: Floats, rpm: Floats) -> tuple[Floats, Floats]:
        """Feeds of all segments and values of all events of each candidate."""
        path, rows, speeds = self.program.path, self.row_of_segment, self.speeds
        own = np.where(path.kind == Kind.RAPID, 1.0, path.feed_mm_min)
        feeds = np.where(rows >= 0, feed[:, np.maximum(rows, 0)], own) if feed.shape[1] else np.tile(own, (len(feed), 1))
        fixed = np.array([event.value for event in speeds.candidates.events], dtype=np.float64)
        if not rpm.shape[1]:
            return feeds, np.tile(fixed, (len(feed), 1))
        return feeds, np.where(speeds.owner >= 0, rpm[:, np.maximum(speeds.owner, 0)], fixed)

    def _cost(self, seconds: Floats, worn: Floats) -> Floats:
        if self.economy is None:
            return np.zeros(len(seconds))
        return seconds * self.economy.per_second + worn * self.economy.per_tool

    @cached_property
    def fixed_time(self) -> FixedTime:
        """The time that no line with a speed of its own cuts, shared out by the way that they cut; and what that leaves.

        Of a spindle that takes no time to change: the least there can be.
        """
        path, wear = self.program.path, self.wear or no_wear(len(self.program.path))
        at_best = np.where(self.row_of_segment >= 0, self.allowed.feed_high, path.feed_mm_min)
        made = self.ideal_control().plan_with(path, at_best)
        own = np.isin(self.row_of_segment, self.cutting)
        fixed = ~own & (wear.factor > 0.0)
        rest_s = made.total_s - float(made.duration_s[own | fixed].sum())
        seconds = np.zeros(len(self.allowed))
        np.add.at(seconds, self.row_of_segment[own], rest_s * wear.share[own])
        rate = wear.factor[fixed] * np.abs(path.commanded_rpm()[fixed]) ** wear.exponent
        worn = float(np.sum(rate * (made.duration_s[fixed] + rest_s * wear.share[fixed])))
        return FixedTime(seconds, float(made.duration_s[fixed].sum() + rest_s - seconds.sum()), worn)


def control_of(machine: MachineFile) -> Control:
    """The control that the machine states, as its effects change it; without [program], length over feed."""
    stated = LENGTH_OVER_FEED if machine.program is None else Limits.of(machine.program)
    return changed(stated, program_effects(machine))


def _speeds(problem: Problem) -> Speeds:
    """Walks over the events and the lines that need a speed."""
    program, groups, rows = problem.program, problem.groups, {int(k): row for row, k in enumerate(problem.allowed.index)}
    programmed_rpm = program.path.commanded_rpm()
    needs: list[tuple[int, int, float, int]] = []  # segment, owner, speed of its own, line
    for k, line in enumerate(program.lines):
        row = groups.carriers.get(k, rows.get(k, NOBODY))
        if line.needs_speed if row == NOBODY else problem.allowed.cutting[row]:
            needs += [(a, row, float(programmed_rpm[a]), line.line) for a, _ in line.executions if programmed_rpm[a] != 0.0]
    needs.sort()
    optional = tuple(Event(segment, EventKind.SPINDLE, rpm, line) for segment, _, rpm, line in needs)
    made = Candidates.of(program.path, problem.limits(), optional, problem.control.feed_ratio, problem.control.rapid_ratio)
    owner = np.full(len(made.events), NOBODY, dtype=np.int64)
    coming = iter(reversed(needs))
    following: tuple[int, int] | None = None
    for e in range(len(made.events) - 1, -1, -1):
        event = made.events[e]
        if made.is_optional[e]:
            segment, row, _, _ = next(coming)
            owner[e], following = row, (segment, row)
        elif event.kind in (EventKind.SPINDLE, EventKind.ORIENT, EventKind.TOOL_CHANGE):
            if event.kind == EventKind.SPINDLE and event.value > 0.0:
                inside = groups.row_inside(event.segment)
                if inside != NOBODY:
                    owner[e] = inside
                elif following is not None:
                    owner[e] = following[1]
            following = None
    first: dict[int, int] = {}  # a block that is run again has one S word for all its runs
    for e, event in enumerate(made.events):
        if owner[e] != NOBODY and not made.is_optional[e]:
            owner[e] = first.setdefault(event.line, int(owner[e]))
    return Speeds(made, owner)


def _on_spans(spans: tuple[tuple[float, float], ...], part: Floats) -> Floats:
    """The speed at a part (0 … 1) of the length of all spans together."""
    lengths = np.array([b - a for a, b in spans])
    total = lengths.sum()
    if total <= 0.0:
        return np.full(len(part), spans[0][0])
    ends = np.cumsum(lengths)
    which = np.minimum(np.searchsorted(ends, part * total, side="left"), len(spans) - 1)
    starts = np.array([a for a, _ in spans])
    return np.asarray(np.minimum(starts[which] + part * total - (ends - lengths)[which], np.array([b for _, b in spans])[which]))


def _place_on_spans(spans: tuple[tuple[float, float], ...], rpm: float) -> float:
    """The part at which a speed, or the nearest one, is."""
    total = sum(b - a for a, b in spans)
    best, done, place = np.inf, 0.0, 0.0
    for a, b in spans:
        inside = min(max(rpm, a), b)
        if abs(inside - rpm) < best:
            best, place = abs(inside - rpm), done + inside - a
        done += b - a
    return place / total if total > 0.0 else 0.0
