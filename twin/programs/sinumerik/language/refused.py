"""Words of the control that are not read, each with the reason and the way out. They are named, never passed over."""

from collections.abc import Mapping
from typing import Final

KINEMATICS: Final = "turns the tool or the table; the twin has no kinematics for it: three axes only"
SPLINE: Final = "splines are not read; have the CAM system put out lines and arcs"
SYNCHRONISED: Final[Mapping[str, str]] = dict.fromkeys(
    ("WHEN", "WHENEVER", "FROM", "EVERY", "DO", "ID", "IDS", "CANCEL"), "synchronised actions are not read"
)
FRAME_VARIABLES: Final = frozenset(
    {"$P_UIFR", "$P_PFRAME", "$P_IFRAME", "$P_BFRAME", "$P_CHBFR", "$P_UBFR", "$P_NCBFR", "$P_ACTFRAME", "$P_CYCFRAME"}
    | {"$P_WPFRAME", "$P_TOOLFRAME", "$P_PARTFRAME", "$P_SETFRAME", "$P_TRAFRAME", "$P_ISO1FRAME"}
)

REFUSED_WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        ("ASPLINE", "BSPLINE", "CSPLINE", "SPLINEPATH", "PO", "PL", "PW", "SD", "EAUTO", "ENAT", "ETAN", "BNAT"), SPLINE
    ),
    **dict.fromkeys(("BAUTO", "BTAN", "POLY", "POLYPATH"), SPLINE),
    **dict.fromkeys(("INVCW", "INVCCW"), "involutes are not read; write lines and arcs"),
    **dict.fromkeys(("G34", "G35", "G335", "G336"), "threads of changing lead and turned threads are not read"),
    **dict.fromkeys(
        (
            "TRAORI",
            "TRANSMIT",
            "TRACYL",
            "TRAANG",
            "TRACON",
            "TCARR",
            "TCOABS",
            "TCOFR",
            "TCOFRX",
            "TCOFRY",
            "TCOFRZ",
        ),
        KINEMATICS,
    ),
    **dict.fromkeys(("TOFRAME", "TOFRAMEX", "TOFRAMEY", "TOFRAMEZ", "TOROT", "TOROTX", "TOROTY", "TOROTZ", "PAROT"), KINEMATICS),
    **dict.fromkeys(
        ("ORIMKS", "ORIAXES", "ORIVECT", "ORIEULER", "ORIRPY", "ORIRPY2", "ORIVIRT1", "ORIVIRT2", "ORIPLANE"), KINEMATICS
    ),
    **dict.fromkeys(
        ("ORIWKS", "ORICONCW", "ORICONCCW", "ORICONIO", "ORICONTO", "ORICURVE", "ORIPATH", "ORIPATHS", "ORIC"), KINEMATICS
    ),
    **dict.fromkeys(
        ("A2", "B2", "C2", "A3", "B3", "C3", "A4", "B4", "C4", "A5", "B5", "C5", "LEAD", "TILT", "THETA"), KINEMATICS
    ),
    **dict.fromkeys(("CUT3DC", "CUT3DCC", "CUT3DCCD", "CUT3DF", "CUT3DFF", "CUT3DFS"), KINEMATICS),
    **dict.fromkeys(("ROTS", "AROTS", "CROTS"), "spatial angles are not read; write ROT X Y Z"),
    **dict.fromkeys(("G58", "G59"), "is not read; write TRANS or ATRANS"),
    **dict.fromkeys(
        ("G147", "G148", "G247", "G248", "G347", "G348"), "soft approach and retraction are not read; write the moves"
    ),
    **dict.fromkeys(
        ("G140", "G141", "G142", "G143", "G340", "G341", "DISR", "DISCL", "FAD"), "soft approach is not read; write the moves"
    ),
    **dict.fromkeys(("KONTC", "KONTT"), "is not read; write NORM or KONT"),
    **dict.fromkeys(("FCUB", "FLIN", "FPO"), "a feed that changes along the block is not read; write FNORM"),
    **dict.fromkeys(("DIAMON", "DIAM90", "DIAMCYCOF"), "diameters belong to a lathe; write DIAMOF"),
    **dict.fromkeys(("G962", "G972", "G973", "G942", "G952"), "is not read; write G96, G961, G97 or G971"),
    **dict.fromkeys(("REPOSL", "REPOSQ", "REPOSH", "REPOSA", "REPOSQA", "REPOSHA"), "repositioning is not read"),
    **dict.fromkeys(("MEAS", "MEAW", "MEASA", "MEAWA", "MEAC"), "probing ends at a signal, which the twin does not know"),
    **dict.fromkeys(("POS", "POSA", "POSP"), "positioning axes run beside the path; write G0 or G1"),
    **dict.fromkeys(("PUNCHACC", "PON", "SON", "SPOF", "PDELAYON"), "punching is not read"),
    **dict.fromkeys(("DEFINE", "TRAILON", "LEADON", "COUPON", "EGON"), "is not read"),
    **dict.fromkeys(("ISOCALL", "EXECTAB", "EXECSTRING", "ASUP", "SETINT"), "is not read"),
    "SETAL": "the program raises an alarm of its own",
    "AX": "axes by number are not read; write the axis itself",
}
