"""Transients in a recording that nobody labelled, for a person to look at: change points by ruptures, grouped in time.

KernelCPD (Arlot, Celisse and Harchaoui 2019; linear kernel, which is the exact search for changes of the mean) over windows of
the level, thinned to at most POINTS. Changes that follow each other closely are one transient. What goes down and comes up
again, and does so a lot, is listed first: a change of tool stops the spindle and starts it again.
"""

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from twin.transient.level import levels
from twin.transient.stream import Stream

Floats = NDArray[np.float64]
WINDOW_S = 600.0
POINTS = 1200
PENALTY = 6.0
"""Times variance of the noise times log n, for each change point more."""
APART_S = 15.0
LONGEST_S = 90.0
CANDIDATES_MAX = 1000


@dataclass(frozen=True, slots=True)
class Candidate:
    """A transient from `begin_s` to `end_s`; at_s: what to give as --at; dip: how far the level falls below both its sides."""

    source: str
    begin_s: float
    at_s: float
    end_s: float
    dip: float
    is_known: bool


def candidates_of(streams: list[Stream], signal: str) -> list[Candidate]:
    """Candidates, the deepest dip first. Raises UsageError where ruptures is not installed."""
    try:
        ruptures: Any = importlib.import_module("ruptures")
    except ImportError:
        raise UsageError("candidates are found by ruptures, which is not installed: pip install 'cnctwin[anomaly]'") from None
    found: list[Candidate] = []
    for stream in streams:
        level = levels(signal, stream.values)
        size = max(1, round(WINDOW_S / stream.period_s))
        thin = max(1, -(-size // POINTS))
        times: list[float] = []
        for first in range(0, len(level), size):
            piece = level[first : first + size]
            points = piece[: len(piece) // thin * thin].reshape(-1, thin).mean(axis=1)
            if len(points) < 8 or np.ptp(points) == 0.0:
                continue
            noise = max(float(np.median(np.abs(np.diff(points)))) / 0.954, 0.02 * float(np.ptp(points)))
            search = ruptures.KernelCPD(kernel="linear", min_size=2).fit(points.reshape(-1, 1))
            ends = search.predict(pen=PENALTY * noise**2 * np.log(len(points)))
            times += [stream.begin_s + (first + end * thin) * stream.period_s for end in ends[:-1]]
        found += [one for group in _groups(times) if (one := _candidate(stream, level, group)) is not None]
    return sorted(found, key=lambda one: -one.dip)[:CANDIDATES_MAX]


def _groups(times: list[float]) -> list[list[float]]:
    groups: list[list[float]] = []
    for at_s in times:
        if groups and at_s - groups[-1][-1] <= APART_S and at_s - groups[-1][0] <= LONGEST_S:
            groups[-1].append(at_s)
        else:
            groups.append([at_s])
    return groups


def _candidate(stream: Stream, level: Floats, group: list[float]) -> Candidate | None:
    begin, end = stream.index(group[0]), stream.index(group[-1])
    side = max(1, round(2.0 / stream.period_s))
    before, after = level[max(0, begin - side) : begin], level[end : end + side]
    if len(group) < 2 or not len(before) or not len(after):
        return None
    inside = level[begin:end]
    dip = min(float(np.median(before)), float(np.median(after))) - float(np.quantile(inside, 0.2))
    if dip <= 0.0:
        return None
    at_s = (group[0] + group[-1]) / 2.0
    is_known = any(group[0] - APART_S <= change_s <= group[-1] + APART_S for change_s in stream.changes_s)
    return Candidate(stream.source, round(group[0], 2), round(at_s, 2), round(group[-1], 2), round(dip, 3), is_known)
