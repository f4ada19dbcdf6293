"""A signal over time, and what is known of it at evenly spaced times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A signal over time. t_s: (n,) increasing; value: (n,), NaN where it was told that it is not known."""

    t_s: Floats
    value: Floats

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def is_known(self) -> bool:
        """True if anything was ever known."""
        return bool(np.isfinite(self.value).any())

    def moved(self, by_s: float) -> "Track":
        """The same, told so much later."""
        return Track(self.t_s + by_s, self.value)


@dataclass(frozen=True, slots=True)
class Grid:
    """Windows of `every_s` from `from_s` on; their values hold for [start, start + every_s)."""

    from_s: float
    every_s: float
    count: int

    @classmethod
    def over(cls, from_s: float, to_s: float, every_s: float) -> "Grid":
        """As many whole windows as fit."""
        return cls(from_s, every_s, max(0, int(np.floor((to_s - from_s) / every_s + 1e-9))))

    @property
    def starts_s(self) -> Floats:
        """(count,)"""
        return np.asarray(self.from_s + self.every_s * np.arange(self.count))

    @property
    def hours(self) -> float:
        """The hours of all windows."""
        return self.count * self.every_s / 3600.0


def held(track: Track | None, grid: Grid, held_s: float) -> Floats:
    """(count,) what was told last before the middle of each window, no longer than `held_s` before; NaN where nothing was.

    >>> held(Track(np.array([0.0, 4.0]), np.array([1.0, 2.0])), Grid(0.0, 1.0, 7), 2.0).tolist()
    [1.0, 1.0, nan, nan, 2.0, 2.0, nan]
    """
    if track is None or not len(track):
        return np.full(grid.count, np.nan)
    middle = grid.starts_s + 0.5 * grid.every_s
    place = np.searchsorted(track.t_s, middle, side="right") - 1
    value = np.where(place >= 0, track.value[np.maximum(place, 0)], np.nan)
    return np.where((place >= 0) & (middle - track.t_s[np.maximum(place, 0)] <= held_s), value, np.nan)


def averaged(track: Track | None, grid: Grid) -> Floats:
    """(count,) the mean of what was told within each window; NaN where nothing was.

    >>> averaged(Track(np.array([0.0, 0.5, 2.5]), np.array([1.0, 3.0, 7.0])), Grid(0.0, 1.0, 3)).tolist()
    [2.0, nan, 7.0]
    """
    if track is None or not len(track) or not grid.count:
        return np.full(grid.count, np.nan)
    place = np.floor((track.t_s - grid.from_s) / grid.every_s + 1e-9).astype(np.int64)
    inside = (place >= 0) & (place < grid.count) & np.isfinite(track.value)
    count = np.bincount(place[inside], minlength=grid.count)
    total = np.bincount(place[inside], weights=track.value[inside], minlength=grid.count)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
