"""The user's own FOCAS library by ctypes. Runs in a process of its own (`library_process`), because it may crash or hang.

Only functions in `READS` are ever called: none of them writes to the control. (cnc_setpath chooses which path the handle reads.)
"""

import ctypes
import os
from collections.abc import Callable
from ctypes import byref, c_char, c_int16, c_int32, c_long, c_uint16, sizeof
from typing import Any

from edge.alarm_list import ListedAlarm, alarms_text
from edge.controls.focas import structures as st
from edge.controls.focas.answers import ALARMS_MAX, BLOCK_CHARS
from edge.controls.focas.calls import (
    CLOCK_WORDS,
    LIFE_WORDS,
    MODAL_WORDS,
    OFFSET_KINDS,
    STATUS_WORDS,
    Answer,
    Call,
    FocasValue,
    Identity,
    Request,
    alarm_code,
    alarm_values,
    keys_of,
)
from edge.controls.focas.pmc import AREAS, pmc_address
from edge.controls.focas.policy import FUNC, NUMBER, OK, Policy, policy_of

READS = frozenset(
    {
        "cnc_startupprocess",
        "cnc_exitprocess",
        "cnc_allclibhndl3",
        "cnc_freelibhndl",
        "cnc_setpath",
        "cnc_sysinfo",
        "cnc_statinfo",
        "cnc_rdaxisname",
        "cnc_getfigure",
        "cnc_rddynamic2",
        "cnc_rdspeed",
        "cnc_acts",
        "cnc_acts2",
        "cnc_rdsvmeter",
        "cnc_rdspmeter",
        "cnc_rdexecprog",
        "cnc_exeprgname",
        "cnc_modal",
        "cnc_rdgcode",
        "cnc_toolnum",
        "cnc_rdtofs",
        "cnc_rdmacro",
        "cnc_rdopmsg",
        "cnc_rdprogdir3",
        "cnc_rdusegrpid",
        "cnc_rdlife",
        "cnc_rdcount",
        "cnc_rdalmhisno",
        "cnc_rdalmhistry",
        "cnc_rdalmmsg2",
        "cnc_gettimer",
        "pmc_rdpmcrng",
    }
)
HISTORY_AT_ONCE = 10  # entries of the alarm history in one call
HISTORY_HEAD_BYTES = 6
MACRO_BYTES = 10
POSITION_FIGURES = 0
DECIMALS_USUAL = 3


class Fwlib:
    """One handle of the library."""

    def __init__(self, path: str) -> None:
        self._library = ctypes.CDLL(path)
        self._handle = c_uint16(0)
        self._is_open = False
        self._has_process = False
        self._decimals: tuple[int, ...] = ()
        self.identity = Identity()
        self._readers: dict[Call, Callable[[Request], tuple[FocasValue, ...] | int]] = {
            Call.STATUS: self._status,
            Call.DYNAMIC: self._dynamic,
            Call.SERVO_LOAD: self._servo_load,
            Call.SPINDLE_LOAD: self._spindle_load,
            Call.BLOCK: self._block,
            Call.MODAL: self._modal,
            Call.TOOL: self._tool,
            Call.PMC: self._pmc,
            Call.PROGRAM: self._program,
            Call.ALARMS: self._alarms,
            Call.G_CODE: self._g_code,
            Call.OFFSET: self._offset,
            Call.CLOCK: self._clock,
            Call.MESSAGE: self._message,
            Call.MACRO: self._macro,
            Call.COMMENT: self._comment,
            Call.LIFE: self._life,
            Call.HISTORY: self._history,
        }

    def open(self, host: str, port: int, timeout_s: int, path: int) -> int:
        """A handle, and who is there."""
        self.close()
        if not self._has_process:
            self._invoke("cnc_startupprocess", 0, os.devnull.encode())  # Linux only; elsewhere it is not there
            self._has_process = True
        code = self._invoke("cnc_allclibhndl3", host.encode(), c_uint16(port), c_long(timeout_s), byref(self._handle))
        if code != OK:
            return code
        self._is_open = True
        if path != 1:
            code = self._call("cnc_setpath", c_int16(path))
        return code or self._identify()

    def close(self) -> None:
        """Free the handle."""
        if self._is_open:
            self._is_open = False
            self._call("cnc_freelibhndl")

    def call(self, request: Request) -> Answer:
        """One call, one answer."""
        found = self._readers[request.call](request)
        return Answer(found) if isinstance(found, int) else Answer(OK, found)

    def _invoke(self, name: str, *arguments: Any) -> int:
        """A function of the library, by name; EW_FUNC where this library does not have it."""
        assert name in READS, name
        function = getattr(self._library, name, None)
        if function is None:
            return FUNC
        function.restype = c_int16
        return int(function(*arguments))

    def _call(self, name: str, *arguments: Any) -> int:
        return self._invoke(name, self._handle, *arguments)

    def _identify(self) -> int:
        system = st.OdbSys()
        code = self._call("cnc_sysinfo", byref(system))
        if code != OK:
            return code
        count, axes = c_int16(st.MAX_AXIS), (st.AxisName * st.MAX_AXIS)()
        code = self._call("cnc_rdaxisname", byref(count), axes)
        if policy_of(code) is Policy.RECONNECT:
            return code
        named = [_word(one.name + one.suff.strip(b"\0 ")) for one in axes[: max(0, count.value)]] if code == OK else []
        unique = (name if name and named.count(name) == 1 else f"{name}{at}" for at, name in enumerate(named, 1))
        cnc_type, mt_type, series, version = map(_word, (system.cnc_type, system.mt_type, system.series, system.version))
        self.identity = Identity(cnc_type, mt_type, series, version, tuple(unique))
        valid, inputs, outputs = c_int16(0), (c_int16 * st.MAX_AXIS)(), (c_int16 * st.MAX_AXIS)()
        code = self._call("cnc_getfigure", c_int16(POSITION_FIGURES), byref(valid), inputs, outputs)
        known = [int(outputs[at]) for at in range(len(named))] if code == OK else []
        self._decimals = tuple(figures if 0 <= figures <= 9 else DECIMALS_USUAL for figures in known)
        return code if policy_of(code) is Policy.RECONNECT else OK

    def _status(self, request: Request) -> tuple[FocasValue, ...] | int:
        status = st.OdbSt()
        code = self._call("cnc_statinfo", byref(status))
        return code or tuple(FocasValue(f"status.{word}", getattr(status, word)) for word in STATUS_WORDS)

    def _dynamic(self, request: Request) -> tuple[FocasValue, ...] | int:
        """Machine positions axis by axis; programs and speeds come with the first."""
        axes = self.identity.axes
        found, positions = list[FocasValue](), list[FocasValue]()
        for number, axis in enumerate(axes or ("",), 1):
            dynamic = st.OdbDy2()
            code = self._call("cnc_rddynamic2", c_int16(number), c_int16(sizeof(dynamic)), byref(dynamic))
            if code != OK and (number == 1 or policy_of(code) is Policy.RECONNECT):
                return code
            if number == 1:
                found += [
                    FocasValue("program.number", dynamic.prgnum),
                    FocasValue("program.main", dynamic.prgmnum),
                    FocasValue("sequence", dynamic.seqnum),
                    *self._speeds(dynamic),
                ]
            decimals = self._decimals[number - 1] if number <= len(self._decimals) else DECIMALS_USUAL
            value = _scaled(dynamic.machine, decimals) if code == OK else None
            positions += [FocasValue(f"position.{axis}", value, code)] if axis else []
        return (*found, *positions)

    def _speeds(self, dynamic: st.OdbDy2) -> tuple[FocasValue, FocasValue]:
        """Feed and speed with their decimals, which rddynamic2 leaves out; where rdspeed is missing, those whole figures."""
        speed = st.OdbSpeed()
        code = self._call("cnc_rdspeed", c_int16(-1), byref(speed))
        if code != OK:
            return FocasValue("feed", dynamic.actf), FocasValue("spindle_rpm", self._spindle_rpm(dynamic.acts))
        return (
            FocasValue("feed", _scaled(speed.actf.data, speed.actf.dec)),
            FocasValue("spindle_rpm", _scaled(speed.acts.data, speed.acts.dec)),
        )

    def _spindle_rpm(self, rough: int) -> int:
        several, one = st.OdbAct2(), st.OdbAct()
        if self._call("cnc_acts2", c_int16(1), byref(several)) == OK:
            return int(several.data[0])
        return int(one.data) if self._call("cnc_acts", byref(one)) == OK else rough

    def _servo_load(self, request: Request) -> tuple[FocasValue, ...] | int:
        count, loads = c_int16(st.MAX_AXIS), (st.LoadElm * st.MAX_AXIS)()
        code = self._call("cnc_rdsvmeter", byref(count), loads)
        pairs = zip(keys_of(request, self.identity.axes), loads[: max(0, count.value)], strict=False)
        return code or tuple(FocasValue(key, _scaled(load.data, load.dec)) for key, load in pairs)

    def _spindle_load(self, request: Request) -> tuple[FocasValue, ...] | int:
        count, loads = c_int16(1), (st.OdbSpLoad * 8)()
        code = self._call("cnc_rdspmeter", c_int16(-1), byref(count), loads)
        return code or (FocasValue("spindle_load", _scaled(loads[0].spload.data, loads[0].spload.dec)),)

    def _block(self, request: Request) -> tuple[FocasValue, ...] | int:
        length, block, text = c_uint16(BLOCK_CHARS), c_int16(0), (c_char * (BLOCK_CHARS + 1))()
        code = self._call("cnc_rdexecprog", byref(length), byref(block), text)
        return code or (FocasValue("block", _word(text.raw[: min(length.value, BLOCK_CHARS)])),)

    def _modal(self, request: Request) -> tuple[FocasValue, ...] | int:
        found = list[FocasValue]()
        for word, number in MODAL_WORDS.items():
            modal = st.OdbMdl()
            code = self._call("cnc_modal", c_int16(number), c_int16(0), byref(modal))
            if policy_of(code) is Policy.RECONNECT:
                return code
            found.append(FocasValue(f"modal.{word}", int(modal.aux_data) if code == OK else None, code))
        return tuple(found)

    def _tool(self, request: Request) -> tuple[FocasValue, ...] | int:
        tool = st.OdbTLife4()
        code = self._call("cnc_toolnum", c_int16(0), c_int16(0), byref(tool))
        return code or (FocasValue("tool", tool.data),)

    def _pmc(self, request: Request) -> tuple[FocasValue, ...] | int:
        area, byte, _, width, is_signed = pmc_address(request.argument)
        data = st.IodbPmc()
        last = c_uint16(byte + width - 1)
        length = c_uint16(8 + width)
        code = self._call("pmc_rdpmcrng", c_int16(AREAS[area]), c_int16(0), c_uint16(byte), last, length, byref(data))
        raw = bytes(data)[st.IodbPmc.cdata.offset : st.IodbPmc.cdata.offset + width]
        return code or (FocasValue(f"pmc.{request.argument}", int.from_bytes(raw, "little", signed=is_signed)),)

    def _program(self, request: Request) -> tuple[FocasValue, ...] | int:
        program = st.OdbExePrg()
        code = self._call("cnc_exeprgname", byref(program))
        return code or (FocasValue("program.name", _word(program.name)),)

    def _alarms(self, request: Request) -> tuple[FocasValue, ...] | int:
        count, alarms = c_int16(ALARMS_MAX), (st.OdbAlmMsg2 * ALARMS_MAX)()
        code = self._call("cnc_rdalmmsg2", c_int16(-1), byref(count), alarms)
        told = alarms[: max(0, count.value)]
        return code or alarm_values(
            [
                ListedAlarm(alarm_code(one.type, one.alm_no), _word(one.alm_msg[: max(0, one.msg_len)]), active=True)
                for one in told
            ]
        )

    def _g_code(self, request: Request) -> tuple[FocasValue, ...] | int:
        count, codes = c_int16(1), (st.OdbGcd * 4)()
        code = self._call("cnc_rdgcode", c_int16(int(request.argument)), c_int16(0), byref(count), codes)
        return code or (FocasValue(f"modal.G{request.argument}", _word(codes[0].code)),)

    def _offset(self, request: Request) -> tuple[FocasValue, ...] | int:
        offset = st.OdbTOfs()
        kind, _, number = request.argument.partition(" ")
        which = c_int16(int(number)), c_int16(OFFSET_KINDS[kind])
        code = self._call("cnc_rdtofs", *which, c_int16(sizeof(offset)), byref(offset))
        decimals = self._decimals[0] if self._decimals else DECIMALS_USUAL
        return code or (FocasValue(f"offset.{kind}", _scaled(offset.data, decimals)),)

    def _message(self, request: Request) -> tuple[FocasValue, ...] | int:
        message = st.OpMsg()
        code = self._call("cnc_rdopmsg", c_int16(0), c_int16(sizeof(message)), byref(message))
        text = "" if message.datano == -1 else _word(message.data[: max(0, message.char_num)])
        return code or (FocasValue("operator_message", text),)

    def _macro(self, request: Request) -> tuple[FocasValue, ...] | int:
        macro = st.OdbMacro()
        code = self._call("cnc_rdmacro", c_int16(int(request.argument)), c_int16(MACRO_BYTES), byref(macro))
        is_vacant = macro.dec_val == -1
        return code or (FocasValue(f"macro.{request.argument}", None if is_vacant else _scaled(macro.mcr_val, macro.dec_val)),)

    def _comment(self, request: Request) -> tuple[FocasValue, ...] | int:
        first, count, program = c_int32(int(request.argument)), c_int16(1), st.PrgDir3()
        code = self._call("cnc_rdprogdir3", c_int16(1), byref(first), byref(count), byref(program))
        if code != OK:
            return code
        is_there = count.value == 1 and program.number == int(request.argument)
        return (FocasValue("program.comment", _word(program.comment) if is_there else None, OK if is_there else NUMBER),)

    def _life(self, request: Request) -> tuple[FocasValue, ...] | int:
        """Use and life of the tool group in use; nulls where none is."""
        groups, counted, limit = st.OdbUseGr(), st.OdbTLife4(), st.OdbTLife4()
        code = self._call("cnc_rdusegrpid", byref(groups))
        if code != OK:
            return code
        if groups.use <= 0:
            return tuple(FocasValue(f"life.{word}") for word in LIFE_WORDS)
        group = c_int16(groups.use)
        code = self._call("cnc_rdcount", group, byref(counted)) or self._call("cnc_rdlife", group, byref(limit))
        return code or (FocasValue("life.used", int(counted.data)), FocasValue("life.limit", int(limit.data)))

    def _history(self, request: Request) -> tuple[FocasValue, ...] | int:
        """The last entries. The log is not stopped for it, which would be a change: a control that demands it refuses."""
        number, history = c_uint16(0), st.OdbAHis()
        code = self._call("cnc_rdalmhisno", byref(number))
        if code != OK:
            return code
        if number.value == 0:
            return (FocasValue("alarm_history", "[]"),)
        first = max(1, number.value - HISTORY_AT_ONCE + 1)
        length = HISTORY_HEAD_BYTES + sizeof(st.AlmHis) * (number.value - first + 1)
        which = c_uint16(first), c_uint16(number.value), c_uint16(length)
        code = self._call("cnc_rdalmhistry", *which, byref(history))
        entries = history.alm_his[: number.value - first + 1]
        return code or (FocasValue("alarm_history", alarms_text([_logged(one) for one in entries], newest_last=True)),)

    def _clock(self, request: Request) -> tuple[FocasValue, ...] | int:
        words = list[int]()
        for kind in (0, 1):
            timer = st.IodbTimer(type=kind)
            code = self._call("cnc_gettimer", byref(timer))
            if code != OK:
                return code
            words += timer.words
        return tuple(FocasValue(f"clock.{name}", int(word)) for name, word in zip(CLOCK_WORDS, words, strict=True))


def _logged(entry: st.AlmHis) -> ListedAlarm:
    """An entry of the alarm history; when, as the control's calendar shows it, which has no zone."""
    date = f"{2000 + entry.year:04d}-{entry.month:02d}-{entry.day:02d}"
    since = f"{date}T{entry.hour:02d}:{entry.minute:02d}:{entry.second:02d}"
    text = _word(entry.alm_msg[: max(0, entry.len_msg)])
    return ListedAlarm(alarm_code(entry.alm_grp, entry.alm_no), text, active=None, since=since)


def _scaled(data: int, decimals: int) -> float | int:
    return int(data) if decimals <= 0 else int(data) / 10.0 ** min(decimals, 9)


def _word(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", errors="replace").strip()
