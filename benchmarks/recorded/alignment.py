#!/usr/bin/env python3
"""The section of an operation without a line number: how far off, by progress alone and put right by the signals.

    PYTHONPATH=. .venv/bin/python benchmarks/recorded/alignment.py

Recorded parts of one text, each operation placed in the course of the same one in every other part; the truth is the line, which
the method is not given. A section is four seconds. Progress is the distance run (feed as last told, once a second), the seconds
in which the feed is not 0, or these times the feed override. The plates are of texts of their own: those operations are taken
whose programmed feed and speed agree.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.programs.plates import data_folder
from benchmarks.recorded.parts import TICK_S, Floats, Part, by_text, nist_parts, operations
from twin.anomaly.parts.alignment import BEGUN, Course, Moved, aligned, by_progress, course_of, progress_s

TICKS_MIN = 40
ALIKE = ("T5|1", "T4|1", "T23|1", "T23|2", "T15|1", "T7|1")
"""Operations of plates 1, 10 and 19 with the same feed and speed."""
MEASURES = ("distance", "seconds", "seconds · override")


class Placed(NamedTuple):
    """Mean |section error| by progress alone and with alignment, and the share of ticks more than one section off."""

    plain: float
    aligned: float
    plain_far: float
    aligned_far: float


class Ticked(NamedTuple):
    """The ticks of an operation that moved, and the line of each, counted from its first."""

    ticks: Sequence[Moved]
    lines: Floats


def ticked(part: Part, at: Floats, measure: str) -> Ticked:
    """Return the ticks of an operation that moved, with progress in one of `MEASURES`."""
    feed, speed = part.feed, np.nan_to_num(part.values[:, part.signals.index("spindle_rpm")])
    told = np.nan_to_num(part.feed_override_pct, nan=100.0)
    ticks, lines = [], []
    for tick in at.tolist():
        if part.line[tick] < 0 or feed[tick] <= 0.0:
            continue
        override = max(float(told[tick]), 5.0)
        moved = {
            "distance": feed[tick] * TICK_S / 60.0,
            "seconds": progress_s(feed[tick], None, TICK_S),
            "seconds · override": progress_s(feed[tick], override, TICK_S),
        }[measure]
        ticks.append(Moved(float(moved), (float(feed[tick] / override * 100.0), float(speed[tick]))))
        lines.append(part.line[tick])
    ascending = np.maximum.accumulate(np.array(lines or [0], dtype=np.float64))
    return Ticked(ticks, ascending - ascending[0])


def placed(usual: Ticked, other: Ticked) -> Placed:
    """Return how far off the sections of an operation are in the course of the same one in another part."""
    course, place, progress = course_of(usual.ticks), BEGUN, 0.0
    apart = []
    for tick, true in zip(other.ticks, _true_sections(course, usual.lines, other.lines), strict=True):
        place, section = aligned(course, place, tick.values, tick.moved)
        progress += tick.moved
        apart.append((abs(by_progress(course, progress) - true), abs(section - true)))
    found = np.array(apart)
    return Placed(*found.mean(axis=0).tolist(), *(found > 1).mean(axis=0).tolist())


def _true_sections(course: Course, usual: Floats, other: Floats) -> list[int]:
    """Return the section in which each tick lies by its line; within a line, by the share of its ticks that have passed."""
    first, last = (np.searchsorted(usual, other, side=side) for side in ("left", "right"))
    begin, end = (np.searchsorted(other, other, side=side) for side in ("left", "right"))
    cells = first + (last - first) * (np.arange(len(other)) - begin) / (end - begin)
    return [int(cell) // course.section_cells for cell in np.minimum(cells, len(usual) - 1)]


def pairs(parts: Sequence[Part], only: Sequence[str] = ()) -> Iterator[tuple[Part, Part, str]]:
    """Yield two parts and an operation that both have."""
    for usual in parts:
        for other in parts:
            if usual is not other:
                common = {name for name, _ in operations(usual)} & {name for name, _ in operations(other)}
                yield from ((usual, other, name) for name in sorted(common) if not only or name in only)


def table(parts: Sequence[Part], measure: str, only: Sequence[str] = ()) -> tuple[Placed, int] | None:
    """Return the mean over all pairs of parts and operations, and how many there are."""
    found = []
    for usual, other, name in pairs(parts, only):
        both = [ticked(one, dict(operations(one))[name], measure) for one in (usual, other)]
        if min(len(one.ticks) for one in both) >= TICKS_MIN:
            found.append(placed(*both))
    return (Placed(*np.mean(found, axis=0).tolist()), len(found)) if found else None


def groups() -> Iterator[tuple[str, Sequence[Part], Sequence[str]]]:
    """Yield the groups of parts that were made alike."""
    folder = data_folder()
    plates = [part for part in nist_parts(folder, "plate") if part.text.startswith(("PLATE-1 ", "PLATE-10 ", "PLATE-19 (4160"))]
    yield "plates 1, 10, 19", plates, ALIKE
    for group in ("cover", "box"):
        for text, parts in by_text(nist_parts(folder, group)).items():
            if len(parts) > 1:
                yield text, parts, ()


def main() -> None:
    """Print the table."""
    print(f"{'made from':26} {'progress':20} {'pairs':>5}  |section error|, and share of ticks > 1 section off")
    for name, parts, only in groups():
        for measure in MEASURES:
            row = table(parts, measure, only)
            if row is not None:
                one, count = row
                print(
                    f"{name:26} {measure:20} {count:5}  alone {one.plain:.2f} ({one.plain_far:.0%}), "
                    f"aligned {one.aligned:.2f} ({one.aligned_far:.0%})"
                )


if __name__ == "__main__":
    main()
