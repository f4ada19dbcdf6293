"""The cycles by their names, with the names of their parameters in order, and those that are named only."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import compensation
from twin.programs.sinumerik.cycles import deep_hole, drilling, face, patterns, pocket, slot, spigot, tapping
from twin.programs.sinumerik.cycles.arguments import NEWER, Arguments
from twin.programs.sinumerik.language.functions import Value
from twin.programs.sinumerik.language.syntax import Invocation, Name
from twin.programs.sinumerik.state import State

DEPTH: Final = ("RTP", "RFP", "SDIS", "DP", "DPR")
MODES: Final = ("_GMODE", "_DMODE", "_AMODE")
PATTERN: Final = ("_VARI", "_UMODE", "_HIDE", "_NSP", "_DMODE")
PLAIN: Final = ("RTP", "RFP", "SDIS", "DP")
AROUND: Final = ("_MID", "_FAL", "_FALD", "_FFP1", "_FFD", "_CDIR", "_VARI")


@dataclass(frozen=True, slots=True)
class Cycle:
    """parameters: in the order of a call; run: at the place of the tool; pattern: at places, given what MCALL does there."""

    parameters: tuple[str, ...]
    run: Callable[[State, Arguments], None] | None = None
    pattern: Callable[[State, Arguments, Callable[[], None]], None] | None = None


SWIVEL: Final = (
    "_FR",
    "_TC",
    "_ST",
    "_MODE",
    "_X0",
    "_Y0",
    "_Z0",
    "_A",
    "_B",
    "_C",
    "_X1",
    "_Y1",
    "_Z1",
    "_DIR",
    "_FR_I",
    "_DMODE",
)
SWIVELS: Final = "swivels the plane; the twin has no kinematics for it: three axes only"


def swivel(state: State, given: Arguments) -> None:
    """CYCLE800() swivels back, and one without retraction, shift and angle swivels nowhere: neither does anything here."""
    given.only_zero("_FR", "_X0", "_Y0", "_Z0", "_A", "_B", "_C", "_X1", "_Y1", "_Z1", reason=SWIVELS)


CYCLES: Final[Mapping[str, Cycle]] = {
    "CYCLE81": Cycle((*DEPTH, "DTB", *MODES), drilling.drill),
    "CYCLE82": Cycle((*DEPTH, "DTB", *MODES), drilling.drill),
    "CYCLE83": Cycle(
        (*DEPTH, "FDEP", "FDPR", "DAM", "DTB", "DTS", "FRF", "VARI", "_AXN", "_MDEP", "_VRT", "_DTD", "_DIS1", *MODES),
        deep_hole.deep_hole,
    ),
    "CYCLE84": Cycle(
        (
            *(*DEPTH, "DTB", "SDAC", "MPIT", "PIT", "POSS", "SST", "SST1", "_AXN", "_PITA", "_TECHNO", "_VARI", "_DAM", "_VRT"),
            *("_PITM", "_PTAB", "_PTABA", *MODES),
        ),
        tapping.rigid,
    ),
    "CYCLE840": Cycle(
        (*DEPTH, "DTB", "SDR", "SDAC", "ENC", "MPIT", "PIT", "_AXN", "_PITA", "_TECHNO", "_PITM", "_PTAB", "_PTABA", *MODES),
        tapping.with_chuck,
    ),
    "CYCLE85": Cycle((*DEPTH, "DTB", "FFR", "RFF", *MODES), drilling.ream),
    "CYCLE86": Cycle((*DEPTH, "DTB", "SDIR", "RPA", "RPO", "RPAP", "POSS", *MODES), drilling.bore),
    "CYCLE87": Cycle((*DEPTH, "SDIR"), drilling.bore_and_stop),
    "CYCLE88": Cycle((*DEPTH, "DTB", "SDIR"), drilling.bore_and_stop),
    "CYCLE89": Cycle((*DEPTH, "DTB", *MODES), drilling.bore_back),
    "HOLES1": Cycle(("SPCA", "SPCO", "STA1", "FDIS", "DBH", "NUM", *PATTERN), pattern=patterns.row),
    "HOLES2": Cycle(("CPA", "CPO", "RAD", "STA1", "INDA", "NUM", *PATTERN), pattern=patterns.circle),
    "CYCLE801": Cycle(("_SPCA", "_SPCO", "_STA", "_DIS1", "_DIS2", "_NUM1", "_NUM2", *PATTERN), pattern=patterns.grid),
    "CYCLE802": Cycle(
        ("_XA", "_YA", *(f"_{axis}{place}" for place in range(9) for axis in "XY"), *PATTERN), pattern=patterns.anywhere
    ),
    "POCKET3": Cycle(
        (
            *PLAIN,
            *(
                "_LENG",
                "_WID",
                "_CRAD",
                "_PA",
                "_PO",
                "_STA",
                "_MID",
                "_FAL",
                "_FALD",
                "_FFP1",
                "_FFD",
                "_CDIR",
                "_VARI",
                "_MIDA",
            ),
            *("_AP1", "_AP2", "_AD", "_RAD1", "_DP1"),
            *NEWER,
        ),
        pocket.rectangle,
    ),
    "POCKET4": Cycle(
        (
            *PLAIN,
            *("_PRAD", "_PA", "_PO", "_MID", "_FAL", "_FALD", "_FFP1", "_FFD", "_CDIR", "_VARI", "_MIDA"),
            *("_AP1", "_AD", "_RAD1", "_DP1"),
            *NEWER,
        ),
        pocket.circle,
    ),
    "LONGHOLE": Cycle(
        (*DEPTH, "NUM", "LENG", "CPA", "CPO", "RAD", "STA1", "INDA", "FFD", "FFP1", "MID", *NEWER), slot.long_holes
    ),
    "SLOT1": Cycle(
        (
            *(*DEPTH, "NUM", "LENG", "WID", "CPA", "CPO", "RAD", "STA1", "INDA", "FFD", "FFP1", "MID", "CDIR", "FAL", "VARI"),
            *("MIDF", "FFP2", "SSF"),
        ),
        slot.along_radius,
    ),
    "SLOT2": Cycle(
        (
            *(*DEPTH, "NUM", "AFSL", "WID", "CPA", "CPO", "RAD", "STA1", "INDA", "FFD", "FFP1", "MID", "CDIR", "FAL", "VARI"),
            *("MIDF", "FFP2", "SSF", "_FFCP"),
        ),
        slot.along_circle,
    ),
    "CYCLE71": Cycle(
        (
            *PLAIN,
            *("_PA", "_PO", "_LENG", "_WID", "_STA", "_MID", "_MIDA", "_FDP", "_FALD", "_FFP1", "_VARI", "_FDP1"),
        ),
        face.face,
    ),
    "CYCLE76": Cycle(
        (*DEPTH, "_LENG", "_WID", "_CRAD", "_PA", "_PO", "_STA", *AROUND, "_AP1", "_AP2", *NEWER[1:]), spigot.rectangle
    ),
    "CYCLE77": Cycle((*DEPTH, "_PRAD", "_PA", "_PO", *AROUND, "_AP1", *NEWER[1:]), spigot.circle),
    "CYCLE832": Cycle(()),
    "CYCLE800": Cycle(SWIVEL, swivel),
}

CONTOUR_POCKET: Final = (
    "contour milling of the cycle's own is not read; have the CAM system put out the path, or write it with G41 or G42"
)
REFUSED_CYCLES: Final[Mapping[str, str]] = {
    **dict.fromkeys(("CYCLE996", "CYCLE9960"), SWIVELS),
    **dict.fromkeys(("CYCLE60", "CYCLE62", "CYCLE63", "CYCLE64", "CYCLE72", "CYCLE73", "CYCLE74", "CYCLE75"), CONTOUR_POCKET),
    "CYCLE79": "polygons are not read; write the contour with G41 or G42",
    **dict.fromkeys(("CYCLE70", "CYCLE90"), "thread milling is not read; write the helix with TURN="),
    **dict.fromkeys(("POCKET1", "POCKET2"), "is not read; write POCKET3 or POCKET4"),
    "CYCLE61": "its modes say what corner and depth mean, and are not read; write CYCLE71, or post the face without a cycle",
    "CYCLE78": "drilling and thread milling in one is not read",
    "CYCLE899": "open slots are not read",
    **dict.fromkeys((f"CYCLE9{one}" for one in (2, 3, 4, 5, 6, 7, 8, 9)), "is a cycle of a lathe"),
    **dict.fromkeys((f"CYCLE97{one}" for one in range(1, 10)), "measures, and ends at a signal that the twin does not know"),
}


def run_cycle(state: State, called: Name | Invocation, given: list[Value | None], hole: Callable[[], None] | None) -> None:
    """Run a cycle where the tool is. hole: what MCALL does at the places of a pattern."""
    cycle = CYCLES[called.name]
    compensation.refuse_inside(state, called.text)
    if state.corner is not None or state.pending_angle is not None:
        raise RefusedError(called.text, "cannot stand between the two blocks of a corner or an angle")
    names = cycle.parameters
    arguments = Arguments(called.name, names, given, state.unit_mm)
    if arguments.has("_DMODE"):
        arguments.in_plane(state.plane)
    if arguments.has("_AXN") and arguments.number("_AXN") not in (0.0, 1.0 + state.normal):
        raise RefusedError(
            f"{called.name} _AXN", f"the twin drills along the normal of G{state.plane} only, axis {1 + state.normal}"
        )
    if cycle.pattern is not None:
        cycle.pattern(state, arguments, hole or (lambda: None))
    elif cycle.run is not None:
        cycle.run(state, arguments)
    state.block_feed = None
