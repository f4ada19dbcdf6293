"""The tools of a cell: end mills and face mills as the tool list states them, one list for all machines."""

from typing import NamedTuple

import numpy as np


class EndMill(NamedTuple):
    """A tool as it is stated, with the constants of the material that it cuts."""

    diameter_mm: float
    teeth: int
    tangential_n_per_mm2: float
    radial_ratio: float


SHAPES = {
    # number: diameter, teeth
    **{1: (50.0, 5), 2: (40.0, 4)},
    **{3: (25.0, 3), 4: (20.0, 4), 5: (16.0, 3), 6: (12.0, 3)},
    **{7: (16.0, 4), 8: (12.0, 4), 9: (10.0, 4), 10: (8.0, 3)},
}
FACE_MILLS, ROUGHERS, FINISHERS = (1, 2), (3, 4, 5, 6), (7, 8, 9, 10)


def draw_tools(rng: np.random.Generator) -> dict[int, EndMill]:
    """Return the tool list: by number."""
    return {
        number: EndMill(diameter, teeth, round(float(np.exp(rng.uniform(*np.log((650.0, 1900.0)))))), 0.4)
        for number, (diameter, teeth) in SHAPES.items()
    }
