"""The envelope of the recorded runs, which is safe to repeat: how far each axis went, how fast, what
was cut.

A program that a diagnosis suggests stays within this: no axis leaves the box, none goes faster, nothing is cut that was not cut.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from twin.runlog import RunLog


@dataclass(frozen=True, slots=True)
class CutSeen:
    """A cut of a recorded run: its depth and angles, the speed of the spindle, slowest and fastest feed along x and y."""

    axial_depth_mm: float
    entry_angle_rad: float
    exit_angle_rad: float
    spindle_rpm: float
    feed_mm_min: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Envelope:
    """box_mm: axis → lowest and highest position; home_mm: where the runs start; feed_mm_min: axis → fastest

    spindle_rpm: fastest, 0 = it never turned; coolant: whether it ran; warmed_s: longest time that the spindle turned
    """

    box_mm: Mapping[str, tuple[float, float]]
    home_mm: Mapping[str, float]
    feed_mm_min: Mapping[str, float]
    spindle_rpm: float = 0.0
    coolant: bool = False
    warmed_s: float = 0.0
    cut: CutSeen | None = None

    def far_mm(self, axis: str) -> float:
        """The end of the box that is further from home."""
        low, high = self.box_mm[axis]
        home = self.home_mm[axis]
        return high if high - home >= home - low else low


def envelope_of(logs: Iterable[RunLog]) -> Envelope:
    """Return what these runs have done, all together."""
    box: dict[str, tuple[float, float]] = {}
    home: dict[str, float] = {}
    feed: dict[str, float] = {}
    rpm, warmed = 0.0, 0.0
    coolant = False
    cuts: list[CutSeen] = []
    for log in logs:
        for axis in log.axes():
            name = f"{axis}_ref_mm"
            if not log.has(name) or len(log) < 2:
                continue
            reference = log[name]
            low, high = box.get(axis, (np.inf, -np.inf))
            box[axis] = (min(low, float(np.nanmin(reference))), max(high, float(np.nanmax(reference))))
            home.setdefault(axis, float(reference[np.isfinite(reference)][0]))
            feed[axis] = max(feed.get(axis, 0.0), 60.0 * float(np.nanmax(np.abs(np.gradient(reference, log.t_s)))))
        if log.has("spindle_rpm"):
            rpm = max(rpm, float(np.nanmax(log["spindle_rpm"])))
            turning = np.nan_to_num(log["spindle_rpm"]) > 0.0
            warmed = max(warmed, float(turning.sum() * np.median(np.diff(log.t_s))) if len(log) > 1 else 0.0)
        coolant = coolant or (log.has("coolant_on") and bool(np.nanmax(log["coolant_on"]) > 0.0))
        seen = _cut_of(log)
        cuts += [] if seen is None else [seen]
    cut = max(cuts, key=lambda c: c.feed_mm_min[1] / c.feed_mm_min[0], default=None)
    return Envelope(box, home, feed, rpm, coolant, warmed, cut)


def _cut_of(log: RunLog) -> CutSeen | None:
    """The deepest cut of a run."""
    names = ("axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "spindle_rpm", "x_ref_mm", "y_ref_mm")
    if not log.has(*names) or not np.nanmax(log["axial_depth_mm"]) > 0.0:
        return None
    depth = np.nan_to_num(log["axial_depth_mm"])
    speed = 60.0 * np.hypot(*(np.gradient(np.nan_to_num(log[name]), log.t_s) for name in ("x_ref_mm", "y_ref_mm")))
    deepest = int(np.argmax(depth))
    feeding = (depth > 0.0) & (speed > 1.0)
    if not feeding.any():
        return None
    feeds = np.quantile(speed[feeding], [0.1, 0.95])
    angles = [float(log[name][deepest]) for name in names[1:3]]
    return CutSeen(
        float(depth[deepest]), angles[0], angles[1], float(log["spindle_rpm"][deepest]), (float(feeds[0]), float(feeds[1]))
    )
