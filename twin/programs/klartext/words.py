"""F and S words in the text of a Klartext line: found, replaced, added. Nothing else of the line changes, not even its spaces.

F stands in the path block, before its M functions; FMAX is rapid traverse and no feed that could be changed. S stands in TOOL
CALL alone. Feeds of cycles (Q206, Q207, …) are left alone.
"""

import math
import re
from typing import Final

from twin.programs.klartext.block import WORD
from twin.programs.klartext.source import CAPITALS, part_of, unit_of
from twin.programs.klartext.state import INCH_FEED
from twin.programs.source import WordPlace

DIGITS: Final = 4
PATH: Final = re.compile(
    r"(?:CTP|CP|CR|CT|LP|C(?!C|YCL|ALL)|L(?!BL)|RND|CHF|(?:DEP|APPR)[ \t]++P?+(?:LCT|LT|LN|CT))(?=[ \t+\-IXYZABCUVWFMRDP0-9]|$)"
)
GOES: Final = re.compile(r"I?+(?:[XYZABCUVW]|P[RA])")
TOOL_CALL: Final = re.compile(r"TOOL CALL(?:[ \t]++\"[^\"]*+\")?+")
PLAIN: Final = re.compile(r"[-+]?[ \t]*[0-9.,]+")
BRANCHES: Final = re.compile(r"/|LBL|CALL[ \t]|FN[ \t]*+(?:9|1[0-2])[ \t]*+:|STOP")
OWNERS: Final = frozenset({103, 112, 124, 128, 140})
"""M functions that take F, T or A for themselves."""
SPINDLE: Final = frozenset({3, 4, 13, 14})


def _body(line: str) -> tuple[str, int]:
    """Return what the control reads of a line, in capitals, and where it begins."""
    part, *_ = part_of(line, 0)
    if not part.body:
        return "", len(line)
    begin = line.translate(CAPITALS).find(part.body)
    return part.body, max(begin, 0)


def _words(body: str, at: int) -> list[re.Match[str]]:
    found = []
    while at < len(body):
        match = WORD.match(body, at)
        if match is None or match.lastindex is None:
            break
        found.append(match)
        at = match.end()
    return found


def _find(body: str, begin: int, offset: int, name: str) -> WordPlace | None:
    """The last word with a value of that name that no M function has for its own."""
    found, owned = None, False
    for match in _words(body, begin):
        if match.lastindex == 4:
            owned = int(match.group(4)) in OWNERS
        elif match.lastindex == 7 and match.group(6) == name and not owned:
            plain = PLAIN.fullmatch(match.group(7)) is not None
            found = WordPlace(offset + match.start(6), offset + match.start(7), offset + match.end(7), plain)
        elif match.lastindex != 7:
            owned = False
    return found


def feed_place(line: str) -> WordPlace | None:
    """Return the place of F in a path block.

    >>> feed_place("8 L X+5 Y+5 R0 F300 M3 ; F1"), feed_place("9 L Z+2 FMAX"), feed_place("L X+Q1 FQ2").plain
    (WordPlace(begin=15, figure=16, end=19, plain=True), None, False)
    """
    body, offset = _body(line)
    head = PATH.match(body)
    return None if head is None else _find(body, head.end(), offset, "F")


def speed_place(line: str) -> WordPlace | None:
    """Return the place of S in TOOL CALL.

    >>> speed_place("3 TOOL CALL 1 Z S4000")
    WordPlace(begin=16, figure=17, end=21, plain=True)
    """
    body, offset = _body(line)
    head = TOOL_CALL.match(body)
    return None if head is None else _find(body, head.end(), offset, "S")


def with_feed(line: str, figure: str) -> str:
    """Return the block with this F; one with FMAX, and a line that is no path block, as they are.

    >>> with_feed("26 CYCL CALL", "250"), with_feed("CALL LBL 1", "250"), with_feed("LBL 1", "250")
    ('26 CYCL CALL', 'CALL LBL 1', 'LBL 1')
    >>> with_feed("8 L X+5 R0 F300 M3", "250"), with_feed("8 L X+5 R0 M3 ; on", "250"), with_feed("9 L Z+2 FMAX", "250")
    ('8 L X+5 R0 F250 M3', '8 L X+5 R0 F250 M3 ; on', '9 L Z+2 FMAX')
    """
    place = feed_place(line)
    if place is not None:
        return place.replaced(line, figure)
    body, offset = _body(line)
    head = PATH.match(body)
    if head is None or _has_other_feed(body, head.end()):
        return line
    return _inserted(line, body, offset, head.end(), f"F{figure}")


def _has_other_feed(body: str, begin: int) -> bool:
    return any(match.lastindex == 1 or (match.lastindex == 7 and match.group(6) in ("FU", "FZ")) for match in _words(body, begin))


def _inserted(line: str, body: str, offset: int, begin: int, word: str) -> str:
    """The line with a word behind its last one that is not an M function."""
    end = begin
    for match in _words(body, begin):
        if match.lastindex == 4:
            break
        end = match.end()
    at = offset + len(body[:end].rstrip())
    return f"{line[:at]} {word}{line[at:]}"


def with_speed(line: str, figure: str) -> str:
    """Return TOOL CALL with this S; any other line as it is.

    >>> with_speed("3 TOOL CALL 1 Z", "900"), with_speed("L X+5", "900")
    ('3 TOOL CALL 1 Z S900', 'L X+5')
    """
    place = speed_place(line)
    if place is not None:
        return place.replaced(line, figure)
    body, offset = _body(line)
    head = TOOL_CALL.match(body)
    return line if head is None else _inserted(line, body, offset, head.end(), f"S{figure}")


def feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed, rounded down; in an inch program in tenths of an inch a minute.

    >>> feed_figure(500.0, False), feed_figure(437.26, False), feed_figure(1270.0, True)
    ('500', '437.2', '500')
    """
    value = feed_mm_min / INCH_FEED if inch else feed_mm_min
    value *= 1.0 + 1e-12
    places = max(0, DIGITS - 1 - math.floor(math.log10(value)))
    text = f"{math.floor(value * 10**places) / 10**places:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def figure_mm_min(figure: str, inch: bool) -> float:
    """The feed that a control reads.

    >>> figure_mm_min("500", True)
    1270.0
    """
    return float(figure.replace(",", ".")) * (INCH_FEED if inch else 1.0)


def exact_feed_figure(feed_mm_min: float, inch: bool) -> str:
    """A feed to the sixth place.

    >>> exact_feed_figure(83.3333333, False), exact_feed_figure(1270.0, True)
    ('83.333333', '500')
    """
    return f"{feed_mm_min / INCH_FEED if inch else feed_mm_min:.6f}".rstrip("0").rstrip(".")


def inch_lines(lines: list[str], inch: bool) -> list[bool]:
    """Return True for each line of an INCH program; `inch`: before BEGIN PGM.

    >>> inch_lines(["0 BEGIN PGM A INCH", "1 L X+5"], False)
    [True, True]
    """
    found = []
    for line in lines:
        body = _body(line)[0] if "PGM" in line.translate(CAPITALS) else ""
        unit = unit_of(body) if body.startswith("BEGIN PGM") else None
        inch = inch if unit is None else unit == "INCH"
        found.append(inch)
    return found


def branches(lines: list[str]) -> list[bool]:
    """Return True for each line with a block skip, a label, a jump to one, or a call.

    >>> branches(["1 L X+3", "/2 L X+4", "3 LBL 1", "4 / L X+5", "5 CALL LBL 1 REP 2"])
    [False, True, True, True, True]
    """
    bodies = [_body(line)[0] for line in lines]
    return [BRANCHES.match(body) is not None or line.lstrip()[:1] == "/" for body, line in zip(bodies, lines, strict=True)]


def takes_feed(line: str) -> bool:
    """Return True for a path block that goes somewhere, but in rapid, and for a corner.

    APPR LT, LN and CT begin with the feed of the block before, so a feed of their own is not that of all their moves; a block
    with M89 or M99 moves by the feeds of its cycle.

    >>> takes_feed("L X+5"), takes_feed("L X+5 FMAX"), takes_feed("CC X+5 Y+5"), takes_feed("L X+5 M99"), takes_feed("L M3")
    (True, False, False, False, False)
    """
    body, _ = _body(line)
    head = PATH.match(body)
    if head is None or _has_other_feed(body, head.end()):
        return False
    words = _words(body, head.end())
    if any(match.lastindex == 4 and int(match.group(4)) in (89, 99) for match in words):
        return False
    text = head.group()
    if text.startswith("APPR"):
        return text.endswith("LCT")
    if text.startswith(("RND", "CHF", "DEP")):
        return True
    return any(match.lastindex == 7 and GOES.fullmatch(match.group(6)) is not None for match in words)


def probes(line: str) -> bool:
    """Return True for a probing cycle."""
    return _body(line)[0].startswith("TCH PROBE")


def commands_speed(line: str) -> bool:
    """Return True for S of TOOL CALL; S stands nowhere else."""
    return speed_place(line) is not None


def starts_spindle(line: str) -> bool:
    """Return True for a TOOL CALL with M3 or M4 of its own: where M3 stands alone, no S can stand beside it."""
    body, _ = _body(line)
    head = TOOL_CALL.match(body)
    return head is not None and any(match.lastindex == 4 and int(match.group(4)) in SPINDLE for match in _words(body, head.end()))


def block_number(line: str) -> int | None:
    """Return the number before a block.

    >>> block_number("12 L X+5"), block_number("L X+5")
    (12, None)
    """
    return part_of(line, 0)[0].number
