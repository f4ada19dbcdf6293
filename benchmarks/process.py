#!/usr/bin/env python3
"""Time of the milling force over 30 s of cut at 1 kHz, beside a plain C loop that computes the same.

    .venv/bin/python benchmarks/process.py [--ticks N] [--json]

Force at each tick, mean force and mean power until the next tick (exact at entry and exit), 2 and 4 teeth, 3,600 rev/min, in the
cut all the time; one candidate, and 64 at once on the same motion. The yardstick is what one writes in C for one candidate, gcc
-O3, with the same nodes and the same effects; both are checked against each other. Its helix is 16 slices, where ours is the
whole edge at once, so there they differ by what slices leave out. Read the ratios, not the milliseconds: all are medians of one
run on one machine. Where there is no gcc, there are no ratios.
"""

import argparse
import ctypes
import json
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from twin.machine import Tool
from twin.process.milling import Milling, MillingForce, milling_force, peak_force, tool_constants
from twin.spindle.load import spindle_load_pct

TOOL = Tool(diameter_mm=20.0, teeth=4, tangential_coefficient_n_per_mm2=900.0, radial_ratio=0.4)
DRIVE = {"rated_power_kw": 11.0, "efficiency": 0.85, "idle_power_kw": 0.25}
VALUES = {
    "cutting_coefficient__scale": 1.1,
    "edge_force__tangential_n_per_mm": 10.0,
    "edge_force__radial_n_per_mm": 15.0,
    "size_effect__exponent": 0.25,
    "runout__eccentricity_mm": 0.01,
    "runout__phase_rad": 1.0,
    "helix__angle_deg": 30.0,
}
FOUR = ("cutting_coefficient", "edge_force", "size_effect", "runout")
VARIANTS: dict[str, tuple[str, ...]] = {"nominal": (), "four effects": FOUR, "five effects, with a helix": (*FOUR, "helix")}
BATCH = 64

SOURCE = r"""
#include <math.h>
#define P2 6.283185307179586
static const double X[4] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
static const double W[4] = {0.34785484513745385, 0.6521451548625461, 0.6521451548625461, 0.34785484513745385};

typedef struct { double k, ke, scale, kte, kre, m, ecc, phase, helix, d; } par;

static inline void tooth(const par *p, double c, double phi, double step, double *a, double *b, double *t) {
    double s = sin(phi), co = cos(phi), h = c * s, k = p->k, ft, fr;
#if EFFECTS > 0
    if (step != 0.0) h = h + step > 0.0 ? h + step : 0.0;
    k *= p->scale;
    if (h > 0.0) k *= pow(h / 0.05, -p->m);
    ft = k * h; fr = p->ke * ft;
    if (h > 0.0) { ft += p->kte; fr += p->kre; }
#else
    ft = k * h; fr = p->ke * ft;
#endif
    *a = -ft * co - fr * s; *b = ft * s - fr * co; *t = ft;
}

void milling(long n, int teeth, double period, const par *p, const double *ang, const double *rpm, const double *vx,
             const double *vy, const double *ap, const double *en, const double *ex, double *out) {
    for (long i = 0; i < n; i++) {
        double o[5] = {0, 0, 0, 0, 0}, v = sqrt(vx[i] * vx[i] + vy[i] * vy[i]);
        if (rpm[i] > 0 && ap[i] > 0 && v > 0) {
            double c = v * 60 / (teeth * rpm[i]), turn = rpm[i] * period * P2 / 60, heading = atan2(vy[i], vx[i]);
            double width = ex[i] - en[i], a0 = 0, b0 = 0, a = 0, b = 0, t = 0, fa, fb, ft;
            if (width < 0) width += P2;
            int slices = EFFECTS > 1 ? 16 : 1;
            for (int q = 0; q < slices; q++) {
                double lag = EFFECTS > 1 ? 2 * ap[i] * (q + 0.5) / slices * tan(p->helix * P2 / 360) / p->d : 0.0;
                for (int j = 0; j < teeth; j++) {
                    double step = 0, u = ang[i] - heading - en[i] - lag + j * P2 / teeth;
#if EFFECTS > 0
                    step = p->ecc * (cos(p->phase + j * P2 / teeth) - cos(p->phase + (j - 1) * P2 / teeth));
#endif
                    u -= P2 * floor(u / P2);
                    if (u <= width) { tooth(p, c, en[i] + u, step, &fa, &fb, &ft); a0 += fa; b0 += fb; }
                    for (double w = 0; w < u + turn; w += P2) {
                        double lo = u > w ? u : w, hi = u + turn < w + width ? u + turn : w + width;
                        if (hi > lo) {
                            int pieces = (int)((hi - lo) / 0.9) + 1;
                            double half = 0.5 * (hi - lo) / pieces;
                            for (int r = 0; r < pieces; r++)
                                for (int k = 0; k < 4; k++) {
                                    tooth(p, c, en[i] + lo + half * (2 * r + 1 + X[k]), step, &fa, &fb, &ft);
                                    a += half * W[k] * fa; b += half * W[k] * fb; t += half * W[k] * ft;
                                }
                        }
                    }
                }
            }
            double ch = vx[i] / v, sh = vy[i] / v, d = ap[i] / slices;
            o[0] = d * (a0 * ch - b0 * sh); o[1] = d * (a0 * sh + b0 * ch);
            o[2] = d / turn * (a * ch - b * sh); o[3] = d / turn * (a * sh + b * ch); o[4] = d * t / turn;
        }
        for (int k = 0; k < 5; k++) out[k * n + i] = o[k];
    }
}
"""

Run = Callable[[], object]


def a_cut(ticks: int) -> Milling:
    """A curved feed at a changing speed, always in the cut."""
    t = 0.001 * np.arange(ticks)
    speed, heading = 20.0 + 10.0 * np.sin(2.0 * math.pi * t / 3.0), 0.3 * t
    constant = [np.full(ticks, value) for value in (2.0, 0.3, 2.2)]
    angle = np.mod(3600.0 / 60.0 * 2.0 * math.pi * t, 2.0 * math.pi)
    return Milling(angle, np.full(ticks, 3600.0), speed * np.cos(heading), speed * np.sin(heading), *constant)


def in_c(folder: Path, effects: int) -> Callable[[Milling, int], NDArray[np.float64]] | None:
    """The C loop with this much of effects, or None without a compiler."""
    if not shutil.which("gcc"):
        return None
    source, library = folder / "milling.c", folder / f"milling_{effects}.so"
    source.write_text(SOURCE)
    command = ["gcc", "-O3", f"-DEFFECTS={effects}", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
    subprocess.run(command, check=True)
    loop = ctypes.CDLL(str(library)).milling
    pointer = ctypes.POINTER(ctypes.c_double)
    parameters = [900.0, 0.4, *VALUES.values(), TOOL.diameter_mm]

    def run(motion: Milling, teeth: int) -> NDArray[np.float64]:
        arrays = [np.ascontiguousarray(getattr(motion, name)) for name in Milling.__slots__]
        out = np.empty((5, arrays[0].size))
        given = (ctypes.c_double * len(parameters))(*parameters)
        loop(
            ctypes.c_long(arrays[0].size),
            ctypes.c_int(teeth),
            ctypes.c_double(0.001),
            given,
            *[array.ctypes.data_as(pointer) for array in arrays],
            out.ctypes.data_as(pointer),
        )
        return out

    return run


def milliseconds(runs: dict[str, Run], repeats: int) -> dict[str, float]:
    """Median of each, taken in turn so that what else the machine does meets them all."""
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run()
    for _ in range(repeats):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            taken[name].append(1000.0 * (time.perf_counter() - start))
    return {name: median(values) for name, values in taken.items()}


def difference_n(force: MillingForce, plain: NDArray[np.float64]) -> float:
    rows = (force.force_x_n, force.force_y_n, force.mean_force_x_n, force.mean_force_y_n, force.mean_tangential_n)
    return max(float(np.abs(row[0] - other).max()) for row, other in zip(rows, plain, strict=True))


def measure(ticks: int, folder: Path) -> list[dict[str, object]]:
    motion = a_cut(ticks)
    rows: list[dict[str, object]] = []
    for label, effects in VARIANTS.items():
        plain = in_c(folder, 0 if not effects else (2 if "helix" in effects else 1))
        constants = tool_constants(TOOL) | VALUES
        many = constants | {"tangential_coefficient_n_per_mm2": np.linspace(500.0, 1500.0, BATCH)}
        for teeth in (2, 4):
            runs: dict[str, Run] = {
                "single": lambda c=constants, n=teeth, e=effects: milling_force(c, n, motion, effects=e),
                "batch": lambda c=many, n=teeth, e=effects: milling_force(c, n, motion, effects=e),
            }
            if plain:
                runs["c"] = lambda p=plain, n=teeth: p(motion, n)
            ms = milliseconds(runs, 3 if effects else 7)
            row: dict[str, object] = {"law": label, "teeth": teeth, "single_ms": ms["single"], "batch_ms": ms["batch"] / BATCH}
            if plain:
                row |= {"c_ms": ms["c"], "single_over_c": ms["single"] / ms["c"], "batch_over_c": ms["batch"] / BATCH / ms["c"]}
                row["difference_n"] = difference_n(milling_force(constants, teeth, motion, effects=effects), plain(motion, teeth))
            rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=30_000)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = measure(options.ticks, Path(folder))
    power = np.full(options.ticks, 500.0)
    feeds = np.linspace(100.0, 500.0, 1000)
    others = milliseconds(
        {
            "spindle_load_ms": lambda: spindle_load_pct(DRIVE, power, 3600.0),
            "peak_us_per_cut": lambda: peak_force(tool_constants(TOOL), 4, 3600.0, feeds, 2.0, 0.3, 2.2),
        },
        7,
    )
    if options.json:
        print(json.dumps({"ticks": options.ticks, "milling": rows, **others}, indent=2))
        return
    print(f"{options.ticks} ticks of 1 ms, ms for one candidate; batch = one of {BATCH}\n")
    print("law                               teeth  plain C   single  over C    batch  over C  differ by")
    for row in rows:
        c, single, batch, off = (row.get(name, math.nan) for name in ("c_ms", "single_over_c", "batch_over_c", "difference_n"))
        ours = f"{row['single_ms']:9.2f}{single:8.2f}{row['batch_ms']:9.2f}{batch:8.2f}"
        print(f"{row['law']:34}{row['teeth']:5}{c:9.2f}{ours}  {off:.0e} N")
    print(f"\nspindle load {others['spindle_load_ms']:.2f} ms; peak force {others['peak_us_per_cut']:.1f} µs a cut")


if __name__ == "__main__":
    main()
