"""The facts beside an alert, from the recording itself: text, holds, overrides, and speed and feed at the same lines elsewhere.

None of it is used by the scores: it is what a person who looks an alert up would find.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.recorded.expectations import expectation
from benchmarks.recorded.parts import Floats, Part

LOOK_BACK_TICKS = 30
APART = 0.02
FEED_APART = 0.1


def happened(part: Part, at_s: float, earlier: Part | None, folder: Path | None) -> str:
    """Return what the recording shows in the half minute before an alert; earlier: a part of the same label."""
    return "; ".join(_facts(part, int(at_s), earlier, folder)) or "nothing that the recording shows: a false alert"


def _facts(part: Part, at: int, earlier: Part | None, folder: Path | None) -> Iterator[str]:
    own = slice(max(0, at - LOOK_BACK_TICKS), at + 1)
    if earlier is not None and earlier.text != part.text:
        yield f"the text that runs is {part.text}, of which {earlier.text} was known by this label"
    states = set(part.state[own].tolist()) - {"ACTIVE"}
    if states:
        yield f"the control says {', '.join(sorted(states))}"
    for name, override in (("feed", part.feed_override_pct), ("spindle", part.spindle_override_pct)):
        told = override[own][np.isfinite(override[own])]
        if len(told) and (told.min() < 99.0 or told.max() > 101.0):
            yield f"{name} override {told.min():.0f} to {told.max():.0f} %"
    rpm, feed, by = _elsewhere(part, own, earlier, folder)
    here = part.values[own]
    speed_at, feed_at = part.signals.index("spindle_rpm"), part.signals.index("feed_mm_min")
    for what, now, then, least in (("speed", here[:, speed_at], rpm, APART), ("feed", here[:, feed_at], feed, FEED_APART)):
        known = np.isfinite(now) & np.isfinite(then) & (then > 0.0) & (now > 0.0)
        if what == "feed":
            known &= then < 10_000.0  # rapids
        if not known.any():
            continue
        ratio = float(np.median(now[known] / then[known]))
        if abs(ratio - 1.0) > least:
            yield f"{what} {np.median(now[known]):.0f} where {np.median(then[known]):.0f} {by} ({100 * (ratio - 1):+.0f} %)"


def _elsewhere(part: Part, own: slice, earlier: Part | None, folder: Path | None) -> tuple[Floats, Floats, str]:
    """Return speed and feed at the lines of some ticks: in the part before, or as the twin expects them."""
    lines, tools = part.line[own], part.tool[own]
    rpm, feed = np.full(len(lines), np.nan), np.full(len(lines), np.nan)
    if earlier is not None:
        for at, (line, tool) in enumerate(zip(lines.tolist(), tools.tolist(), strict=True)):
            same = np.flatnonzero(earlier.tool == tool)
            if line >= 0 and len(same):
                near = same[np.argmin(np.abs(earlier.line[same] - line))]
                rpm[at], feed[at] = earlier.values[near, earlier.signals.index("spindle_rpm")], earlier.feed[near]
        return rpm, feed, "ran before"
    program = None if folder is None else expectation(folder, part.label)
    for at, line in enumerate(lines.tolist()):
        one = None if program is None else program.at(line)
        if one is not None:
            rpm[at], feed[at] = one.spindle_rpm, one.feed_mm_min
    return rpm, feed, "is programmed"
