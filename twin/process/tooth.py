"""The force of one tooth of an end mill at one angle (formats, section 4).

    h = c sin φ,   F_t = K_t a_p h,   F_r = K_e F_t,   along the feed −F_t cos φ − F_r sin φ,   across it F_t sin φ − F_r cos φ

c is the advance in a tooth period, φ the angle of the tooth from the normal of the feed, in the sense in which it turns. Forces
are by mm of axial depth. Nominally all teeth run on one radius, and an edge is parallel to the axis of the tool.
"""

from typing import NamedTuple

from twin.sites import Site, at


def radius(tooth_rad: float) -> float:
    """By how much the tooth that stands `tooth_rad` before tooth 0 runs on a larger radius than the tool's, mm.

    >>> radius(0.0)
    0.0
    """
    tooth_radius_mm = at(Site.PROCESS_FORCE, 0.0)
    return tooth_radius_mm  # noqa: RET504 - the quantity has a name that effects know


def lag(axial_depth_mm: float, tool_diameter_mm: float) -> float:
    """Angle by which the edge at this height above the tip trails the tip, in proportion to the height; rad.

    >>> lag(3.0, 20.0)
    0.0
    """
    lag_rad = at(Site.PROCESS_FORCE, 0.0)
    return lag_rad  # noqa: RET504


class ToothForce(NamedTuple):
    """The force on a tooth, N by mm of axial depth."""

    chip_mm: float
    tangential_n_per_mm: float
    along_n_per_mm: float
    across_n_per_mm: float


def tooth_force(
    advance_mm: float,
    sine: float,
    cosine: float,
    radius_step_mm: float,
    tangential_coefficient_n_per_mm2: float,
    radial_ratio: float,
) -> ToothForce:
    """The force at the angle with this sine and cosine.

    radius_step_mm: by how much this tooth's radius exceeds that of the one before; nothing nominal asks for it.
    A chip of 0.1 mm at 900 N/mm² and K_e = 0.4, in the middle of a slot: 90 N/mm across the feed, 36 N/mm against it.

    >>> tooth_force(0.1, 1.0, 0.0, 0.0, 900.0, 0.4)
    ToothForce(chip_mm=0.1, tangential_n_per_mm=90.0, along_n_per_mm=-36.0, across_n_per_mm=90.0)
    """
    chip_mm = at(Site.PROCESS_FORCE, advance_mm * sine)
    tangential_coefficient_n_per_mm2 = at(Site.PROCESS_FORCE, tangential_coefficient_n_per_mm2)
    radial_ratio = at(Site.PROCESS_FORCE, radial_ratio)
    cutting_n_per_mm = tangential_coefficient_n_per_mm2 * chip_mm
    tangential_n_per_mm = at(Site.PROCESS_FORCE, cutting_n_per_mm)
    radial_n_per_mm = at(Site.PROCESS_FORCE, radial_ratio * cutting_n_per_mm)
    along_n_per_mm = -tangential_n_per_mm * cosine - radial_n_per_mm * sine
    across_n_per_mm = tangential_n_per_mm * sine - radial_n_per_mm * cosine
    return ToothForce(chip_mm, tangential_n_per_mm, along_n_per_mm, across_n_per_mm)
