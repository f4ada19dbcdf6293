"""Speed along a distance under limits of acceleration a and jerk j: the seven-phase S-curve, closed where it can be.

A ramp from v₀ to v₁ that starts and ends with acceleration 0 takes, with d = |v₁ − v₀| (Biagiotti, Melchiorri, *Trajectory
Planning for Automatic Machines and Robots*, 2008, section 3.4),

    T = d / a + a / j   where d ≥ a² / j (the acceleration is reached),      T = 2 √(d / j)   where it is not,

and by symmetry covers (v₀ + v₁) T / 2. A profile is a ramp to the peak speed, a cruise, and a ramp to the exit speed. j = ∞ is
the trapezoid: the same formulas with a / j = 0. Speeds mm/s, distances mm, times s; all speeds ≥ 0.
"""

import math

from twin.kernels.compiling import kernel

ITERATIONS_MAX = 100
"""Most safeguarded Newton steps; four to eight are used, and each that fails to help halves the bracket."""


@kernel
def ramp_time(v0: float, v1: float, a: float, j: float) -> float:
    """Seconds of the fastest change of speed from `v0` to `v1`.

    0 → 10 mm/s with a = 100 mm/s² and j = 1000 mm/s³: d = a²/j, so 10/100 + 100/1000 = 0.2 s.
    """
    d = abs(v1 - v0)
    if d * j >= a * a:
        return d / a + a / j
    return 2.0 * math.sqrt(d / j)


@kernel
def ramp_distance(v0: float, v1: float, a: float, j: float) -> float:
    """Distance of that change: mean speed times its time."""
    return 0.5 * (v0 + v1) * ramp_time(v0, v1, a, j)


@kernel
def reachable_speed(v0: float, distance: float, a: float, j: float) -> float:
    """The highest speed that a ramp from `v0` reaches within `distance`, ending with acceleration 0.

    Acceleration reached: v₁² + (a²/j) v₁ = v₀² − (a²/j) v₀ + 2 a L. Not reached: with x = √(v₁ − v₀), x³ + 2 v₀ x = L √j, whose
    one real root is 2 √(p/3) sinh(asinh(1.5 q/p √(3/p)) / 3) with p = 2 v₀ and q = L √j.
    """
    if math.isinf(j):
        return math.sqrt(v0 * v0 + 2.0 * a * distance)
    c = a * a / j
    if ramp_distance(v0, v0 + c, a, j) <= distance:
        return max(v0, -0.5 * c + math.sqrt(0.25 * c * c + v0 * v0 - c * v0 + 2.0 * a * distance))
    q = distance * math.sqrt(j)
    x = float(q ** (1.0 / 3.0))
    if 2.0 * v0 > 1e-9 * x * x:
        p = 2.0 * v0
        x = 2.0 * math.sqrt(p / 3.0) * math.sinh(math.asinh(1.5 * q / p * math.sqrt(3.0 / p)) / 3.0)
    x -= (x * (x * x + 2.0 * v0) - q) / (3.0 * x * x + 2.0 * v0) if x > 0.0 else 0.0
    return v0 + x * x


@kernel
def _ramp_slope(v: float, peak: float, a: float, j: float) -> float:
    """d(ramp_distance(v, peak)) / d(peak), for peak ≥ v."""
    d = peak - v
    if d * j >= a * a:
        return peak / a + 0.5 * a / j
    if d <= 0.0:
        return math.inf
    root = math.sqrt(d / j)
    return root + 0.5 * (v + peak) / (j * root)


@kernel
def peak_speed(v0: float, v1: float, cap: float, distance: float, a: float, j: float) -> float:
    """Peak speed of the fastest profile v0 → v1 over `distance` at no more than `cap`.

    The way of both ramps grows with the peak; where the cap does not bind its inverse is closed for equal ends and for the
    trapezoid, and else the root of a monotone function, found by Newton's method inside a bracket to the last bit or two.
    """
    low = max(v0, v1)
    if cap <= low:
        return low
    if ramp_distance(v0, cap, a, j) + ramp_distance(cap, v1, a, j) <= distance:
        return cap
    if math.isinf(j):
        return min(cap, max(low, math.sqrt(a * distance + 0.5 * (v0 * v0 + v1 * v1))))
    if v0 == v1:
        return min(cap, reachable_speed(v0, 0.5 * distance, a, j))
    high = cap
    peak = 0.5 * (low + high)
    for _ in range(ITERATIONS_MAX):
        excess = ramp_distance(v0, peak, a, j) + ramp_distance(peak, v1, a, j) - distance
        if excess > 0.0:
            high = peak
        else:
            low = peak
        better = peak - excess / (_ramp_slope(v0, peak, a, j) + _ramp_slope(v1, peak, a, j))
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - peak) <= 4e-16 * peak:
            break
        peak = better
    return peak


@kernel
def profile_time(v0: float, peak: float, v1: float, distance: float, a: float, j: float) -> float:
    """Seconds of ramp, cruise and ramp over `distance`."""
    cruise = distance - ramp_distance(v0, peak, a, j) - ramp_distance(peak, v1, a, j)
    time = ramp_time(v0, peak, a, j) + ramp_time(peak, v1, a, j)
    return time + cruise / peak if peak > 0.0 and cruise > 0.0 else time


@kernel
def _along_ramp(t: float, v0: float, v1: float, a: float, j: float) -> tuple[float, float, float]:
    """Distance, speed and acceleration after `t` seconds of a ramp v0 → v1."""
    d = abs(v1 - v0)
    sign = 1.0 if v1 >= v0 else -1.0
    total = ramp_time(v0, v1, a, j)
    if t >= total:
        return 0.5 * (v0 + v1) * total, v1, 0.0
    rise = a / j if d * j >= a * a else math.sqrt(d / j)
    if t < rise:
        return t * (v0 + sign * j * t * t / 6.0), v0 + sign * 0.5 * j * t * t, sign * j * t
    rest = total - t
    if rest < rise:
        s = 0.5 * (v0 + v1) * total - rest * (v1 - sign * j * rest * rest / 6.0)
        return s, v1 - sign * 0.5 * j * rest * rest, sign * j * rest
    top = a if math.isinf(j) else j * rise
    u = t - rise
    vr = v0 + sign * 0.5 * top * rise
    sr = rise * (v0 + sign * top * rise / 6.0)
    return sr + u * (vr + sign * 0.5 * top * u), vr + sign * top * u, sign * top


@kernel
def along_profile(t: float, v0: float, peak: float, v1: float, distance: float, a: float, j: float) -> tuple[float, float, float]:
    """Distance, speed and acceleration after `t` seconds of the profile v0 → peak → v1 over `distance`."""
    up, down = ramp_time(v0, peak, a, j), ramp_time(peak, v1, a, j)
    total = profile_time(v0, peak, v1, distance, a, j)
    if t >= total:
        return distance, v1, 0.0
    if t < up:
        return _along_ramp(t, v0, peak, a, j)
    if t <= total - down:
        return ramp_distance(v0, peak, a, j) + peak * (t - up), peak, 0.0
    s, v, acceleration = _along_ramp(t - (total - down), peak, v1, a, j)
    return distance - ramp_distance(peak, v1, a, j) + s, v, acceleration


@kernel
def time_at_distance(s: float, v0: float, peak: float, v1: float, distance: float, a: float, j: float) -> float:
    """Seconds after which the profile has covered `s`: the inverse of `along_profile`, by Newton's method inside a bracket."""
    low, high = 0.0, profile_time(v0, peak, v1, distance, a, j)
    if s <= 0.0:
        return low
    if s >= distance:
        return high
    t = high * s / distance
    for _ in range(ITERATIONS_MAX):
        done, v, _unused = along_profile(t, v0, peak, v1, distance, a, j)
        if done > s:
            high = t
        else:
            low = t
        better = t + (s - done) / v if v > 0.0 else low
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - t) <= 1e-15 * (1.0 + t):
            break
        t = better
    return t
