"""The one arc that stands for a rim cut to several depths.

A tooth at φ cuts a chip h = c sin φ of the depth a(φ). Over a turn that gives, with F_t = K_t a h and F_r = K_e F_t,
    mean power               ∝ ∫ a sin φ dφ           = m₀
    mean force along, across ∝ ∫ a sin φ cos φ dφ = m_c and ∫ a sin² φ dφ = m_s, mixed by K_e.
The rectangle (depth, entry, exit) with the same m₀, m_c and m_s therefore has the same mean power, torque and mean force vector
whatever K_t, K_e, teeth, feed and speed are. With middle μ and half width w: m₀ = 2 a sin μ sin w, m_c / m₀ = cos μ cos w,
m_s / m₀ = (w − cos 2μ sin w cos w) / (2 sin μ sin w), so w is the root of one monotone function.

Where the arcs lie too far apart for any rectangle (a thin wall on either side), entry goes to 0 or exit to π; m₀ and m_c are kept
then, m_s is the nearest that can be had. What is lost is the course within a turn, hence the peak of a tooth, which the rectangle
understates: the more, the farther apart the arcs. Over random rims (`benchmarks/engagement.py`), beside the plain choice of the
outermost angles with the depth of the same power:

    rim         arc in its place   mean force off by (median, 95 %)   peak of a tooth off by (median, 5 %)
    one step    rectangle            0.1 %     2 %                       −4 %   −48 %
                outermost angles     3.2 %    21 %                       −9 %   −50 %
    two arcs    rectangle            0.1 %    29 %                      −22 %   −76 %
                outermost angles    14 %      68 %                      −31 %   −82 %

`Engagement.exact` and `Engagement.deepest_mm` say where that is so and how deep the rim cuts at most.
"""

import math

from twin.kernels.compiling import kernel

BISECTIONS = 40


@kernel
def rectangle(power: float, across: float, along: float) -> tuple[float, float, float]:
    """Depth, entry and exit angle with the moments m₀ = power > 0, m_s = across and m_c = along.

    A depth of 2 from 0 to π/2 has m₀ = 2, m_s = π/2, m_c = 1:

    >>> depth, entry, exit_ = rectangle(2.0, math.pi / 2, 1.0)
    >>> round(depth, 9), abs(round(entry, 9)), round(exit_ / math.pi, 9)
    (2.0, 0.0, 0.5)
    """
    cosine = min(1.0, max(-1.0, along / power))
    sought = across / power
    narrow, wide = 0.0, math.acos(math.sqrt(abs(cosine)))
    if _sine(cosine, wide) < sought:
        for _ in range(BISECTIONS):
            half = (narrow + wide) / 2.0
            if _sine(cosine, half) > sought:
                narrow = half
            else:
                wide = half
    half = max(wide, 1e-9)
    middle = math.acos(min(1.0, max(-1.0, cosine / math.cos(half))))
    depth = power / (2.0 * max(math.sin(middle), 1e-9) * math.sin(half))
    return depth, max(0.0, middle - half), min(math.pi, middle + half)


@kernel
def _sine(cosine: float, half: float) -> float:
    """m_s / m₀ of the rectangle with the given m_c / m₀ and half width."""
    if half < 1e-9:
        return math.sqrt(1.0 - cosine * cosine)
    middle = math.acos(min(1.0, max(-1.0, cosine / max(math.cos(half), 1e-300))))
    sine = max(math.sin(middle), 1e-300)
    return (half - math.cos(2.0 * middle) * math.sin(half) * math.cos(half)) / (2.0 * sine * math.sin(half))
