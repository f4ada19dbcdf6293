"""The text of the quadrature over the angles that an edge passes: Gauss-Legendre, 4 nodes, exact to the 7th degree.

It goes over what is in the cut of a stretch of angles, in pieces of at most 0.9 rad, so that a jump at entry or exit falls
between two pieces. Angles are counted from entry; the cut is [0, width], and again after each turn.
"""

ARC_MAX_RAD = 0.9
NODES = (0.8611363115940526, 0.3399810435848563)
WEIGHTS = (0.34785484513745385, 0.6521451548625461)


def indented(lines: list[str], levels: int) -> list[str]:
    """Lines of text, further in.

    >>> indented(["a = 1"], 1)
    ['    a = 1']
    """
    return ["    " * levels + line for line in lines]


NOTHING_KEPT = ["half_before_rad = -1.0", "sh = s1 = s2 = ch = c1 = c2 = 0.0"]
"""Sines of the steps between nodes are kept while the pieces are of one length."""

PIECES = [
    f"pieces = int(arc_rad * {1.0 / ARC_MAX_RAD}) + 1",
    "half_rad = 0.5 * arc_rad if pieces == 1 else 0.5 * arc_rad / pieces",
    "if half_rad != half_before_rad:",
    "    half_before_rad = half_rad",
    "    sh = small_sine(half_rad)",
    "    ch = small_cosine(half_rad)",
    *[f"    s{k} = small_sine(half_rad * {x})" for k, x in enumerate(NODES, 1)],
    *[f"    c{k} = small_cosine(half_rad * {x})" for k, x in enumerate(NODES, 1)],
]

WINDOWS = [
    "end_rad = begin_rad + turn_rad",
    "for turn in range(int(end_rad * 0.15915494309189535) + 1):",
    "    window_rad = 6.283185307179586 * turn",
    "    low_rad = begin_rad if begin_rad > window_rad else window_rad",
    "    high_rad = end_rad if end_rad < window_rad + width_rad else window_rad + width_rad",
    "    if high_rad > low_rad:",
    "        whole = low_rad == begin_rad and high_rad == end_rad",
    "        arc_rad = turn_rad if whole else high_rad - low_rad",
    *indented(PIECES, 2),
    "        for piece in range(pieces):",
    "            if whole and pieces == 1:",
    "                sine_mid = sine_now * ch + cosine_now * sh",
    "                cosine_mid = cosine_now * ch - sine_now * sh",
    "            else:",
    "                middle_rad = entry_rad + low_rad + half_rad * (2 * piece + 1)",
    "                sine_mid = sin(middle_rad)",
    "                cosine_mid = cos(middle_rad)",
]
"""The angle that a parallel edge turns through until the next tick, as far as it is in the cut."""

STRETCHES = [
    "shorter_rad = turn_rad if turn_rad < lag_rad else lag_rad",
    "end_rad = begin_rad + turn_rad",
    "for stretch in range(4):",
    "    row = 0 if stretch == 0 else 3",
    "    start_rad, stop_rad, weight, slope = begin_rad - lag_rad, begin_rad, 1.0 / lag_rad, 0.0",
    "    if stretch == 1:",
    "        stop_rad, weight, slope = start_rad + shorter_rad, 0.0, 1.0 / lag_rad",
    "    elif stretch == 2:",
    "        start_rad, stop_rad, weight = start_rad + shorter_rad, end_rad - shorter_rad, shorter_rad / lag_rad",
    "    elif stretch == 3:",
    "        start_rad, stop_rad, weight, slope = end_rad - shorter_rad, end_rad, shorter_rad / lag_rad, -1.0 / lag_rad",
]
"""The part of the edge in the cut at the tick, and rise, top and fall of the trapezium that passes until the next one."""

PASSED = [
    "for turn in range(int(floor(start_rad * 0.15915494309189535)), int(floor(stop_rad * 0.15915494309189535)) + 1):",
    "    window_rad = 6.283185307179586 * turn",
    "    low_rad = start_rad if start_rad > window_rad else window_rad",
    "    high_rad = stop_rad if stop_rad < window_rad + width_rad else window_rad + width_rad",
    "    if high_rad > low_rad:",
    "        arc_rad = high_rad - low_rad",
    *indented(PIECES, 2),
    "        for piece in range(pieces):",
    "            off_rad = low_rad - start_rad + half_rad * (2 * piece + 1)",
    "            sine_mid = sin(entry_rad + start_rad + off_rad)",
    "            cosine_mid = cos(entry_rad + start_rad + off_rad)",
]
"""A stretch of angles, as far as it is in the cut, under a weight that is linear in the angle."""
