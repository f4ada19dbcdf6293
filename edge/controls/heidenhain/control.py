"""One connection to a control: the log-ins that reading needs, and one look at everything that can be had. Thin I/O on pyLSV2.

pyLSV2 is started with safe_mode=False, since its safe mode refuses the log-in DNC and then answers None to nearly everything;
that nothing is written is seen to in `link`, below it. Which log-ins are asked for depends on the configuration: INSPECT and
DNC always, FILE for the program's text and the tool table, PLCDEBUG where there is a PLC address, DATA where there is a data
path, DIAGNOSTICS for the clock.

What a control refuses with a code that says "not known", "not allowed" or "no such address" is not asked for a minute, and is
reported as refused at each look. Other codes concern one look only.
"""

import importlib
import json
import logging
import math
import os
import struct
from collections.abc import Callable
from datetime import datetime
from functools import partial
from types import ModuleType
from typing import Any

from edge.alarm_list import ListedAlarm, alarms_text
from edge.controls.heidenhain.address import address_of
from edge.controls.heidenhain.config import Config, ToolSource, host_and_port
from edge.controls.heidenhain.link import ReadOnlyLink
from edge.controls.heidenhain.plc import PlcAddress
from edge.errors import ConfigError, ConnectionLostError
from edge.sample import ClockReading
from edge.sweep import Fact

NO_PRIVILEGE = 23
ASK_AGAIN_S = 60.0
TEXT_BYTES_MAX = 1_500_000  # as JSON; two texts go into a frame
NOT_SOON = frozenset({20, 22, 23, 24, 31, 32, 40, 49, 50, 52, 59, 63, 67, 72})
NO_NEXT_ERROR = 57
MESSAGES_MAX = 16
ONLY_ITNC = "only the iTNC 530 tells it over LSV2"
ONLY_ITNC_PATHS = "only the iTNC 530 has data paths; name a PLC address"
Read = Callable[[], Any]


def library() -> ModuleType:
    """PyLSV2, or the one line that says how to get it."""
    try:
        return importlib.import_module("pyLSV2")
    except ImportError as error:
        raise ConfigError("the adapter heidenhain needs pyLSV2; install it with: pip install 'cnctwin[heidenhain]'") from error


def logins_of(config: Config) -> tuple[str, ...]:
    """The log-ins that are asked for."""
    source = config.source
    addresses = [address_of(one) for one in config.chosen]
    by_path = [isinstance(address, str) for address in addresses]
    return (
        "INSPECT",
        "DNC",
        *(("FILE",) if source.program_text or source.tool_table else ()),
        *(("PLCDEBUG",) if source.plc or not all(by_path) else ()),
        *(("DATA",) if any(by_path) else ()),
        *(("DIAGNOSTICS",) if source.clock_interval_s else ()),
    )


def plc_password(config: Config) -> str:
    """The password in the environment variable that the configuration names; "" where it names none."""
    name = config.source.plc_password_env
    if name and name not in os.environ:
        raise ConfigError(f"{config.path}: heidenhain.plc_password_env = {name!r}: no such environment variable; set it")
    return os.environ[name] if name else ""


class Control:
    """An open connection. ConnectionLostError from any method means that it is over."""

    def __init__(self, config: Config, *, clock: Callable[[], float], patience_s: float) -> None:
        self._config, self._clock = config, clock
        self._pylsv2 = library()
        self._password = plc_password(config)
        self._logins = logins_of(config)
        host, port = host_and_port(config.source.url)
        self.link = ReadOnlyLink(host, port, logins=self._logins, patience_s=patience_s, clock=clock, pylsv2=self._pylsv2)
        self._lsv2 = self._client(port)
        self._no_login: dict[str, str] = {}
        self._refused: dict[str, tuple[str, float]] = {}  # why, and when it is asked for again
        self._addresses = {name: PlcAddress.parse(text) for name, text in config.source.plc.items()}
        self._chosen = {one.signal: address_of(one) for one in config.chosen}

    def _client(self, port: int) -> Any:
        """PyLSV2 on our link. The socket that it made for itself was never connected."""
        client: Any = self._pylsv2.LSV2("127.0.0.1", port=port, timeout=1.0, safe_mode=False)
        client._llcom.disconnect()
        client._llcom = self.link
        client._logger = logging.Logger("pyLSV2", logging.CRITICAL)  # each fault is reported by us, once, with its reason
        client._known_logins = self._logins
        client._known_sys_cmd = (3, 4, 5, 6, 7)
        return client

    def open(self) -> None:
        """Connect and log in. The log-in DNC is a must; without another, what it is for is refused."""
        self.link.begin(self._config.source.timeout_s)
        try:
            self._lsv2.connect()
        except (OSError, ConnectionLostError):
            raise
        except Exception as error:  # whatever pyLSV2 makes of an answer that it cannot read
            raise ConnectionLostError(f"the control does not introduce itself: {type(error).__name__}: {error}") from error
        for name in self._logins[1:]:
            login = self._pylsv2.const.Login(name)
            if self._lsv2.login(login, self._password if name == "PLCDEBUG" else ""):
                continue
            why = f"the control refuses the log-in {name} ({self._code()})"
            if name == "DNC":
                raise ConnectionLostError(f"{why}: permit external access, and see whether option 18 (HEIDENHAIN DNC) is set")
            self._no_login[name] = why

    def close(self) -> None:
        """Close the connection, from the thread that uses it."""
        self.link.disconnect()

    @property
    def name(self) -> str:
        """Return what the control calls itself, such as iTNC530 340490 06 SP3."""
        versions = self._lsv2.versions
        return f"{versions.control} {versions.nc_sw}".strip()

    @property
    def tells_tool(self) -> bool:
        """Return whether it may tell its tool and its error messages: an iTNC 530, or a control that is not known."""
        return bool(self._lsv2.versions.is_itnc() or self._lsv2.versions.type.name == "UNKNOWN")

    def look(self, *, is_slow: bool = True) -> list[Fact]:
        """Everything that is read at each look; with `is_slow` also what [variables] and [plc] name."""
        state = self._ask("program_state", lambda: int(self._lsv2.program_status()))
        if state[0].fault and self._was_refused() and int(self.link.last_error.e_code) == NO_PRIVILEGE:
            raise ConnectionLostError("the control has taken back the log-in DNC; is external access still permitted?")
        facts = [
            *state,
            *self._ask("execution_mode", lambda: int(self._lsv2.execution_state())),
            *self._stack(),
            *self._overrides(),
            *self._axes(),
        ]
        source = self._config.source.tool_number_from
        wants_tool = source is ToolSource.CONTROL or (source is ToolSource.AUTO and "tool_number" not in self._addresses)
        if wants_tool and self.tells_tool:
            facts += self._tool()
        elif source is ToolSource.CONTROL:
            facts.append(Fact("tool", None, ONLY_ITNC))
        facts += self._messages()
        for name, address in self._addresses.items():
            facts += self._ask(f"plc:{name}", partial(self._plc, address), needs="PLCDEBUG")
        for signal, chosen in self._chosen.items() if is_slow else ():
            facts += self._value_at(f"chosen:{signal}", chosen)
        return facts

    def _value_at(self, key: str, address: PlcAddress | str) -> list[Fact]:
        if isinstance(address, PlcAddress):
            return self._ask(key, partial(self._plc, address), needs="PLCDEBUG")
        if not self.tells_tool:
            return [Fact(key, None, ONLY_ITNC_PATHS)]
        return self._ask(key, lambda: self._lsv2.read_data_path(address), needs="DATA")

    def _tool(self) -> list[Fact]:
        """The tool in the spindle, with its length and radius where the answer has room for them."""
        (told,) = self._ask("tool", self._lsv2.spindle_tool_status)
        tool: Any = told.value
        if tool is None:
            return [told]
        if (tool.length, tool.radius) == (-1, -1):  # what pyLSV2 has before it reads
            return [Fact("tool", int(tool.number))]
        return [
            Fact("tool", int(tool.number)),
            *(self._length(f"tool_{name}", getattr(tool, name)) for name in ("length", "radius")),
        ]

    @staticmethod
    def _length(key: str, value: float) -> Fact:
        return Fact(key, value) if math.isfinite(value) else Fact(key, None, "answers what is no length")

    def _messages(self) -> list[Fact]:
        keys = ("errors", "error_list")
        if not self.tells_tool:
            return [Fact(key, None, ONLY_ITNC) for key in keys]
        (told,) = self._ask("errors", self._errors)
        messages: Any = told.value
        if messages is None:
            return [Fact(key, None, told.fault) for key in keys]
        text = "; ".join(f"{message.code} {message.text}".strip() for message in messages)
        return [Fact("errors", text), Fact("error_list", alarms_text(messages))]

    def tool_table(self, path: str) -> Fact:
        """The text of the tool table, or why it cannot be had."""
        return self._ask(f"table:{path}", lambda: self._text(path), needs="FILE", keep=False)[0]._replace(key="tool_table")

    def clock(self, wall_ms: Callable[[], int]) -> ClockReading | None:
        """The control's date and time in whole seconds, rounded down; None where it does not tell."""
        before_ms = wall_ms()
        told = self._ask("clock", self._lsv2.get_remote_datetime, needs="DIAGNOSTICS")[0]
        after_ms = wall_ms()
        if not isinstance(told.value, int):
            return None
        ahead_ms = round(self._config.source.clock_utc_offset_h * 3_600_000)
        middle_ms = (before_ms + after_ms) // 2
        shown_ms = max(0, told.value * 1000 - ahead_ms)
        return ClockReading(shown_ms, middle_ms, max(0, after_ms - before_ms), 1000, stamps_samples=False)

    def file_stamp(self, path: str) -> str:
        """Size and time of a file as one word, which is another when it was saved again; "" where they are not told."""
        told = self._ask(f"file_info:{path}", lambda: self._file_stamp(path), needs="FILE", keep=False)[0]
        return str(told.value or "")

    def program(self, path: str) -> Fact:
        """The text of a program, or why it cannot be had."""
        return self._ask(f"text:{path}", lambda: self._text(path), needs="FILE", keep=False)[0]

    def _ask(self, key: str, read: Read, *, needs: str = "DNC", keep: bool = True) -> list[Fact]:
        """One fact. What a control refuses as such is not asked soon again; `keep` False: it may be another matter next time."""
        why, until_s = self._refused.get(key, ("", 0.0))
        if needs in self._no_login or self._clock() < until_s:
            return [Fact(key, None, self._no_login.get(needs) or why)]
        try:
            value = read()
        except ConnectionLostError:
            raise
        except Exception as error:  # whatever pyLSV2 makes of content that it cannot read
            if self._was_refused():
                return [Fact(key, None, self._refusal(key, keep))]
            return [Fact(key, None, f"answers what cannot be read: {type(error).__name__}: {str(error)[:80]}")]
        if self._was_refused():
            return [Fact(key, None, self._refusal(key, keep))]
        if value is None:
            return [Fact(key, None, "answers nothing")]
        return [Fact(key, round(value.timestamp()) if isinstance(value, datetime) else value)]

    def _was_refused(self) -> bool:
        refused = self.link.last_response.value in ("T_ER", "T_BD")
        return refused and int(self.link.last_error.e_code) != NO_NEXT_ERROR

    def _refusal(self, key: str, keep: bool) -> str:
        why = f"the control refuses it ({self._code()})"
        if keep and int(self.link.last_error.e_code) in NOT_SOON:
            self._refused[key] = why, self._clock() + ASK_AGAIN_S
        return why

    def _code(self) -> str:
        error = self.link.last_error
        return f"{getattr(error.e_code, 'name', 'T_ER')} {int(error.e_code)}"

    def _stack(self) -> list[Fact]:
        (told,) = self._ask("program", self._lsv2.program_stack)
        if told.value is None:
            return [Fact(key, None, told.fault) for key in ("program", "current_program", "line")]
        stack: Any = told.value
        return [Fact("program", stack.main), Fact("current_program", stack.current), Fact("line", stack.line_no)]

    def _overrides(self) -> list[Fact]:
        keys = ("feed", "spindle", "rapid")
        (told,) = self._ask("override", self._lsv2.override_state)
        return [Fact(f"{key}_override", getattr(told.value, key, None), told.fault) for key in keys]

    def _axes(self) -> list[Fact]:
        (told,) = self._ask("axes", self._lsv2.axes_location)
        axes: Any = told.value
        return [Fact(f"axis:{name}", place) for name, place in axes.items()] if axes else [Fact("axes", None, told.fault)]

    def _errors(self) -> tuple[ListedAlarm, ...]:
        messages = self._lsv2.get_error_messages()[:MESSAGES_MAX]
        return tuple(ListedAlarm(str(message.e_number), str(message.e_text), active=True) for message in messages)

    def _plc(self, address: PlcAddress) -> bool | int | str | None:
        place = address.lies_at(self._lsv2.parameters)
        if place is None:
            raise ValueError(f"this control has no {address}")
        answer = self.link.telegram("R_MB", struct.pack("!LB", *place))
        return None if self._was_refused() else address.value(bytes(answer))

    def _file_stamp(self, path: str) -> str | None:
        answer = self.link.telegram("R_FI", path.encode("latin-1") + b"\x00")
        if len(answer) < 12:
            return None
        return bytes(answer[:8]).hex()

    def _text(self, path: str) -> str | None:
        """Read a file in text mode, in which a zero byte ends each line."""
        bytes_max = self._config.source.program_kib_max * 1024
        info = self.link.telegram("R_FI", path.encode("latin-1") + b"\x00")
        if self._was_refused():
            return None
        size = int.from_bytes(info[:4], "big")
        if size > bytes_max:
            raise ValueError(f"{path} has {size} bytes, which is above heidenhain.program_kib_max")
        content = bytearray()
        part = self.link.telegram("R_FL", path.encode("latin-1") + b"\x00\x00")
        while self.link.last_response.value == "S_FL":
            content += part[: TEXT_BYTES_MAX + 1 - len(content)]  # what is too long is read to its end, and thrown away
            part = self.link.telegram("T_OK")
        if self._was_refused():
            return None
        lines = bytes(content).replace(b"\x00", b"\n")
        try:
            text = lines.decode("utf-8")
        except UnicodeDecodeError:
            text = lines.decode("latin-1")
        if len(json.dumps(text, ensure_ascii=False).encode()) > TEXT_BYTES_MAX:
            raise ValueError(f"{path} is longer than it says, above {TEXT_BYTES_MAX} bytes")
        return text
