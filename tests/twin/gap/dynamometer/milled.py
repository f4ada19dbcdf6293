"""Milling forces as a dynamometer shows them, from a law of force of its own: slices of a helical edge, each tooth against those
before it, a table that resonates, drift, noise of a colour, a vibration of its own, a spindle that does not keep its speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter

Floats = NDArray[np.float64]
SLICES = 8


@dataclass(frozen=True)
class Cutter:
    """The tool and its material; from `edge_n_per_mm` on, what may be wrong with it."""

    diameter_mm: float = 12.0
    teeth: int = 4
    tangential: float = 900.0
    radial_ratio: float = 0.4
    edge_n_per_mm: float = 0.0
    edge_radial_n_per_mm: float = 0.0
    thinning: float = 0.0
    runout_mm: float = 0.0
    runout_rad: float = 0.6
    helix_deg: float = 0.0
    chipped_mm: float = 0.0


@dataclass(frozen=True)
class Bench:
    """The bench: sample rate, noise, drift and resonance of the recording."""

    rate_hz: float = 8_000.0
    resonance_hz: float = 1400.0
    damping: float = 0.06
    drift_n_per_s: float = 3.0
    noise_n: float = 2.0
    vibration_n: float = 8.0
    flutter: float = 0.002
    speed_off: float = 0.004


def angle_of(t_s: Floats, rpm: float, bench: Bench, phase_rad: float) -> Floats:
    """The true angle: a speed that is off, and wanders."""
    rate = rpm * 2.0 * np.pi / 60.0 * (1.0 + bench.speed_off + bench.flutter * np.sin(2.0 * np.pi * 0.7 * t_s + phase_rad))
    return phase_rad + np.concatenate([[0.0], np.cumsum(rate[1:] * np.diff(t_s))])


def forces(cutter: Cutter, angle: Floats, feed_mm_min: Floats, rpm: float, depth: Floats, arc: tuple[float, float]) -> Floats:
    """Force on the tool, x along the feed, (2, n)."""
    advance = feed_mm_min / (cutter.teeth * rpm)
    radius = cutter.runout_mm * np.cos(cutter.runout_rad + 2.0 * np.pi * np.arange(cutter.teeth) / cutter.teeth)
    radius[0] -= cutter.chipped_mm
    found = np.zeros((2, len(angle)))
    for tooth in range(cutter.teeth):
        for number in range(SLICES):
            height = depth * (number + 0.5) / SLICES
            lag = 2.0 * height * np.tan(np.deg2rad(cutter.helix_deg)) / cutter.diameter_mm
            phi = np.mod(angle + 2.0 * np.pi * tooth / cutter.teeth - lag, 2.0 * np.pi)
            chip = cutter.teeth * advance * np.sin(phi)
            for earlier in range(1, cutter.teeth):
                step = radius[tooth] - radius[(tooth - earlier) % cutter.teeth]
                chip = np.minimum(chip, earlier * advance * np.sin(phi) + step)
            chip = np.where((phi >= arc[0]) & (phi <= arc[1]), np.maximum(chip, 0.0), 0.0)
            coefficient = cutter.tangential * (np.maximum(chip, 0.002) / 0.05) ** -cutter.thinning
            bears = 1.0 - np.exp(-chip / 0.0015)
            tangential = coefficient * chip + cutter.edge_n_per_mm * bears
            radial = cutter.radial_ratio * coefficient * chip + cutter.edge_radial_n_per_mm * bears
            width = depth / SLICES
            found[0] += width * (-tangential * np.cos(phi) - radial * np.sin(phi))
            found[1] += width * (tangential * np.sin(phi) - radial * np.cos(phi))
    return found


def shown(force: Floats, t_s: Floats, depth: Floats, bench: Bench, chance: np.random.Generator) -> Floats:
    """Return the forces as the bench records them, (2, n)."""
    if bench.resonance_hz > 0.0:
        natural = 2.0 * np.pi * bench.resonance_hz
        over, under = bilinear([natural**2], [1.0, 2.0 * bench.damping * natural, natural**2], fs=bench.rate_hz)
        force = lfilter(over, under, force, axis=1)
    vibration = bench.vibration_n * np.sin(2.0 * np.pi * 631.7 * t_s + np.cumsum(chance.normal(0.0, 0.02, len(t_s))))
    coloured = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], chance.normal(0.0, bench.noise_n, force.shape), axis=1)
    drift = np.array([[1.0], [-0.6]]) * (5.0 + bench.drift_n_per_s * t_s)
    return np.asarray(force + drift + coloured + np.where(depth > 0.0, vibration, 0.0))


def recorded(
    cutter: Cutter,
    feeds_mm_min: tuple[float, ...],
    *,
    rpm: float = 3000.0,
    depth_mm: float = 2.0,
    arc: tuple[float, float] = (0.0, float(np.pi)),
    seconds: float = 2.0,
    air_s: float = 0.4,
    bench: Bench | None = None,
    seed: int = 1,
    with_angle: bool = False,
) -> dict[str, Floats]:
    """The columns of a run: in the air, then each feed, and air again."""
    bench = bench or Bench()
    chance = np.random.default_rng(seed)
    legs = [(0.0, air_s, feeds_mm_min[0])]
    for feed in feeds_mm_min:
        legs += [(depth_mm, seconds, feed), (0.0, air_s, feed)]
    counts = [round(leg[1] * bench.rate_hz) for leg in legs]
    depth = np.concatenate([np.full(n, leg[0]) for n, leg in zip(counts, legs, strict=True)])
    feed = np.concatenate([np.full(n, leg[2]) for n, leg in zip(counts, legs, strict=True)])
    t_s = np.arange(len(depth)) / bench.rate_hz
    angle = angle_of(t_s, rpm, bench, float(chance.uniform(0.0, 2.0 * np.pi)))
    force = shown(forces(cutter, angle, feed, rpm * (1.0 + bench.speed_off), depth, arc), t_s, depth, bench, chance)
    columns = {
        "t_s": t_s,
        "spindle_rpm": np.full(len(t_s), rpm),
        "feed_mm_min": feed,
        "axial_depth_mm": depth,
        "entry_angle_rad": np.full(len(t_s), arc[0]),
        "exit_angle_rad": np.full(len(t_s), arc[1]),
        "force_x_n": force[0],
        "force_y_n": force[1],
    }
    return columns | ({"spindle_angle_rad": angle} if with_angle else {})
