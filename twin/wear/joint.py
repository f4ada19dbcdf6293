"""The joint estimate of a machine's tools: the material of the batch, the part, and share and rate of each tool, as one
Gaussian.

    level_j = c + e + gain_j R_j g_j(u_j) + ε_j      c: batch, e: part, u_j: share of the life of tool j      (twin/wear/trend.py)

A level tells of material and wear together, so their errors belong together: after a batch has changed, only tools whose wear
is known tell how hard the new one is, and each sharp tool tells more. A Kalman filter with the whole covariance keeps that; two
filters that take the other's mean for granted are too sure of themselves.
"""

from collections.abc import Mapping, Sequence
from math import log, sqrt
from typing import NamedTuple

from twin.wear.trend import HUBER, Trend, Wander

TOOLS_MAX = 24
"""Tools whose errors are kept together; of those used longest ago each is on its own again."""
BATCH_WANDER = 1e-6
"""Variance by which the material of a batch wanders in a part: 1 % in a hundred parts."""
MATERIAL, PART, FIRST = 0, 1, 2
_NO_ROW: tuple[float, ...] = (0.0, 0.0)


class Joint(NamedTuple):
    """Means (batch, part, then share and rate of each tool) and their covariance, by rows."""

    names: tuple[str, ...] = ()
    means: tuple[float, ...] = (0.0, 0.0)
    rows: tuple[tuple[float, ...], ...] = ((1e-8, 0.0), (0.0, 0.0))

    def place(self, name: str) -> int:
        """Return the place of a tool's share; its rate is the next one."""
        return FIRST + 2 * self.names.index(name)


class Observed(NamedTuple):
    """A level of a tool. slope: by how much it rises with the share, 0 where the tool is sharp; expected: without the material"""

    name: str
    level: float
    noise: float
    expected: float
    slope: float


def with_tool(joint: Joint, name: str, trend: Trend) -> Joint:
    """Return the knowledge with a tool that is known by itself, instead of what was known of it."""
    if name in joint.names:
        joint = without(joint, name)
    if len(joint.names) >= TOOLS_MAX:
        joint = without(joint, joint.names[0])
    size = len(joint.means)
    rows = [(*row, 0.0, 0.0) for row in joint.rows]
    none = (0.0,) * size
    rows += [(*none, trend.var, trend.cov), (*none, trend.cov, trend.rate_var)]
    return Joint((*joint.names, name), (*joint.means, trend.share, trend.rate), tuple(rows))


def without(joint: Joint, name: str) -> Joint:
    """Return the knowledge without a tool."""
    return only(joint, [one for one in joint.names if one != name])


def only(joint: Joint, names: Sequence[str]) -> Joint:
    """Return the knowledge of these tools."""
    kept = [MATERIAL, PART]
    for name in names:
        kept += [joint.place(name), joint.place(name) + 1]
    rows = tuple(tuple(joint.rows[place][other] for other in kept) for place in kept)
    return Joint(tuple(names), tuple(joint.means[place] for place in kept), rows)


def trend_of(joint: Joint, name: str, fit: float = 0.0) -> Trend:
    """Return what is known of one tool."""
    place = joint.place(name)
    row = joint.rows[place]
    return Trend(joint.means[place], joint.means[place + 1], row[place], row[place + 1], joint.rows[place + 1][place + 1], fit)


def renewed(joint: Joint, place: int, mean: float, var: float) -> Joint:
    """Return the knowledge after one of its quantities was drawn again, by itself."""
    rows = [[0.0 if place in {row, column} else value for column, value in enumerate(own)] for row, own in enumerate(joint.rows)]
    rows[place][place] = var
    means = (*joint.means[:place], mean, *joint.means[place + 1 :])
    return Joint(joint.names, means, tuple(map(tuple, rows)))


def passed(joint: Joint, part: float, wanders: Mapping[str, Wander]) -> Joint:
    """Return the knowledge at the next part, in which these tools cut. part: standard deviation of a part within its batch"""
    joint = renewed(joint, PART, 0.0, part * part)
    means, rows = list(joint.means), [list(row) for row in joint.rows]
    rows[MATERIAL][MATERIAL] += BATCH_WANDER
    for name, wander in wanders.items():
        share, rate = joint.place(name), joint.place(name) + 1
        means[share] += means[rate]
        rows[share] = [a + b for a, b in zip(rows[share], rows[rate], strict=True)]
        for row in rows:
            row[share] += row[rate]
        rows[share][share] += wander.share
        rows[rate][rate] += wander.rate
    return Joint(joint.names, tuple(means), tuple(map(tuple, rows)))


def off(joint: Joint, seen: Observed) -> tuple[float, float]:
    """Return by how much a level is off what is expected, and the variance of that."""
    rows = joint.rows
    var = rows[MATERIAL][MATERIAL] + 2.0 * rows[MATERIAL][PART] + rows[PART][PART] + seen.noise
    if seen.slope:
        place = joint.place(seen.name)
        own = rows[place]
        var += seen.slope * (2.0 * (own[MATERIAL] + own[PART]) + seen.slope * own[place])
    return seen.level - seen.expected - joint.means[MATERIAL] - joint.means[PART], var


def observed(joint: Joint, seen: Observed) -> tuple[Joint, float]:
    """Return the knowledge with a level, and what the level cost in −log probability; one far off pulls as one at HUBER does."""
    miss, var = off(joint, seen)
    far = abs(miss) / sqrt(var)
    if far > HUBER:
        miss *= HUBER / far
    weights = [row[MATERIAL] + row[PART] for row in joint.rows]
    if seen.slope:
        place = joint.place(seen.name)
        weights = [weight + seen.slope * row[place] for weight, row in zip(weights, joint.rows, strict=True)]
    gains = [weight / var for weight in weights]
    means = tuple([mean + gain * miss for mean, gain in zip(joint.means, gains, strict=True)])
    rows = tuple([
        tuple([value - gain * weight for value, weight in zip(row, weights, strict=True)])
        for row, gain in zip(joint.rows, gains, strict=True)
    ])  # fmt: skip
    return Joint(joint.names, means, rows), 0.5 * far * far + 0.5 * log(var)
