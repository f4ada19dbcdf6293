#!/usr/bin/env python3
"""Engagement: how exact, how fast, and what one arc a row loses; beside a plain height map in numpy.

    .venv/bin/python benchmarks/engagement.py [--json]

All figures come from one run on one machine: read the ratios. The plain height map is what a good engineer writes in an
afternoon: one height a cell of 0.05 mm, the rim sampled at 1° half a cell inside the radius, cells under the tool cleared by
slices. Compiled kernels are warm: the first call of a process takes some 0.3 s more to load them, the first on a machine some
15 s to compile.
"""

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.engagement import Engagement, Workpiece, cut
from twin.engagement.rectangle import rectangle
from twin.machine import Stock

Floats = NDArray[np.float64]
R = 3.0
PLATE = Stock(min_mm=(-50.0, -50.0, -10.0), max_mm=(50.0, 50.0, 0.0))
DEPTH_MM = 0.8
STEP_MM = 0.05


def whole(cell_mm: float = 2 * R / 16) -> Workpiece:
    """The plate, with cells of the given size."""
    return Workpiece.of(PLATE, cell_mm)


def polyline(moves: list[tuple[float, float]], chord_mm: float) -> Floats:
    """A path of straight pieces and arcs (length, turn), each tangent to the one before."""
    x, y, heading = -40.0, -20.0, 0.0
    points = [(x, y, -DEPTH_MM)]
    for length, turn in moves:
        chords = max(1, math.ceil(length / chord_mm)) if turn else 1
        for _ in range(chords):
            heading += turn / chords / 2
            chord = length / chords * (math.sin(turn / chords / 2) / (turn / chords / 2) if turn else 1.0)
            x, y = x + chord * math.cos(heading), y + chord * math.sin(heading)
            points.append((x, y, -DEPTH_MM))
            heading += turn / chords / 2
    return np.array(points)


def sample_path() -> Floats:
    """165.7 mm: lines and arcs of 10 mm and 3 mm radius, slots all along."""
    quarter, half = math.pi / 2, math.pi
    lengths = [(5.8, 0.0), (40.0, 0.0), (30.0, 0.0), (15.7, quarter), (20.0, 0.0), (12.0, 0.0), (18.0, quarter), (9.4, half)]
    return polyline([*lengths, (10.0, 0.0), (4.8, 0.0)], STEP_MM)


# The plain height map.


def plain_height_map(points: Floats, radius: float, cell: float, step: float) -> Floats:
    """Depth, entry and exit (rows, 3) by cells and sampled rim."""
    low = points[:, :2].min(axis=0) - radius - cell
    size = np.ceil((points[:, :2].max(axis=0) + radius + cell - low) / cell).astype(int)
    heights = np.zeros(size)
    phi = np.linspace(0.0, math.pi, 181)
    sine, cosine = np.sin(phi), np.cos(phi)
    reach = math.ceil(radius / cell) + 1
    rows = []
    for a, b in pairwise(points):
        length = math.hypot(*(b - a)[:2])
        ux, uy = (b - a)[:2] / length
        count = max(1, math.ceil(length / step - 1e-9))
        for k in range(count):
            x, y, tip = a + (b - a) * (k + 0.5) / count
            inner = radius - cell / 2
            i = ((x + inner * (sine * ux - cosine * uy) - low[0]) / cell).astype(int)
            j = ((y + inner * (sine * uy + cosine * ux) - low[1]) / cell).astype(int)
            depth = heights[i, j] - tip
            met = np.flatnonzero(depth > 1e-9)
            rows.append((depth.max(), phi[met[0]], phi[met[-1]]) if len(met) else (0.0, 0.0, 0.0))
            ci, cj = int((x - low[0]) / cell), int((y - low[1]) / cell)
            window = np.s_[max(ci - reach, 0) : ci + reach + 1, max(cj - reach, 0) : cj + reach + 1]
            gx = (np.arange(window[0].start, min(window[0].stop, size[0])) + 0.5) * cell + low[0] - x
            gy = (np.arange(window[1].start, min(window[1].stop, size[1])) + 0.5) * cell + low[1] - y
            under = gx[:, None] ** 2 + gy**2 < radius**2
            heights[window] = np.where(under, np.minimum(heights[window], tip), heights[window])
    return np.array(rows)


def milliseconds(work: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return (time.perf_counter() - start) * 1e3


def speed(rounds: int) -> dict[str, float]:
    """Milliseconds for the sample path, of ours and of the plain map in turn, and the median arc that each reads of the slot."""
    points = sample_path()
    plate = whole()
    rows = cut(plate, points, 2 * R, STEP_MM)[1]
    plain = plain_height_map(points, R, STEP_MM, STEP_MM)
    ours_ms, plain_ms = [], []
    for _ in range(rounds):
        ours_ms.append(milliseconds(lambda: cut(plate, points, 2 * R, STEP_MM)))
        plain_ms.append(milliseconds(lambda: plain_height_map(points, R, STEP_MM, STEP_MM)))
    return {
        "path_mm": float(rows.length_mm.sum()),
        "rows": len(rows),
        "ours_ms": statistics.median(ours_ms),
        "plain_ms": statistics.median(plain_ms),
        "ratio": statistics.median(plain / ours for ours, plain in zip(ours_ms, plain_ms, strict=True)),
        "ours_median_deg": float(np.degrees(np.median(rows.exit_angle_rad - rows.entry_angle_rad))),
        "plain_median_deg": float(np.degrees(np.median(plain[:, 2] - plain[:, 1]))),
    }


# Closed forms.


def circle(radius: float, chord_mm: float, start: float = 0.0, sweep: float = 2 * math.pi) -> Floats:
    """A circle about the middle of the plate."""
    angle = start + np.linspace(0.0, sweep, 1 + math.ceil(sweep * radius / chord_mm))
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.full(len(angle), -2.0)))


def worst(found: Floats, expected: Floats | float) -> float:
    """Largest error, degrees."""
    return float(np.degrees(np.max(np.abs(found - expected))))


def slot_on_an_arc(plate: Workpiece, chord: float) -> tuple[float, Engagement]:
    """0 to π on a radius of 10 mm."""
    rows = cut(plate, circle(10.0, chord, sweep=math.pi), 2 * R, chord)[1]
    return max(worst(rows.entry_angle_rad, 0.0), worst(rows.exit_angle_rad, math.pi)), rows


def shoulder(plate: Workpiece, chord: float) -> tuple[float, Engagement]:
    """1 mm wide: arccos(1 − 1/3) = 48.19°."""
    rows = cut(plate, [(-60, -52, -2), (60, -52, -2)], 2 * R, chord)[1]
    rows_inside = np.abs(rows.position_mm[:, 0]) < 40
    return worst(rows.exit_angle_rad[rows_inside], math.acos(1 - 1 / R)), rows


def concave(plate: Workpiece, chord: float) -> tuple[float, Engagement]:
    """A round pocket widened by 1 mm on a radius of 10 mm: entry arccos((ρ² + R² − W²) / 2 ρ R), W = 12 mm."""
    left = cut(plate, circle(9.0, chord), 2 * R, chord)[0]
    rows = cut(left, circle(10.0, chord, start=0.1, sweep=math.pi), 2 * R, chord)[1]
    skip = 1 + math.ceil(2.0 / chord)
    return worst(rows.entry_angle_rad[skip:], math.acos((100.0 + R**2 - 144.0) / (20.0 * R))), rows


def way_in(plate: Workpiece, chord: float) -> tuple[float, Engagement]:
    """Out of the air into the plate: at x before its face the arc opens to arcsin(−x / R)."""
    rows = cut(plate, [(-54, 0, -2), (-45, 0, -2)], 2 * R, chord)[1]
    x = rows.position_mm[:, 0] + 50
    opening = (x > -0.98 * R) & (x < 0)
    return worst(rows.entry_angle_rad[opening], np.arcsin(-x[opening] / R)), rows


def accuracy() -> list[dict[str, float | str]]:
    """Largest error of an angle and of the depth of 2 mm, for chords (and rows) and cells of several sizes."""
    table: list[dict[str, float | str]] = []
    for chord, cell in ((1.0, 0.375), (0.5, 0.375), (0.2, 0.375), (0.1, 0.375), (0.05, 0.375), (0.1, 1.5), (0.1, 0.1)):
        row: dict[str, float | str] = {"chord_mm": chord, "cell_mm": cell}
        depth = 0.0
        for case in (slot_on_an_arc, shoulder, concave, way_in):
            row[case.__name__], rows = case(whole(cell), chord)
            depth = max(depth, float(np.max(np.abs(rows.axial_depth_mm[rows.exact & rows.engaged] - 2.0))))
        row["depth_mm"] = depth
        table.append(row)
    return table


def balance() -> dict[str, float]:
    """Removed according to the rows over missing according to the workpiece, less 1, for a pocket in three layers and a helix."""
    lanes: list[tuple[float, float, float]] = []
    for layer in range(3):
        for lane in range(13):
            side = 20.0 if (lane + layer) % 2 else -20.0
            lanes += [(side, -24.0 + 4.0 * lane, -1.0 - layer), (-side, -24.0 + 4.0 * lane, -1.0 - layer)]
    angle = np.linspace(0.0, 8 * math.pi, 2000)
    helix = np.column_stack((4 * np.cos(angle), 4 * np.sin(angle), -angle / 8))
    result = {}
    for name, path in (("pocket", np.array(lanes)), ("helix", helix)):
        begun = cut(whole(), path[[0, 0]], 2 * R)[0]
        left, rows = cut(begun, path, 2 * R, 0.1)
        result[name] = float(rows.removed_mm3.sum() / (begun.volume_mm3() - left.volume_mm3()) - 1.0)
    return result


# What one arc a row loses.


def reduction(count: int = 2000) -> list[dict[str, float | str]]:
    """Error of mean force (K_e = 0.4) and of the peak of a tooth, for random rims.

    By the rectangle of equal mean force, and by the outermost angles with the depth of equal power.
    """
    chance = np.random.default_rng(1)
    phi = (np.arange(1800) + 0.5) * math.pi / 1800
    figures: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for kind in ("one step", "two arcs"):
        for _ in range(count):
            edges = np.sort(chance.uniform(0.0, math.pi, 4))
            inner = (phi > edges[1]) & (phi < edges[2])
            true = np.where((phi > edges[0]) & (phi < edges[3]) & ~inner, 1.0, 0.0)
            if kind == "one step":
                true = np.where((phi > edges[0]) & (phi < edges[1]), chance.uniform(0.2, 2.0), 0.0) + np.where(
                    inner, chance.uniform(0.2, 2.0), 0.0
                )
            moments = _moments(phi, true)
            if moments[0] < 1e-3:
                continue
            depth, entry, leave = rectangle(*moments)
            on = phi[true > 0.0]
            outer = (phi >= on[0]) & (phi <= on[-1])
            flat = moments[0] / _moments(phi, outer.astype(float))[0]
            for name, model in (("rectangle", np.where((phi > entry) & (phi < leave), depth, 0.0)), ("outermost", flat * outer)):
                force, sought = _mean_force(_moments(phi, model)), _mean_force(moments)
                peak = (model * np.sin(phi)).max() / (true * np.sin(phi)).max() - 1.0
                figures.setdefault((kind, name), []).append((float(np.hypot(*(force - sought)) / np.hypot(*sought)), float(peak)))
    table: list[dict[str, float | str]] = []
    for (kind, name), found in figures.items():
        force_error, peak_error = np.array(found).T
        table.append(
            {
                "rim": kind,
                "by": name,
                "force_median": float(np.median(force_error)),
                "force_95": float(np.quantile(force_error, 0.95)),
                "peak_median": float(np.median(peak_error)),
                "peak_5": float(np.quantile(peak_error, 0.05)),
            }
        )
    return table


def _moments(phi: Floats, depth: Floats) -> tuple[float, float, float]:
    weight = depth * np.sin(phi) * math.pi / len(phi)
    return float(weight.sum()), float((weight * np.sin(phi)).sum()), float((weight * np.cos(phi)).sum())


def _mean_force(moments: tuple[float, float, float], ratio: float = 0.4) -> Floats:
    return np.array([-moments[2] - ratio * moments[1], moments[1] - ratio * moments[2]])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    taken, table, volumes, losses = speed(options.rounds), accuracy(), balance(), reduction()
    if options.json:
        print(json.dumps({"speed": taken, "accuracy": table, "balance": volumes, "reduction": losses}))
        return
    print(
        f"{taken['path_mm']:.1f} mm of slot, lines and arcs, {taken['rows']:.0f} rows of {STEP_MM} mm; median arc (180° is right)"
    )
    print(f"  ours             {taken['ours_ms']:8.1f} ms   {taken['ours_median_deg']:6.1f}°")
    print(f"  plain numpy map  {taken['plain_ms']:8.1f} ms   {taken['plain_median_deg']:6.1f}°")
    print(f"  ratio            {taken['ratio']:8.1f}")
    print("\nlargest error, degrees; of the depth of 2 mm, mm. R = 3 mm, ρ = 10 mm, a_e = 1 mm; rows as long as chords")
    print("  chord mm  cell mm  slot on arc  shoulder  concave wall    way in     depth")
    for row in table:
        left = f"  {row['chord_mm']:8}  {row['cell_mm']:7}  {row['slot_on_an_arc']:11.1e}  {row['shoulder']:8.1e}"
        print(f"{left}  {row['concave']:12.3f}  {row['way_in']:8.1e}  {row['depth_mm']:8.1e}")
    print("\nremoved according to the rows over what is missing, less 1")
    for name, share in volumes.items():
        print(f"  {name:<8}{100 * share:+8.3f} %")
    print("\none arc for a rim that has several: error of the mean force and of a tooth's peak, over random rims")
    print("  rim       by            force median      95 %   peak median       5 %")
    for loss in losses:
        percent = [100 * float(loss[key]) for key in ("force_median", "force_95", "peak_median", "peak_5")]
        figures = f"{percent[0]:12.1f} %  {percent[1]:6.1f} %  {percent[2]:10.1f} %  {percent[3]:6.1f} %"
        print(f"  {loss['rim']:<9} {loss['by']:<12} {figures}")


if __name__ == "__main__":
    main()
