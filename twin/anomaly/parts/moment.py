"""The moment of a part: operation (program, tool, n-th use of that tool) and section of it (line, and distance along the line).

    moved ← moved + feed · tick          along the line, mm
    moved ← moved + override · tick      since the operation began, s as programmed, where the control tells no line

Overrides and holds do not shift a section. Where no line is told, the signals put the progress right (`alignment.py`). A part
begins where the program changes or goes back to its beginning; without a line, where the first tool comes back, or a single one
after a standstill. The first part notes a mark each second; sections are made of them when it has ended (`sectioning.py`), and
looked up from then on.
"""

from bisect import bisect_right
from typing import NamedTuple

Mark = tuple[int, float]
"""The beginning of a section: line and mm along it; −1 and s as programmed where the control reports no line."""
NO_LINE = -1
USES_MAX = 100
BACK_SHARE = 0.1
STOOD_S = 10.0
FORMED_S = 1.0
FORMED_MAX = 256
SECTIONS_MAX = 64
BEYOND = 1.2
SLACK_MM = 5.0


class Place(NamedTuple):
    """The place of a machine in its part.

    key: of the operation, as "O1|T3|1", None where program or tool is not known; part: parts of this program that began
    line: as last told, −1 = not known; line_first, line_last: lowest and highest of this part
    moved_mm: along the line; uses: of each tool in this part; first_tool: of this part
    section: of the operation; forming: marks of sections that no earlier part has; section_ticks: ticks that told of the section
    section_s: length of the sections that are formed; end: the furthest moment of this operation
    stood_ticks: how long the spindle has stood; ticks: that told in this operation; is_whole: it was seen from its beginning
    band: costs of other offsets, where no line is told (`alignment.py`)
    """

    program: str | None = None
    tool: int | None = None
    key: str | None = None
    part: int = 0
    line: int = NO_LINE
    line_first: int = NO_LINE
    line_last: int = NO_LINE
    moved_mm: float = 0.0
    uses: dict[str, int] = {}  # noqa: RUF012  never changed in place
    first_tool: int | None = None
    section: int = 0
    forming: tuple[Mark, ...] = ()
    section_ticks: int = 0
    section_s: float = FORMED_S
    end: Mark = (NO_LINE, 0.0)
    stood_ticks: int = 0
    ticks: int = 0
    is_whole: bool = False
    band: tuple[float, ...] = ()

    def moved_to(self, here: Mark, section: int) -> "Place":
        """Return the place after one more tick that tells."""
        line, moved = here
        last, end = self.line_last, self.end
        return Place(
            self.program,
            self.tool,
            self.key,
            self.part,
            line,
            self.line_first,
            line if line > last else last,
            moved,
            self.uses,
            self.first_tool,
            section,
            self.forming,
            self.section_ticks + 1 if section == self.section else 1,
            self.section_s,
            here if here > end else end,
            0,
            self.ticks + 1,
            self.is_whole,
            self.band,
        )


def is_part_begun(place: Place, program: str | None, tool: int | None, line: int, stood_ticks_min: int) -> bool:
    """Return True where a part of a program begins at this tick.

    >>> here = Place(program="O1", tool=3, line=900, line_first=10, line_last=900, first_tool=1)
    >>> [is_part_begun(here, "O1", 3, line, 10) for line in (910, 400, 20)], is_part_begun(here, "O2", 3, 910, 10)
    ([False, False, True], True)
    """
    if program != place.program:
        return True
    if line >= 0:
        return line < place.line and line <= place.line_first + BACK_SHARE * (place.line_last - place.line_first)
    if tool is None or place.first_tool is None:
        return tool is not None
    if tool != place.tool:
        return tool == place.first_tool and len(place.uses) > 1
    return len(place.uses) == 1 and place.stood_ticks >= stood_ticks_min


def operation_begun(place: Place, program: str | None, tool: int | None, line: int, is_part: bool, is_seen: bool) -> Place:
    """Return the place at the beginning of an operation; is_seen: the machine was followed up to it."""
    uses = {} if is_part else place.uses
    name = "?" if tool is None else str(tool)
    if len(uses) < USES_MAX or name in uses:
        uses = {**uses, name: uses.get(name, 0) + 1}
    key = None if program is None and tool is None else f"{program or '?'}|T{name}|{uses.get(name, 1)}"
    return Place(
        program,
        tool,
        key,
        place.part + 1 if is_part and program == place.program else 1 if is_part else place.part,
        line,
        line if is_part else place.line_first,
        line if is_part else max(place.line_last, line),
        uses=uses,
        first_tool=tool if is_part else place.first_tool,
        is_whole=is_seen,
    )


def section_at(marks: tuple[Mark, ...], line: int, moved_mm: float) -> int:
    """Return the section that a moment is in, of marks in ascending order.

    >>> section_at(((10, 0.0), (10, 50.0), (30, 0.0)), 20, 7.0)
    1
    """
    return max(0, bisect_right(marks, (line, moved_mm)) - 1)


def is_beyond(end: Mark, line: int, moved_mm: float) -> bool:
    """Return True where a moment lies beyond the furthest one that earlier parts came to."""
    return line > end[0] or (line == end[0] and moved_mm > BEYOND * end[1] + SLACK_MM)


def formed(place: Place, known: int, override: float, tick_s: float) -> Place:
    """Return the place after a tick beyond what earlier parts know: a mark each second at full feed.

    Where there are too many, they are twice as far apart from then on, and every other one goes.
    """
    marks, length_s = place.forming, place.section_s
    if not marks or place.section_ticks * tick_s * override >= length_s:
        here = (place.line, place.moved_mm)
        if not marks or here > marks[-1]:
            marks = (*marks, here)
            if len(marks) > FORMED_MAX:
                marks, length_s = marks[::2], 2.0 * length_s
        return place._replace(forming=marks, section_s=length_s, section=known + len(marks) - 1, section_ticks=0)
    return place
