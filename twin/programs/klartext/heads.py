"""The beginnings of blocks, and what compiles the blocks that begin so."""

import re
from collections.abc import Callable
from typing import Final

from twin.programs.klartext import appr_dep, compensation, functions, m_functions, path, tool_calls
from twin.programs.klartext.cycles import calling, coordinates, defining, patterns, special
from twin.programs.klartext.numbers import value
from twin.programs.klartext.source import Source, unit_of
from twin.programs.klartext.state import MM_PER_INCH, State
from twin.programs.refusal import RefusedError

Command = Callable[[State], None]

PATH: Final = re.compile(r"(CTP|CP|CR|CT|CC|LP|C|L)(?=[ \t]|[XYZABCUVWMF]?[-+]|R[0LR]|FMAX|I[XYZABC]|P[RA]|DR|$)")
WAY: Final = re.compile(r"(APPR|DEP)[ \t]++(P?+(?:LCT|LT|LN|CT))(?![A-Z])")
CORNER: Final = re.compile(r"(RND|CHF)(?![A-QS-Z])")
CALL: Final = re.compile(
    r"CALL LBL[ \t]*+(\"[^\"]*+\"|QS[0-9]++|[0-9]++)[ \t]*+(?:REP[ \t]*+([0-9]++|Q[LR]?+[0-9]++)(?:[ \t]*+/[ \t]*+[0-9]++)?+)?+"
)
CYCL_CALL: Final = re.compile(r"CYCL CALL(?:[ \t]++(POS|PAT)(?![A-Z]))?+")
ASSIGNED: Final = re.compile(r"(?:DECLARE STRING[ \t]++)?+Q[LRS]?+[0-9]++[ \t]*+=")
M_ALONE: Final = re.compile(r"M[0-9]")
NOT_READ: Final = (
    ("FL", "free contour programming (FK) is not read; let the control or CAM write out its moves"),
    ("FC", "free contour programming (FK) is not read; let the control or CAM write out its moves"),
    ("FPOL", "free contour programming (FK) is not read; let the control or CAM write out its moves"),
    ("FSELECT", "free contour programming (FK) is not read; let the control or CAM write out its moves"),
    ("LN", "needs the direction of the surface and of the tool, which a machine with three axes does not take"),
    ("SPL", "splines are not read"),
    ("PLANE", "the tilted working plane needs the kinematics of the machine, which the twin does not have"),
    ("TCH PROBE", "a probing cycle ends where the workpiece is, which the twin does not know"),
    ("SEL PATTERN", "point tables are not read; write PATTERN DEF"),
    ("SEL CONTOUR", "contours of SL cycles are not read"),
    ("CONTOUR DEF", "contours of SL cycles are not read"),
    ("GLOBAL DEF", "global definitions of cycles are not read; write the figures into CYCL DEF"),
    ("TRANS", "is read as TRANS DATUM AXIS and TRANS DATUM RESET; write cycle 8, 10 or 11"),
    ("%", "this is a DIN/ISO program of a HEIDENHAIN control; only Klartext is read"),
)
PASSED_OVER: Final = ("BLK FORM", "SEL TABLE", "TOOL BREAK", "ERROR STOP", "SECTION", "ADP")


def compiled(source: Source, depth_max: int) -> Command:
    """Return what a block does. RefusedError where nothing is known that begins so."""
    body = source.body
    match = PATH.match(body)
    if match is not None:
        return path.compiled(source, match.end(), match.group(1))
    if M_ALONE.match(body) is not None:
        return path.compiled(source, 0, "M")
    if body.startswith("LBL"):
        return label(source)
    for begins, command in HEADS:
        if body.startswith(begins):
            return command(source)
    if ASSIGNED.match(body) is not None:
        return functions.assigned(source, depth_max)
    match = CORNER.match(body)
    if match is not None:
        return path.corner(source, match.end(), match.group(1))
    if body.startswith(PASSED_OVER):
        return lambda state: None
    words = source.written.split()
    for begins, reason in NOT_READ:
        if re.match(rf"{begins}(?![A-Z])", body) is not None:
            raise RefusedError(source.written[: len(begins)], reason)
    raise RefusedError(" ".join(words[:2])[:24], "is not read; no block of Klartext that is known begins so")


def way(source: Source) -> Command:
    match = WAY.match(source.body)
    if match is None:
        raise RefusedError(source.written[:16], "is written APPR or DEP with LT, LN, CT, LCT, PLT, PLN, PCT or PLCT")
    return appr_dep.compiled(source, match.end(), f"{match.group(1)} {match.group(2)}")


def label(source: Source) -> Command:
    """LBL 0 ends a subprogram; any other only marks a place."""
    from_body = re.fullmatch(r"LBL[ \t]*+(\"[^\"]*+\"|[0-9]++)[ \t]*+", source.body)
    if from_body is None:
        raise RefusedError(source.written[:24], 'is written LBL 1 or LBL "NAME"')
    if from_body.group(1).strip("0") == "":
        return lambda state: state.flow.label_zero()
    return lambda state: None


def call_label(source: Source) -> Command:
    match = CALL.fullmatch(source.body)
    if match is None:
        raise RefusedError(source.written[:24], "is written CALL LBL 1 or CALL LBL 1 REP 2")
    label = source.written[match.start(1) : match.end(1)].strip('"')
    times = value(match.group(2), match.group(2)) if match.group(2) else None
    word = source.written.strip()[:24]

    def run(state: State) -> None:
        named = functions.named(state, label)
        if times is None:
            state.flow.call(named, word)
            return
        given = times(state.variables)
        if not given.is_integer():
            raise RefusedError(word, "repeats are a whole number")
        state.flow.repeat(named, int(given), word)

    return run


def call_program(source: Source) -> Command:
    """CALL PGM, and CALL SELECTED PGM of SEL PGM."""
    selected = source.body.startswith("CALL SELECTED PGM")
    name = source.written[len("CALL PGM") :].strip()

    def run(state: State) -> None:
        compensation.refuse(state, "CALL PGM")
        chosen = state.selected if selected else resolved(state, name)
        if not chosen:
            raise RefusedError("CALL PGM", "needs the name of a program")
        state.call_program(chosen, chosen)

    return run


def resolved(state: State, name: str) -> str:
    """The name of a program, or the value of a string parameter."""
    return functions.named(state, name.upper()) if re.fullmatch(r"QS[0-9]+", name.upper()) else name


def select_program(source: Source) -> Command:
    name = source.written[len("SEL PGM") :].strip()

    def run(state: State) -> None:
        state.selected = resolved(state, name)

    return run


def begin_program(source: Source) -> Command:
    """BEGIN PGM: its unit holds for the program."""
    word = unit_of(source.body)
    if word is None:
        raise RefusedError(source.written[:32], "is written BEGIN PGM NAME MM or BEGIN PGM NAME INCH")
    unit = MM_PER_INCH if word == "INCH" else 1.0

    def run(state: State) -> None:
        state.unit_mm = unit

    return run


def end_program(source: Source) -> Command:
    def run(state: State) -> None:
        if not state.leave_program():
            m_functions.end(state, "END PGM")

    return run


def stop(source: Source) -> Command:
    """STOP: like M0, with other M functions."""
    rest = source._replace(body=f"M0  {source.body[4:]}", written=f"M0  {source.written[4:]}")
    return path.compiled(rest, 0, "M")


def cycl_call(source: Source) -> Command:
    match = CYCL_CALL.match(source.body)
    assert match is not None
    head = "CYCL CALL" + (f" {match.group(1)}" if match.group(1) else "")
    return calling.call(source, match.end(), head)


HEADS: Final[tuple[tuple[str, Callable[[Source], Command]], ...]] = (
    ("FN", functions.function),
    ("TOOL CALL", lambda source: tool_calls.call(source, len("TOOL CALL"))),
    ("TOOL DEF", lambda source: tool_calls.define(source, len("TOOL DEF"))),
    ("CYCL DEF", defining.cycl_def),
    ("CYCL CALL", cycl_call),
    ("CALL LBL", call_label),
    ("CALL PGM", call_program),
    ("CALL SELECTED PGM", call_program),
    ("SEL PGM", select_program),
    ("PATTERN DEF", lambda source: lambda state: patterns.pattern_def(state, source, len("PATTERN DEF"))),
    ("TRANS DATUM", lambda source: lambda state: coordinates.trans_datum(state, source, len("TRANS DATUM"))),
    ("FUNCTION", special.function),
    ("PLANE RESET", lambda source: lambda state: None),
    ("APPR", way),
    ("DEP", way),
    ("BEGIN PGM", begin_program),
    ("END PGM", end_program),
    ("STOP", stop),
)
