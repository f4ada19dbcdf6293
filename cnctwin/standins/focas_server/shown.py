"""A FANUC control's view of a state: status words, modal codes, signals of the PMC. Pure functions.

Modal codes are a fold over the states (`coded`), because a code stands until the next one of its kind: after a tool change M
stays at 6 until the next M code, and T is the tool that was called for next, long before it is in the spindle. So neither says by
itself that a change is in progress; the status word MSTB does, and the strobes MF and TF.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any

from cnctwin.standins.simulated_control.state import ControlState

_MODES = {"MANUAL_DATA_INPUT": 0, "AUTOMATIC": 1, "SEMI_AUTOMATIC": 1, "EDIT": 3, "MANUAL": 5}
_RUNS = {"ACTIVE": 3, "FEED_HOLD": 2, "INTERRUPTED": 2, "STOPPED": 1, "PROGRAM_STOPPED": 1, "OPTIONAL_STOP": 1}
_COMMENT = re.compile(r"\([^)]*\)?")
_WORD = re.compile(r"(?<![A-Z#\[])([MTSFGHD])(\d{1,6})")
_GROUPS = ((0, 1, 2, 3), (17, 18, 19), (90, 91))  # G codes of the groups 0, 1, 2 as `cnc_rdgcode` numbers them
_RAPID_OVERRIDE_CODES = ((100.0, 0), (50.0, 1), (25.0, 2))  # ROV2, ROV1; anything less is F0
PMC_BYTES = {0: 768, 1: 768, 2: 128, 3: 128, 4: 125, 5: 8000, 6: 500, 7: 100, 8: 400, 9: 10_000}
"""The number of bytes of G, F, Y, X, A, R, T, K, C and D."""
CHANGE_RELAY = 100
"""The byte R whose bit 0 says that a tool change is in progress, as a machine builder's ladder would have it."""
SPINDLE_TOOL = 100
"""The word D with the number of the tool in the spindle (0 = none), likewise."""
PMC_SHOWN = (f"R{CHANGE_RELAY}.0", f"D{SPINDLE_TOOL}:2")


@dataclass(frozen=True, slots=True)
class ControlDescription:
    """The control as it was bought and set up.

    work_offset_mm: machine position minus absolute position, of each axis
    max_axis: how many axes it has room for; answers about all axes are that long
    has_tool_number: whether it has the option that `cnc_toolnum` needs
    macros: common variables that hold a value; the others are vacant
    operator_message: number and text, None where there is none
    program_comments: what stands in the heads of the programs, by number
    tool_offsets_mm: by tool and kind (0 radius wear, 1 radius, 2 length wear, 3 length)
    program_lines: the text that blocks come from; what follows the running block is shown with it
    """

    cnc_type: str = "31"
    mt_type: str = " M"
    series: str = "G421"
    version: str = "40.1"
    axis_names: tuple[str, ...] = ("X", "Y", "Z")
    spindle_names: tuple[str, ...] = ("S",)
    max_axis: int = 32
    work_offset_mm: tuple[float, ...] = (-450.0, -280.0, -380.0)
    has_tool_number: bool = False
    macros: dict[int, float] = field(default_factory=dict)
    tool_offsets_mm: dict[tuple[int, int], float] = field(default_factory=dict)
    tools_max: int = 400
    operator_message: tuple[int, str] | None = None
    program_comments: dict[int, str] = field(default_factory=dict)
    program_lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class Codes:
    """The modal codes: of M, T, S, F, H, D, and of the first three groups of G."""

    m_code: int = 30
    t_code: int = 0
    s_code: int = 0
    f_code: int = 0
    h_code: int = 0
    d_code: int = 0
    g_codes: tuple[int, int, int] = (0, 17, 90)


@dataclass(frozen=True)
class CodedState(Codes, ControlState):
    """A state that knows the modal codes."""


_STATE_FIELDS = fields(ControlState)


@dataclass(frozen=True, slots=True)
class Moment:
    """All that one frame of answers is made of: the state, and the control's own date and time."""

    state: ControlState
    calendar_s: float
    description: ControlDescription

    @property
    def calendar(self) -> datetime:
        """The control's clock, which knows whole seconds and no time zone."""
        return datetime.fromtimestamp(int(self.calendar_s), UTC)


def status_words(state: ControlState) -> tuple[int, ...]:
    """Mode, run, motion, MSTB, emergency, alarm, edit of `cnc_statinfo`, as 0i and 30i number them.

    >>> status_words(ControlState(exec_state="ACTIVE", feed_mm_min=500.0))
    (1, 3, 1, 0, 0, 0, 0)
    """
    return (
        _MODES.get(state.mode, 1),
        _RUNS.get(state.exec_state, 0),
        int(state.feed_mm_min > 0),
        int(state.is_changing_tool),
        0,
        int(state.alarm is not None),
        0,
    )


def coded(states: Iterable[ControlState]) -> Iterator["CodedState"]:
    """The states with the modal codes that stand at each, for a `SimulatedControl` that a FOCAS server shows.

    >>> blocks = ("T2 M6", "G1 X3.", "G0 T3 (M9)", "M30")
    >>> [(state.m_code, state.t_code) for state in coded(ControlState(block=block) for block in blocks)]
    [(6, 2), (6, 2), (6, 3), (30, 3)]
    """
    codes = Codes()
    for state in states:
        codes = _after(codes, state.block)
        yield CodedState(*(getattr(state, entry.name) for entry in _STATE_FIELDS), **_as_keywords(codes))


def _after(codes: Codes, block: str) -> Codes:
    kept = _as_keywords(codes)
    for letter, digits in _WORD.findall(_COMMENT.sub("", block)):
        number = int(digits)
        if letter != "G":
            kept[f"{letter.lower()}_code"] = number
        for group, members in enumerate(_GROUPS):
            if letter == "G" and number in members:
                kept["g_codes"] = (*kept["g_codes"][:group], number, *kept["g_codes"][group + 1 :])
    return Codes(**kept)


def _as_keywords(codes: Codes) -> dict[str, Any]:
    return {entry.name: getattr(codes, entry.name) for entry in fields(Codes)}


def codes_of(state: ControlState) -> Codes:
    """Return the codes that stand at this state; of one that no fold has seen, what its block says."""
    return state if isinstance(state, CodedState) else _after(Codes(), state.block)


def program_number(state: ControlState) -> int:
    """The digits of the program's name."""
    digits = re.search(r"\d+", state.program)
    return int(digits[0]) % 10**8 if digits else 0


def program_text(moment: Moment, characters: int) -> str:
    """The running block and what follows it, as `cnc_rdexecprog` shows them."""
    lines = moment.description.program_lines
    follow = lines[moment.state.line :] if 0 < moment.state.line <= len(lines) else ()
    text = moment.state.block
    for line in follow:
        if len(text) >= characters:
            break
        text += f"\n{line}"
    return f"{text}\n"[:characters]


def macro(moment: Moment, number: int) -> float | None:
    """A variable's value, None where it is vacant; KeyError where there is no such variable."""
    state, now, codes = moment.state, moment.calendar, codes_of(moment.state)
    system: dict[int, float] = {
        3011: now.year * 10_000 + now.month * 100 + now.day,
        3012: now.hour * 10_000 + now.minute * 100 + now.second,
        3901: state.part_count,
        4107: codes.d_code,
        4109: codes.f_code,
        4111: codes.h_code,
        4113: codes.m_code,
        4114: state.line,
        4115: program_number(state),
        4119: codes.s_code,
        4120: codes.t_code,
    }
    if number in system:
        return float(system[number])
    if 4001 <= number <= 4130:
        return None
    if 1 <= number <= 33 or 100 <= number <= 199 or 500 <= number <= 999:
        return moment.description.macros.get(number)
    raise KeyError(number)


def parameters(moment: Moment) -> dict[int, int]:
    """The parameters that it knows: parts machined, parts in all, minutes of power-on."""
    state = moment.state
    return {6711: state.part_count, 6712: state.part_count, 6750: int(state.at_s // 60)}


def pmc_memory(state: ControlState) -> dict[tuple[int, int], int]:
    """The bytes that are not 0, by area and address. M and T code lie with the low byte first, as in the PMC."""
    runs = state.exec_state == "ACTIVE"
    rapid = next((code for percent, code in _RAPID_OVERRIDE_CODES if state.rapid_override_pct >= percent), 3)
    memory = {
        (0, 12): 255 - _byte(state.feed_override_pct),  # *FV0 to *FV7 are active at 0
        (0, 14): rapid,
        (0, 30): _byte(state.spindle_override_pct),
        (1, 0): 0xA0 if runs else 0x00,  # OP, STL
        (1, 1): int(state.alarm is not None),
        (1, 7): 0x09 if state.is_changing_tool else 0x00,  # MF, TF
        (5, CHANGE_RELAY): int(state.is_changing_tool),
    }
    codes = codes_of(state)
    words = ((1, 10, codes.m_code, 4), (1, 26, codes.t_code, 4), (9, SPINDLE_TOOL, state.tool_number, 2))
    for area, first, number, width in words:
        memory |= {(area, first + at): byte for at, byte in enumerate(number.to_bytes(width, "little"))}
    return memory


def _byte(percent: float) -> int:
    return min(max(round(percent), 0), 254)
