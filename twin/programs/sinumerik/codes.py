"""The G codes of the control by their groups ("NC programming", appendix "G commands"), and its M codes.

A code that is passed over is listed with a reason in `PASSED_OVER`; one that is not read stands in `refused.py`.
"""

from collections.abc import Mapping
from typing import Final

BY_GROUP: Final[Mapping[str, tuple[str, ...]]] = {
    "motion": ("G0", "G1", "G2", "G3", "CIP", "CT", "G33", "G331", "G332"),
    "once": ("G4", "G63", "G74", "G75"),
    "frame": ("TRANS", "ATRANS", "ROT", "AROT", "SCALE", "ASCALE", "MIRROR", "AMIRROR", "G25", "G26", "G110", "G111", "G112"),
    "plane": ("G17", "G18", "G19"),
    "cutter": ("G40", "G41", "G42"),
    "work": ("G500", *(f"G{code}" for code in range(54, 58)), *(f"G{code}" for code in range(505, 600))),
    "suppress": ("G53", "G153", "SUPA"),
    "path": ("G60", "G64", "G641", "G642", "G643", "G644", "G645"),
    "exact": ("G9",),
    "units": ("G70", "G71", "G700", "G710"),
    "distance": ("G90", "G91"),
    "feed": ("G93", "G94", "G95", "G96", "G961", "G97", "G971"),
    "contour_feed": ("CFC", "CFTCP", "CFIN"),
    "approach": ("NORM", "KONT"),
    "corner": ("G450", "G451"),
    "jerk": ("BRISK", "SOFT", "DRIVE"),
    "feed_forward": ("FFWON", "FFWOF"),
    "dialect": ("G290", "G291"),
}
GROUPS: Final[Mapping[str, str]] = {code: group for group, codes in BY_GROUP.items() for code in codes}

PASSED_OVER: Final = frozenset(
    {"G601", "G602", "G603"}  # when a block counts as reached at G60
    | {"COMPON", "COMPCURV", "COMPCAD", "COMPSURF", "COMPOF"}  # the compressor keeps to the tolerance that CTOL says
    | {"CUT2D", "CUT2DF", "CDON", "CDOF", "CDOF2"}  # radius compensation in the plane; its own look-ahead
    | {"DIAMOF", "FNORM", "UPATH", "SPATH", "WALIMON", "WALIMOF", "RTLION", "RTLIOF", "DYNNORM", "DYNPOS", "DYNROUGH"}
    | {
        "DYNSEMIFIN",
        "DYNFINISH",
        "DYNPREC",
        "FIFOCTRL",
        "STARTFIFO",
        "STOPFIFO",
        "STOPRE",
        "SBLON",
        "SBLOF",
        "DISPLON",
        "DISPLOF",
    }
    | {"GWPSOF", "TRAFOOF", "TCARRNONE", "SPCOF", "FTOCOF", "ROTOF", "TOROTOF", "PAROTOF", "CPRECOF", "CPRECON", "CFOF", "ORISOF"}
)
"""Words with nothing to do here: displays, buffers, limits, dynamic data sets of the machine, switches that go to off."""
PASSED_OVER_CALLS: Final = frozenset(
    {"MSG", "FGROUP", "SETMS", "WORKPIECE", "STOPRE", "WRITE", "SPCON", "GROUP_BEGIN", "GROUP_END", "GROUP_ADDEND"}
    | {"CLEARM", "WAITM", "WAITMC", "SETM", "RELEASE", "GET", "INIT", "START", "GWPSON", "TRAFOOF"}
)
"""Calls with nothing to do here. WORKPIECE draws the blank, the groups fold the editor."""

M_CODES: Final = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 17, 19, 30, 40, 41, 42, 43, 44, 45, 70})
CONTOUR_CODES: Final = frozenset({"G1", "G2", "G3", "CIP", "CT"})
ARC_CODES: Final = frozenset({"G2", "G3", "CIP", "CT"})
