"""The seeds of a search: the closed form of each group, the program as it is, common speeds, and the best sequence of speeds;
and the first and the last of these with fewer changes of speed than may be.

The sequence is found by dynamic programming (Viterbi): groups in the order of their first lines, a few speeds for each, a
change costs what the spindle takes to ramp and the axes to stop and start. It is the optimum of that simplified problem, and
as a rule close to that of the whole.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.motion.timeline import effort
from twin.optimisation.allowed import Span
from twin.optimisation.answer import Objective, SpeedChanges
from twin.optimisation.closed_form import Worth, best_together
from twin.optimisation.problem import Problem
from twin.optimisation.speeds.groups import speed_groups

Floats = NDArray[np.float64]
COMMON = 12
SPEEDS_MAX = 48
SWEEP = 24


def worth_of(problem: Problem, objective: Objective, per_second_more: float = 0.0) -> Worth:
    """Return the weights of the closed form: seconds, or cost; `per_second_more` on top, for the points of a front."""
    if objective is Objective.TIME or problem.economy is None:
        return problem.worth(1.0, 0.0)
    return problem.worth(problem.economy.per_second + per_second_more, problem.economy.per_tool)


def closed_form(problem: Problem, objective: Objective, per_second_more: float = 0.0) -> tuple[Floats, Floats]:
    """Feed word and speed of each line, (lines,), at the best speed of its group; of equal ones the cheapest, or nearest."""
    allowed = problem.allowed
    near = np.array([problem.program.lines[int(k)].rpm for k in allowed.index], dtype=np.float64)
    tie = None
    if objective is Objective.TIME and problem.economy is not None:
        tie = problem.worth(problem.economy.per_second, problem.economy.per_tool)
    return best_together(allowed, problem.groups, worth_of(problem, objective, per_second_more), tie, near)


def by_itself(problem: Problem, objective: Objective) -> tuple[Floats, Floats]:
    """As `closed_form`, of lines that share their speed with no other."""
    free = problem.allowed.with_spans(problem.groups.own_spans)
    return closed_form(replace(problem, allowed=free, groups=problem.groups.apart()), objective)


def coarser(problem: Problem) -> Iterator[Problem]:
    """The same problem with fewer changes of speed: its programs are programs of this one, and spare it ramps."""
    kinds = list(SpeedChanges)
    for changes in kinds[kinds.index(problem.groups.changes) + 1 :]:
        allowed, groups, why = speed_groups(problem.program, problem.allowed, changes)
        if not why and len(groups) < len(problem.groups):
            yield replace(problem, allowed=allowed, groups=groups)


def in_sequence(problem: Problem, objective: Objective, per_second_more: float = 0.0) -> list[tuple[Floats, Floats]]:
    """Feeds and speeds (lines,) of the closed form, and of the best sequence of speeds."""
    feed, rpm = closed_form(problem, objective, per_second_more)
    if len(problem.groups) < 2:
        return [(feed, rpm)]
    speeds = sequence(problem, worth_of(problem, objective, per_second_more), rpm)
    return [(feed, rpm), (problem.allowed.feed_max(speeds[None])[0], speeds)]


def seeds(problem: Problem, objective: Objective) -> Floats:
    """Genes (candidates, p) to begin with, the closed form first."""
    single = Objective.COST if objective is Objective.PARETO else objective
    weights = (0.0,)
    if objective is Objective.PARETO and problem.economy is not None:
        weights = (0.0, *np.geomspace(0.05, 2e3, SWEEP).tolist())
    found = []
    for more in weights:
        worth = more * (problem.economy.per_second if problem.economy is not None else 0.0)
        alone, *others = in_sequence(problem, single, worth)
        found += [problem.encoded(*alone), *(problem.encoded(alone[0], rpm) for _, rpm in others)]
    if objective is Objective.PARETO:  # both ends first: a small population takes no more
        found.insert(0, problem.encoded(*closed_form(problem, Objective.TIME)))
    lines = [problem.program.lines[int(k)] for k in problem.allowed.index]
    as_is = np.array([line.feed_mm_min for line in lines]), np.array([line.rpm for line in lines])
    found.append(problem.encoded(*as_is))
    if len(problem.groups):
        low, high = min(a for spans in problem.spans for a, _ in spans), max(b for spans in problem.spans for _, b in spans)
        for common in np.geomspace(low, high, COMMON):
            genes = problem.encoded(as_is[0], np.full(len(lines), common))
            genes[: len(lines)] = 1.0
            found.append(genes)
    for other in coarser(problem):
        found += [problem.encoded(*words) for words in in_sequence(other, single)]
    return np.array(found)


def sequence(problem: Problem, worth: Worth, alone: Floats) -> Floats:
    """The speeds (lines,) of the best sequence among a few speeds for each group; a line in air keeps 0.

    alone: (lines,) the speeds that groups have by themselves
    """
    allowed, groups = problem.allowed, problem.groups.rows
    speeds = _some_speeds(problem, alone[problem.groups.lead])
    feed = allowed.feed_max(np.repeat(speeds[:, None], len(allowed), axis=1)) * allowed.feed_ratio
    value = np.full((len(groups), len(speeds)), np.inf)
    for group, rows in enumerate(groups):
        fits = _fits(problem.spans[group], speeds)
        value[group, fits] = worth.of(rows, feed[np.ix_(fits, rows)], speeds[fits])
    change = _change(problem, worth, speeds)
    come = np.zeros(value.shape, dtype=np.int64)
    total = value[0]
    for group in range(1, len(groups)):
        through = total[:, None] + change
        come[group] = np.argmin(through, axis=0)
        total = through[come[group], np.arange(len(speeds))] + value[group]
    out, k = np.zeros(len(groups)), int(np.argmin(total))
    for group in range(len(groups) - 1, -1, -1):
        out[group] = speeds[k]
        k = int(come[group, k])
    return problem.each_of(out)


def _fits(spans: tuple[Span, ...], speeds: Floats) -> NDArray[np.bool_]:
    return np.array([any(a - 1e-9 <= n <= b + 1e-9 for a, b in spans) for n in speeds], dtype=np.bool_)


def _some_speeds(problem: Problem, alone: Floats) -> Floats:
    """Speeds to choose from: those of groups by themselves and ends of spans, thinned out where there are many, some for each."""
    edges = [edge for spans in problem.spans for span in spans for edge in span]
    speeds = np.unique(np.round(np.concatenate([alone, edges]), 6))
    if len(speeds) > SPEEDS_MAX:
        speeds = speeds[np.unique(np.linspace(0, len(speeds) - 1, SPEEDS_MAX).round().astype(np.int64))]
    left_out = [own for spans, own in zip(problem.spans, alone.tolist(), strict=True) if not _fits(spans, speeds).any()]
    return np.unique(np.concatenate([speeds, left_out]))


def _change(problem: Problem, worth: Worth, speeds: Floats) -> Floats:
    """Return what a change from one speed to another costs, (speeds, speeds): the ramp, and a stop of the axes."""
    limits = problem.limits()
    base = limits.spindle_base_rpm
    tau = np.array([effort(float(n), base) for n in speeds])
    up = tau[None, :] - tau[:, None]
    down_rate = limits.spindle_deceleration_rpm_s
    rate = np.where(
        up > 0.0, limits.spindle_acceleration_rpm_s, down_rate if down_rate is not None else limits.spindle_acceleration_rpm_s
    )
    slowest = np.min(np.asarray(limits.acceleration_mm_s2))
    stop = float(problem.allowed.feed_high / 60.0 / slowest) + limits.in_position_s
    return np.where(up == 0.0, 0.0, worth.per_second * (np.abs(up) / rate + stop))
