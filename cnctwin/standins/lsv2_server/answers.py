"""The simulated control's answer to one telegram. No I/O.

The telegrams are those that the package pyLSV2 and its `docs/protocol.rst` know. Two generations are shown: the iTNC 530 tells
the tool in the spindle and its error messages (R_RI 51, 27, 28), the TNC 640 does not. Nothing can be written: each telegram that
would is refused and counted. The iTNC 530 also has an oscilloscope where it is given the signals of some axes.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from importlib.resources import files

from cnctwin.standins.lsv2_server import plc_memory
from cnctwin.standins.lsv2_server.oscilloscope import Selection, ServoTrace, Sweep, details, selection, signal_descriptions
from cnctwin.standins.lsv2_server.telegram import HEADER_BYTES, Telegram, encode
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import AXES, ControlState

PROGRAM_FOLDER = "TNC:\\nc_prog\\"
BLOCK_BYTES = {3: 1024, 4: 512, 5: 2048, 6: 3072, 7: 4096}


class Model(StrEnum):
    """The control that is shown."""

    ITNC530 = "iTNC530"
    TNC640 = "TNC640"


TOOL_TABLES = {Model.ITNC530: "TNC:\\TOOL.T", Model.TNC640: "TNC:\\table\\tool.t"}


class Code(IntEnum):
    """Codes of T_ER."""

    BAD_FORMAT = 20
    UNKNOWN_TELEGRAM = 22
    NO_PRIVILEGE = 23
    WRONG_PARAMETER = 24
    NO_FILE = 32
    NO_LOGIN = 49
    BAD_MEMORY_ADDRESS = 52
    NO_NEXT_ERROR = 57
    OSCILLOSCOPE_CHANNELS = 83
    NO_WRITE_ACCESS = 59
    OSCILLOSCOPE_OVERRUN = 112


@dataclass
class Session:
    """One client: what it logged in to, how long its telegrams may be, and what it is reading: a file, a list, a recording.

    due_s: machine's time before which the answer does not leave
    """

    logins: set[str] = field(default_factory=set)
    block_bytes: int = 256
    unread: list[bytes] = field(default_factory=list)
    next_error: int = 0
    unread_word: str = "S_FL"
    selected: Selection | None = None
    sweep: Sweep | None = None
    due_s: float = 0.0


@dataclass
class Counters:
    """Telegrams that came, and among them those that would have written something."""

    telegrams: int = 0
    writes_refused: int = 0


_VERSIONS = {
    Model.ITNC530: ("iTNC530", "340490 06 SP3", "800A_AA.PLC", "%0000111100000000"),
    Model.TNC640: ("TNC640", "340590 08 SP7", "17-M008-V01SP11", "%0000000011000010"),
}
_LOGINS = frozenset({"INSPECT", "DIAGNOSTICS", "PLCDEBUG", "FILE", "MONITOR", "DNC", "DATA"})
_NEEDED = {"R_VR": "INSPECT", "R_PR": "INSPECT", "R_CI": "INSPECT", "R_RI": "DNC", "R_MB": "PLCDEBUG"}
_NEEDED |= {"R_OC": "OSZI", "R_OP": "OSZI", "R_OD": "OSZI"}
_NEEDED |= {"R_DP": "DATA"}
_NEEDED |= {"R_FI": "FILE", "R_FL": "FILE", "R_DT": "DIAGNOSTICS"}
_PROGRAM_STATES = {"ACTIVE": 0, "FEED_HOLD": 1, "OPTIONAL_STOP": 1, "PROGRAM_STOPPED": 1, "WAIT": 1, "PROGRAM_COMPLETED": 2}
_PROGRAM_STATES |= {"STOPPED": 3, "INTERRUPTED": 4, "READY": 7}
_MODES = {"MANUAL": 0, "MANUAL_DATA_INPUT": 1, "SEMI_AUTOMATIC": 3, "AUTOMATIC": 4}


def error(code: int) -> bytes:
    """T_ER with this code."""
    return encode("T_ER", bytes([1, code]))


class Answers:
    """A simulated control as this model.

    plc_password: of its log-in PLCDEBUG; None: any is right
    has_dnc: False where the option is missing without which nobody may log in as DNC; trace: signals of the axes, for the
    oscilloscope; scope_password: of its log-in OSZI; packets_lost: numbers of packets that never leave
    """

    def __init__(
        self,
        control: SimulatedControl,
        model: Model = Model.TNC640,
        *,
        has_dnc: bool = True,
        plc_password: str | None = None,
        trace: ServoTrace | None = None,
        scope_password: str = "",
    ) -> None:
        self.trace, self.scope_password = trace, scope_password
        self.packets_lost: frozenset[int] = frozenset()
        self.control, self.model, self.has_dnc, self.plc_password = control, model, has_dnc, plc_password
        self.counters = Counters()
        self.tool_table = files(__package__).joinpath("tool.t").read_text(encoding="ascii")
        self.program_text = files(__package__).joinpath("base_plate.h").read_text(encoding="ascii")
        self.saved_s = 1_767_225_600  # when the program was saved last, seconds since 1970
        self._tells: dict[str, Callable[[Session, bytes], bytes]] = {
            "A_LG": self._log_in,
            "A_LO": self._log_out,
            "C_CC": self._command,
            "R_VR": self._version,
            "R_PR": lambda _session, _payload: encode("S_PR", plc_memory.system_parameters()),
            "R_CI": self._system,
            "R_RI": self._run_info,
            "R_MB": self._memory,
            "R_DP": self._data_path,
            "R_FI": self._file_info,
            "R_FL": self._file,
            "R_DT": lambda _session, _payload: encode("S_DT", struct.pack("!L", int(control.calendar_s()))),
            "T_OK": self._next_part,
        }
        if trace is not None and model is Model.ITNC530:
            self._tells |= {"R_OC": self._scope_signals, "R_OP": self._scope_selection, "R_OD": self._scope_values}

    def answer(self, session: Session, telegram: Telegram) -> bytes:
        """The answer, as bytes."""
        self.counters.telegrams += 1
        command, payload = telegram
        tell = self._tells.get(command)
        if tell is None:
            writes = command.startswith("C_") or command in ("S_FL", "T_FD")
            self.counters.writes_refused += writes
            return error(Code.NO_WRITE_ACCESS if writes else Code.UNKNOWN_TELEGRAM)
        needed = _NEEDED.get(command)
        if needed is not None and needed not in session.logins:
            return error(Code.NO_PRIVILEGE)
        try:
            return tell(session, payload)
        except (struct.error, UnicodeDecodeError, IndexError):
            return error(Code.BAD_FORMAT)

    def _log_in(self, session: Session, payload: bytes) -> bytes:
        name, _, password = payload.rstrip(b"\x00").decode("latin-1").partition("\x00")
        if name == "OSZI" and self.trace is not None and self.model is Model.ITNC530 and password == self.scope_password:
            session.logins.add(name)
            return encode("T_OK")
        if name not in _LOGINS or (name == "DNC" and not self.has_dnc):
            return error(Code.NO_LOGIN)
        if name == "PLCDEBUG" and self.plc_password not in (None, password):
            return error(Code.NO_LOGIN)
        session.logins.add(name)
        return encode("T_OK")

    @staticmethod
    def _log_out(session: Session, payload: bytes) -> bytes:
        name = payload.rstrip(b"\x00").decode("latin-1")
        session.logins = session.logins - {name} if name else set()
        return encode("T_OK")

    def _command(self, session: Session, payload: bytes) -> bytes:
        (number,) = struct.unpack_from("!H", payload)
        if number in BLOCK_BYTES:
            session.block_bytes = BLOCK_BYTES[number]
        elif number != 19:  # how the end of a file that is sent is acknowledged: a setting of the session
            self.counters.writes_refused += 1
            return error(Code.NO_WRITE_ACCESS)
        return encode("T_OK")

    def _version(self, _session: Session, payload: bytes) -> bytes:
        versions = _VERSIONS[self.model]
        if not payload:
            return encode("S_VR", b"".join(text.encode() + b"\x00" for text in versions))
        more = {5: "12345678", 6: "R", 7: "-"}
        if self.model is Model.ITNC530:
            del more[6]
        texts = dict(enumerate(versions, 1)) | more
        text = texts.get(payload[0])
        return error(Code.WRONG_PARAMETER) if text is None else encode("S_VR", text.encode() + b"\x00")

    @staticmethod
    def _system(_session: Session, payload: bytes) -> bytes:
        (number,) = struct.unpack("!L", payload)
        told = {1: (1, 0), 2: (1, 1), 3: (2, 3000)}.get(number)
        return error(Code.WRONG_PARAMETER) if told is None else encode("S_CI", struct.pack("!2L", *told))

    def _run_info(self, session: Session, payload: bytes) -> bytes:
        (number,) = struct.unpack("!H", payload)
        state = self.control.now()
        if number == 22:
            return encode("S_RI", _axes(state))
        if number == 23:
            return encode("S_RI", struct.pack("!H", _MODES.get(state.mode, 5)))
        if number == 24:
            path = f"{PROGRAM_FOLDER}{state.program}.H".encode("latin-1", "replace") + b"\x00"
            return encode("S_RI", struct.pack("!L", state.line) + path * 2)
        if number == 25:
            overrides = (state.feed_override_pct, state.spindle_override_pct, state.rapid_override_pct)
            return encode("S_RI", struct.pack("!3L", *(round(percent * 100) for percent in overrides)))
        if number == 26:
            return encode("S_RI", struct.pack("!H", _PROGRAM_STATES.get(state.exec_state, 8)))
        if number in (27, 28, 51) and self.model is Model.ITNC530:
            return encode("S_RI", _tool(state)) if number == 51 else self._error_message(session, state, number == 27)
        return error(Code.WRONG_PARAMETER)

    @staticmethod
    def _error_message(session: Session, state: ControlState, is_first: bool) -> bytes:
        session.next_error = 0 if is_first else session.next_error + 1
        if state.alarm is None or session.next_error:
            return error(Code.NO_NEXT_ERROR)
        number, text = state.alarm
        return encode("S_RI", struct.pack("!HHl", 1, 2, number) + text.encode("latin-1", "replace") + b"\x00")

    def _memory(self, _session: Session, payload: bytes) -> bytes:
        found = plc_memory.read(self.control.now(), *struct.unpack("!LB", payload))
        return error(Code.BAD_MEMORY_ADDRESS) if found is None else encode("S_MB", found)

    def _data_path(self, _session: Session, payload: bytes) -> bytes:
        """One value of the tool table, as a double (5): four zero bytes and the path come, type and value go."""
        if self.model is not Model.ITNC530:
            return error(Code.UNKNOWN_TELEGRAM)
        parts = payload[4:].rstrip(b"\x00").decode("latin-1").upper().split("\\")
        lines = self.tool_table.splitlines()
        if len(parts) != 6 or parts[1:4] != ["TABLE", "TOOL", "T"] or parts[5] not in ("L", "R"):
            return error(Code.WRONG_PARAMETER)
        row = next((line for line in lines[2:] if line.split()[0] == parts[4]), None)
        at = lines[1].index(f" {parts[5]} ")
        return (
            error(Code.WRONG_PARAMETER)
            if row is None
            else encode("S_DP", struct.pack("!L", 5) + struct.pack("<d", float(row[at : at + 12])))
        )

    def _file_at(self, path: bytes) -> str | None:
        """The text of a file: the program that is selected, and the table of the tools."""
        name = path.decode("latin-1").upper()
        if name == f"{PROGRAM_FOLDER}{self.control.now().program}.H".upper():
            return self.program_text
        return self.tool_table if name == TOOL_TABLES[self.model].upper() else None

    def _file_info(self, _session: Session, payload: bytes) -> bytes:
        path = payload.rstrip(b"\x00")
        content = self._file_at(path)
        if content is None:
            return error(Code.NO_FILE)
        return encode("S_FI", struct.pack("!3L", len(content), self.saved_s, 0x02) + path + b"\x00")

    def _file(self, session: Session, payload: bytes) -> bytes:
        path, _, mode = payload.partition(b"\x00")
        found = self._file_at(path)
        if found is None:
            return error(Code.NO_FILE)
        text = found.encode("utf-8")
        content = text if mode == b"\x01" else text.replace(b"\n", b"\x00")
        size = session.block_bytes - HEADER_BYTES - 2
        session.unread = [content[at : at + size] for at in range(0, len(content), size)]
        session.unread_word, session.sweep = "S_FL", None
        return self._next_part(session, b"")

    def _next_part(self, session: Session, _payload: bytes) -> bytes:
        if session.sweep is not None:
            return self._packet(session, session.sweep)
        return encode(session.unread_word, session.unread.pop(0)) if session.unread else encode("T_FD")

    def _scope_signals(self, session: Session, _payload: bytes) -> bytes:
        session.unread, session.unread_word, session.sweep = signal_descriptions(), "S_OC", None
        return self._next_part(session, b"")

    @staticmethod
    def _scope_selection(session: Session, payload: bytes) -> bytes:
        session.sweep, session.selected = None, selection(payload)
        return error(Code.OSCILLOSCOPE_CHANNELS) if session.selected is None else encode("S_OP", details(session.selected))

    def _scope_values(self, session: Session, _payload: bytes) -> bytes:
        if session.selected is None:
            return error(Code.OSCILLOSCOPE_CHANNELS)
        session.sweep = Sweep(session.selected, self.control.machine_s())
        return self._packet(session, session.sweep)

    def _packet(self, session: Session, sweep: Sweep) -> bytes:
        assert self.trace is not None, "signals cannot be selected without a trace"
        if sweep.is_overrun(self.control.machine_s()):
            session.sweep = None
            return encode("T_BD", bytes([1, Code.OSCILLOSCOPE_OVERRUN]))
        while sweep.packet in self.packets_lost:
            sweep.packet += 1
        session.due_s = sweep.due_s()
        return encode("S_OD", sweep.take(self.trace))


def _axes(state: ControlState) -> bytes:
    figures = b"".join(f"{position:.4f}".encode() + b"\x00" for position in state.axis_pos_mm)
    return bytes([0, len(state.axis_pos_mm)]) + figures + b"".join(axis.upper().encode() + b"\x00" for axis in AXES)


def _tool(state: ControlState) -> bytes:
    """Tool number, index, axis (2 = Z), then length and radius as little-endian doubles."""
    return struct.pack("!LHH", state.tool_number, 0, 2) + struct.pack("<dd", 100.0, 6.0)
