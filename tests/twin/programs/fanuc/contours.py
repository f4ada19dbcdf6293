"""Random contours for the cutter compensation."""

import math
import random


def contour(chance: random.Random) -> str:
    """A compensated path of lines and arcs."""
    side, number = chance.choice((41, 42)), chance.choice((1, 2))
    lines = ["G21 G90 G17 G40 F300", "T1 M6", "G0 X-40 Y0", f"G{side} D{number} G1 X0 Y0"]
    x = y = 0.0
    heading = chance.uniform(-1.0, 1.0)
    for _ in range(chance.randint(2, 6)):
        length = chance.uniform(30.0, 80.0)
        end_x, end_y = round(x + length * math.cos(heading), 3), round(y + length * math.sin(heading), 3)
        x, y = end_x, end_y
        heading += chance.choice((-1, 1)) * chance.uniform(0.9, 1.4)
        if chance.random() < 0.4:
            code, radius = chance.choice((2, 3)), round(length * chance.uniform(0.9, 2.0), 3)
            lines.append(f"G{code} X{end_x} Y{end_y} R{radius}")
        else:
            lines.append(f"G1 X{end_x} Y{end_y}")
    return "\n".join([*lines, "G40 G1 X-60 Y-60", "M2"])
