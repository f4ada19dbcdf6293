"""The functions that the server knows, each from a moment and arguments to the bytes of its answer.

Everything that is not in the table is refused with EW_FUNC. There is no function that writes, so nothing here changes anything.

    evidence   functions
    captured   sysinfo 18, statinfo 19, alarm bits 1A, program numbers 1C, sequence number 1D, feed 24, spindle speed 25,
               position 26, servo load 56, axis names 89, axis count A4, macro 15, parameter 0E and 8D, alarm messages 23,
               PMC range 8001
    reported   program text 20, spindle meter 40, date and time 45, spindle names 8A, tool offset 08, G codes 96, program names
               B9, CF and FC, mode words 98 and E1 that go with statinfo, list of programs 06, operator message 34
    our guess  modal 21 and tool number 22: there is no public description of their answers
"""

import struct
from collections.abc import Callable

from cnctwin.standins.focas_server import shown
from cnctwin.standins.focas_server.frames import Code, Request, figure
from cnctwin.standins.focas_server.shown import Moment

CNC, PMC = 1, 2
ALL = -1
SPINDLE_SLOTS = 8
LEFT_OVER = b"\x20"
"""The bytes where there is no axis: the answer has room for all axes, and for a missing one it holds what was there before."""
MACROS_MAX = 100
ALARM_TEXT_BYTES_MAX = 64
MESSAGE_BYTES_MAX = 256
WITH_COMMENT = 2
Arguments = tuple[int, int, int, int]
Answer = bytes | Code
Function = Callable[[Moment, Arguments], Answer]

WRITES = {
    (CNC, 0x01): "start the program",
    (CNC, 0x03): "select a program",
    (CNC, 0x05): "delete a program",
    (CNC, 0x16): "set a macro variable",
    (CNC, 0x1F): "rewind the program",
    (CNC, 0x46): "set date or time",
    (CNC, 0xA8): "set a macro variable",
    (CNC, 0xB6): "delete a file",
    (CNC, 0xBA): "select the main program",
    (PMC, 0x8002): "write to the PMC",
}
"""The functions known to change a control, for the count; they are refused like all others that are not in the table."""


def answer(moment: Moment, request: Request) -> Answer:
    """The data that this block asks for, or the code why there is none."""
    function = FUNCTIONS.get((request.device, request.command))
    if function is None:
        return Code.FUNC
    if request.path != 1:
        return Code.PATH
    return function(moment, request.arguments)


def _sysinfo(moment: Moment, _: Arguments) -> Answer:
    it = moment.description
    texts = (it.cnc_type, it.mt_type, it.series, it.version, f"{len(it.axis_names):02d}")
    return struct.pack(">HH2s2s4s4s2s", 0x0402, it.max_axis, *(text.encode("ascii") for text in texts))


def _statinfo(moment: Moment, _: Arguments) -> Answer:
    return struct.pack(">7H", *shown.status_words(moment.state))


def _mode_word(_: Moment, __: Arguments) -> Answer:
    return bytes(2)


def _alarm_bits(moment: Moment, _: Arguments) -> Answer:
    kind = _alarm_type(moment)
    return struct.pack(">I", 0 if kind is None else 1 << kind)


def _alarm_type(moment: Moment) -> int | None:
    """EX (15) from 1000 on, which machine builders use; PS (3) below."""
    alarm = moment.state.alarm
    return None if alarm is None else (15 if alarm[0] >= 1000 else 3)


def _alarm_messages(moment: Moment, arguments: Arguments) -> Answer:
    wanted, number_max, with_text, text_bytes = arguments
    alarm, kind = moment.state.alarm, _alarm_type(moment)
    if not 0 <= text_bytes <= ALARM_TEXT_BYTES_MAX or number_max < 1:
        return Code.LENGTH
    if not ALL <= wanted <= 31:
        return Code.ATTRIB
    if alarm is None or kind is None or wanted not in (ALL, kind):
        return b""
    text = alarm[1].encode("ascii", "replace")[:text_bytes] if with_text else b""
    return struct.pack(">iiii", alarm[0], kind, 0, len(text)) + text.ljust(text_bytes, b"\0")


def _program_numbers(moment: Moment, _: Arguments) -> Answer:
    number = shown.program_number(moment.state)
    return struct.pack(">ii", number, number)


def _sequence_number(moment: Moment, _: Arguments) -> Answer:
    return struct.pack(">i", moment.state.line)


def _program_text(moment: Moment, arguments: Arguments) -> Answer:
    if not 1 <= arguments[0] <= 1436:
        return Code.LENGTH
    return struct.pack(">i", moment.state.line) + shown.program_text(moment, arguments[0]).encode("ascii", "replace")


def _program_list(moment: Moment, arguments: Arguments) -> Answer:
    """Records of number, size and comment, from the first program that is not below the number asked for."""
    first, number_max, kind = arguments[:3]
    if kind != WITH_COMMENT or number_max < 1:
        return Code.ATTRIB
    listed = sorted(number for number in moment.description.program_comments if number >= first)[:number_max]
    return b"".join(
        struct.pack(">II64s", number, 1, moment.description.program_comments[number].encode("ascii", "replace")[:63])
        for number in listed
    )


def _operator_message(moment: Moment, _: Arguments) -> Answer:
    """Number, type, length and text; the number -1 where there is no message."""
    shown_now = moment.description.operator_message
    if shown_now is None:
        return struct.pack(">iii", -1, 0, 0)
    text = shown_now[1].encode("ascii", "replace")[:MESSAGE_BYTES_MAX]
    return struct.pack(">iii", shown_now[0], 0, len(text)) + text.ljust(MESSAGE_BYTES_MAX, b"\0")


def _program_path(moment: Moment, _: Arguments) -> Answer:
    return f"//CNC_MEM/USER/PATH1/{moment.state.program}".encode("ascii", "replace")[:255] + b"\0"


def _executing_program(moment: Moment, _: Arguments) -> Answer:
    name = moment.state.program.encode("ascii", "replace")[:35]
    return struct.pack(">i36s", shown.program_number(moment.state), name)


def _modal(moment: Moment, arguments: Arguments) -> Answer:
    kind, block = arguments[:2]
    if block not in (0, 1, 2):
        return Code.ATTRIB
    codes = shown.codes_of(moment.state)
    known = {103: codes.f_code, 106: codes.m_code, 107: codes.s_code, 108: codes.t_code}
    if 100 <= kind <= 126:
        return struct.pack(">iBBxx", known.get(kind, 0), 0, 0)
    return struct.pack(">B7x", codes.g_codes[kind]) if 0 <= kind < len(codes.g_codes) else Code.ATTRIB


def _g_code(moment: Moment, arguments: Arguments) -> Answer:
    group, codes = arguments[0], shown.codes_of(moment.state).g_codes
    return struct.pack(">H4xH2xH", group, codes[group], 0) if 0 <= group < len(codes) else Code.ATTRIB


def _tool_number(moment: Moment, _: Arguments) -> Answer:
    return struct.pack(">ii", 0, moment.state.tool_number) if moment.description.has_tool_number else Code.NOOPT


def _feed(moment: Moment, _: Arguments) -> Answer:
    return figure(moment.state.feed_mm_min)


def _spindle_speed(moment: Moment, _: Arguments) -> Answer:
    return figure(moment.state.spindle_rpm)


def _position(moment: Moment, arguments: Arguments) -> Answer:
    kind, axis = arguments[:2]
    machine, offset = moment.state.axis_pos_mm, moment.description.work_offset_mm
    absolute = tuple(at - zero for at, zero in zip(machine, offset, strict=True))
    to_go = (0.0,) * len(machine)
    kinds = {0: absolute, 1: machine, 2: absolute, 3: to_go, 4: absolute, 6: absolute, 7: to_go, 8: absolute}
    return _of_axes(moment, kinds.get(kind), axis, 3)


def _servo_load(moment: Moment, arguments: Arguments) -> Answer:
    return _of_axes(moment, moment.state.axis_load_pct if arguments[0] == 1 else None, ALL, 0)


def _of_axes(moment: Moment, values: tuple[float, ...] | None, axis: int, decimals: int) -> Answer:
    """One figure, or one for each axis that there could be: past those that there are, the control sends what lies there."""
    if values is None:
        return Code.ATTRIB
    if axis == ALL:
        return b"".join(figure(value, decimals) for value in values).ljust(8 * moment.description.max_axis, LEFT_OVER)
    return figure(values[axis - 1], decimals) if 1 <= axis <= len(values) else Code.ATTRIB


def _spindle_meter(moment: Moment, arguments: Arguments) -> Answer:
    kind, spindle = arguments[:2]
    load, speed = figure(moment.state.spindle_load_pct), figure(moment.state.spindle_rpm)
    here = {0: load + speed, 4: load, 5: speed}.get(kind)
    if here is None or spindle not in (ALL, 1):
        return Code.ATTRIB
    return here.ljust(len(here) * SPINDLE_SLOTS, LEFT_OVER) if spindle == ALL else here


def _axis_names(moment: Moment, _: Arguments) -> Answer:
    return b"".join(name.encode("ascii").ljust(4, b"\0") for name in moment.description.axis_names)


def _spindle_names(moment: Moment, _: Arguments) -> Answer:
    return b"".join(name.encode("ascii").ljust(4, b"\0") for name in moment.description.spindle_names)


def _axis_count(moment: Moment, arguments: Arguments) -> Answer:
    it = moment.description
    counts = {0: len(it.axis_names), 1: len(it.spindle_names), 2: len(it.axis_names), 3: len(it.axis_names)}
    count = counts.get(arguments[0])
    return Code.ATTRIB if count is None else count.to_bytes(2, "big")


def _date_or_time(moment: Moment, arguments: Arguments) -> Answer:
    now = moment.calendar
    if arguments[0] == 0:
        return struct.pack(">3H6x", now.year, now.month, now.day)
    return struct.pack(">6x3H", now.hour, now.minute, now.second) if arguments[0] == 1 else Code.DATA


def _macros(moment: Moment, arguments: Arguments) -> Answer:
    first, last = arguments[:2]
    if not 0 <= last - first < MACROS_MAX:
        return Code.LENGTH
    try:
        return b"".join(figure(value, _decimals(value)) for value in (shown.macro(moment, n) for n in range(first, last + 1)))
    except KeyError:
        return Code.NUMBER


def _decimals(value: float | None) -> int:
    return 0 if value is None or value == int(value) else 6


def _parameter(moment: Moment, arguments: Arguments) -> Answer:
    return _parameter_of(moment, arguments, figure)


def _parameter_16(moment: Moment, arguments: Arguments) -> Answer:
    return _parameter_of(moment, arguments, lambda value: struct.pack(">i", value))


def _parameter_of(moment: Moment, arguments: Arguments, encode: Callable[[int], bytes]) -> Answer:
    first, last = arguments[:2]
    known = shown.parameters(moment)
    if first != last or first not in known:
        return Code.NUMBER
    rest = encode(0) * (moment.description.max_axis - 1)
    return struct.pack(">IhH", first, 0, 3) + encode(known[first]) + rest


def _tool_offsets(moment: Moment, arguments: Arguments) -> Answer:
    first, last, kind = arguments[:3]
    it = moment.description
    if kind % 1000 > 3 or kind // 1000 not in (0, 1):
        return Code.ATTRIB
    if not 1 <= first <= last <= it.tools_max or last - first >= MACROS_MAX:
        return Code.NUMBER
    return b"".join(figure(it.tool_offsets_mm.get((tool, kind % 1000), 0.0), 3) for tool in range(first, last + 1))


def _pmc_range(moment: Moment, arguments: Arguments) -> Answer:
    """Bytes as they lie; words and double words are turned, as the PMC keeps the low byte first and FOCAS sends the high one."""
    first, last, area, kind = arguments
    size = shown.PMC_BYTES.get(area)
    if size is None or kind not in (0, 1, 2):
        return Code.ATTRIB
    width, length = 1 << kind, last - first + 1
    if not 0 <= first <= last < size:
        return Code.NUMBER
    if length % width or length > 1400:
        return Code.LENGTH
    memory = shown.pmc_memory(moment.state)
    raw = bytes(memory.get((area, at), 0) for at in range(first, last + 1))
    return b"".join(raw[at : at + width][::-1] for at in range(0, length, width))


FUNCTIONS: dict[tuple[int, int], Function] = {
    (CNC, 0x06): _program_list,
    (CNC, 0x08): _tool_offsets,
    (CNC, 0x0E): _parameter_16,
    (CNC, 0x15): _macros,
    (CNC, 0x18): _sysinfo,
    (CNC, 0x19): _statinfo,
    (CNC, 0x1A): _alarm_bits,
    (CNC, 0x1C): _program_numbers,
    (CNC, 0x1D): _sequence_number,
    (CNC, 0x20): _program_text,
    (CNC, 0x21): _modal,
    (CNC, 0x22): _tool_number,
    (CNC, 0x23): _alarm_messages,
    (CNC, 0x24): _feed,
    (CNC, 0x25): _spindle_speed,
    (CNC, 0x26): _position,
    (CNC, 0x34): _operator_message,
    (CNC, 0x40): _spindle_meter,
    (CNC, 0x45): _date_or_time,
    (CNC, 0x56): _servo_load,
    (CNC, 0x89): _axis_names,
    (CNC, 0x8A): _spindle_names,
    (CNC, 0x8D): _parameter,
    (CNC, 0x96): _g_code,
    (CNC, 0x98): _mode_word,
    (CNC, 0xA4): _axis_count,
    (CNC, 0xB9): _program_path,
    (CNC, 0xCF): _executing_program,
    (CNC, 0xE1): _mode_word,
    (CNC, 0xFC): _program_path,
    (PMC, 0x8001): _pmc_range,
}
