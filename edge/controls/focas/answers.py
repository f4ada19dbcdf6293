"""The commands of the Ethernet protocol that a call needs, and what their answers hold. No I/O.

Several calls have no command that is known with confidence: cnc_modal, cnc_toolnum, tool life and alarm history. The modal M, S,
T, F, H and D are read from the system variables that FANUC's manuals define for them (#4113, #4119, #4120, #4109, #4111, #4107),
whose reading is known from captures; the others are answered here with EW_FUNC, so the tool number comes from the T code.
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from edge.alarm_list import ListedAlarm
from edge.controls.focas import wire
from edge.controls.focas.calls import (
    CLOCK_WORDS,
    OFFSET_KINDS,
    STATUS_WORDS,
    Answer,
    Call,
    FocasValue,
    Identity,
    Request,
    alarm_code,
    alarm_values,
)
from edge.controls.focas.pmc import AREAS, pmc_address
from edge.controls.focas.policy import DATA, FUNC, NUMBER, OK, told
from edge.controls.focas.wire import PMC, Block, Reply
from edge.errors import DocumentError

BLOCK_CHARS = 256
ALARMS_MAX = 10
ALARM_CHARS = 64
OFFSET_BASE = 1000  # what the library adds to the kind of an offset on its way to the control
PROGRAMS_LISTED = 19  # at once, as the library asks: it fills a frame
PROGRAM_RECORD = struct.Struct(">II64s")
_WITH_COMMENT = 2
_MODAL_FIRST, _MODAL_LAST = 4107, 4120
_MODAL_NUMBERS = {"M": 4113, "S": 4119, "T": 4120, "F": 4109, "H": 4111, "D": 4107}
IDENTITY_BLOCKS = (Block(0x18), Block(0xA4, (2,)), Block(0x89))


class Exchange(NamedTuple):
    """The blocks of one call, how long their answers are at the most, and how they are read."""

    blocks: tuple[Block, ...]
    answer_bytes: int
    read: Callable[[Sequence[Reply], Identity], tuple[FocasValue, ...]]


def identity(found: Sequence[Reply]) -> Identity:
    """The identity of the control, from its answers to `IDENTITY_BLOCKS`."""
    system, count, axis_names = found
    if system.status != OK or len(system.data) < 18:
        raise DocumentError(f"no system information: {told(system.status)}")
    cnc_type, mt_type, series, version, axes = struct.unpack(">4x2s2s4s4s2s", system.data[:18])
    if count.status == OK and len(count.data) >= 2:
        controlled = int.from_bytes(count.data[:2], "big")
    else:
        controlled = int(wire.text(axes)) if wire.text(axes).isdigit() else 0
    named = tuple(wire.names(axis_names.data, controlled)) if axis_names.status == OK else ()
    unique = tuple(name if name and named.count(name) == 1 else f"{name}{at}" for at, name in enumerate(named, 1))
    return Identity(wire.text(cnc_type), wire.text(mt_type), wire.text(series), wire.text(version), unique)


def exchange(request: Request, path: int = 1) -> Exchange | None:
    """Return how this call is put; None where the protocol has no known command for it."""
    match request.call:
        case Call.STATUS:
            return Exchange((Block(0x19),), 32, _status)
        case Call.DYNAMIC:
            blocks = (Block(0x1C), Block(0x1D), Block(0x24), Block(0x25), Block(0x26, (1, -1)))
            return Exchange(blocks, 390, _dynamic)
        case Call.SERVO_LOAD:
            return Exchange((Block(0x56, (1,)),), 272, _servo_load)
        case Call.SPINDLE_LOAD:
            return Exchange((Block(0x40, (4, -1)),), 80, _spindle_load)
        case Call.BLOCK:
            return Exchange((Block(0x20, (BLOCK_CHARS,)),), BLOCK_CHARS + 24, _block)
        case Call.MODAL:
            return Exchange((Block(0x15, (_MODAL_FIRST, _MODAL_LAST)),), 128, _modal)
        case Call.PMC:
            return _pmc(request.argument)
        case Call.PROGRAM:
            return Exchange((Block(0xFC), Block(0xCF)), 330, _program)
        case Call.ALARMS:
            return Exchange((Block(0x23, (-1, ALARMS_MAX, 2, ALARM_CHARS)),), 820, _alarms)
        case Call.G_CODE:
            return Exchange((Block(0x96, (int(request.argument), 0)),), 28, _g_code(request.argument))
        case Call.OFFSET:
            kind, _, number = request.argument.partition(" ")
            block = Block(0x08, (int(number), int(number), OFFSET_BASE + OFFSET_KINDS[kind]))
            return Exchange((block,), 24, _one_figure(f"offset.{kind}"))
        case Call.MACRO:
            number = request.argument
            return Exchange((Block(0x15, (int(number), int(number))),), 24, _one_figure(f"macro.{number}"))
        case Call.MESSAGE:
            return Exchange((Block(0x34),), 300, _message)
        case Call.COMMENT:
            asked = (int(request.argument), PROGRAMS_LISTED, _WITH_COMMENT)
            return Exchange((Block(0x06, asked),), 16 + PROGRAMS_LISTED * PROGRAM_RECORD.size, _comment(int(request.argument)))
        case Call.CLOCK:
            return Exchange((Block(0x45, (0,)), Block(0x45, (1,))), 60, _clock)
    return None


def answer(request: Request, plan: Exchange, found: Sequence[Reply], who: Identity) -> Answer:
    """The facts of one call. Data that cannot be read is EW_DATA, for this call only."""
    if all(reply.status != OK for reply in found):
        return Answer(found[0].status)
    try:
        return Answer(OK, plan.read(found, who))
    except (DocumentError, struct.error):
        return Answer(DATA)


def unknown() -> Answer:
    """The answer to a call that the protocol has no known command for."""
    return Answer(FUNC)


def _whole(key: str, reply: Reply) -> FocasValue:
    if reply.status != OK:
        return FocasValue(key, None, reply.status)
    if len(reply.data) < 4:
        return FocasValue(key, None, DATA)
    return FocasValue(key, int.from_bytes(reply.data[:4], "big", signed=True))


def _row(keys: Sequence[str], reply: Reply) -> tuple[FocasValue, ...]:
    if reply.status != OK:
        return tuple(FocasValue(key, None, reply.status) for key in keys)
    return tuple(_figure(key, reply.data[at * 8 : at * 8 + 8]) for at, key in enumerate(keys))


def _figure(key: str, data: bytes) -> FocasValue:
    try:
        figure = wire.value(data)
    except DocumentError:
        return FocasValue(key, None, DATA)
    return FocasValue(key, figure, OK if figure is not None else DATA)


def _status(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    words = struct.unpack(">7h", found[0].data[:14])
    return tuple(FocasValue(f"status.{name}", word) for name, word in zip(STATUS_WORDS, words, strict=True))


def _dynamic(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    programs, sequence, feed, spindle, positions = found
    main = Reply(programs.status, programs.data[4:8])
    return (
        _whole("program.number", programs),
        _whole("program.main", main),
        _whole("sequence", sequence),
        *_row(("feed",), feed),
        *_row(("spindle_rpm",), spindle),
        *_row([f"position.{axis}" for axis in who.axes], positions),
    )


def _servo_load(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    return _row([f"servo_load.{axis}" for axis in who.axes], found[0])


def _spindle_load(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    return _row(("spindle_load",), found[0])


def _block(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    if len(found[0].data) < 4:
        raise DocumentError("no block")
    return (FocasValue("block", wire.text(found[0].data[4:])),)


def _modal(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    row = wire.values(found[0].data, _MODAL_LAST - _MODAL_FIRST + 1)
    figures = ((word, row[number - _MODAL_FIRST]) for word, number in _MODAL_NUMBERS.items())
    return tuple(FocasValue(f"modal.{word}", figure) for word, figure in figures)  # None: none commanded since the control is on


def _pmc(address: str) -> Exchange:
    area, byte, _, width, is_signed = pmc_address(address)

    def read(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
        data = found[0].data
        if len(data) != width:
            raise DocumentError(f"{len(data)} bytes of the PMC in place of {width}")
        return (FocasValue(f"pmc.{address}", int.from_bytes(data, "little", signed=is_signed)),)

    return Exchange((Block(0x8001, (byte, byte + width - 1, AREAS[area], 0), PMC),), 16 + width, read)


def _program(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    """The full name, or that of older controls."""
    full, short = found
    if full.status == OK:
        return (FocasValue("program.name", wire.text(full.data)),)
    return (FocasValue("program.name", wire.text(short.data[4:])),)


def _alarms(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    data, alarms = found[0].data, list[ListedAlarm]()
    record = 16 + ALARM_CHARS
    for at in range(0, len(data) - record + 1, record):
        number, kind, _, length = struct.unpack_from(">4i", data, at)
        message = wire.text(data[at + 16 : at + 16 + max(0, min(length, ALARM_CHARS))])
        alarms.append(ListedAlarm(alarm_code(kind, number), message, active=True))
    return alarm_values(alarms)


def _message(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    """Number, type, length and text, like an alarm but for its axis; no data, or the number -1, is no message."""
    data = found[0].data
    number, _, length = struct.unpack_from(">3i", data) if data else (-1, 0, 0)
    return (FocasValue("operator_message", "" if number == -1 else wire.text(data[12 : 12 + max(0, length)])),)


def _comment(number: int) -> Callable[[Sequence[Reply], Identity], tuple[FocasValue, ...]]:
    """The list of programs begins with the one asked for, or with the next that there is."""

    def read(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
        listed, _, comment = PROGRAM_RECORD.unpack_from(found[0].data)
        if listed != number:
            return (FocasValue("program.comment", None, NUMBER),)
        return (FocasValue("program.comment", wire.text(comment)),)

    return read


def _g_code(group: str) -> Callable[[Sequence[Reply], Identity], tuple[FocasValue, ...]]:
    def read(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
        code, tenths = struct.unpack_from(">6xHxxH", found[0].data)
        return (FocasValue(f"modal.G{group}", f"G{code / 10:g}" if tenths else f"G{code}"),)

    return read


def _one_figure(key: str) -> Callable[[Sequence[Reply], Identity], tuple[FocasValue, ...]]:
    """One value of 8 bytes; the control's mark of "no value" is a null without a code."""

    def read(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
        return (FocasValue(key, wire.value(found[0].data[:8])),)

    return read


def _clock(found: Sequence[Reply], who: Identity) -> tuple[FocasValue, ...]:
    if any(reply.status != OK for reply in found):
        raise DocumentError("half a clock")
    date, time = found
    figures = (*struct.unpack(">3H", date.data[:6]), *struct.unpack(">3H", time.data[-6:]))
    return tuple(FocasValue(f"clock.{word}", figure) for word, figure in zip(CLOCK_WORDS, figures, strict=True))
