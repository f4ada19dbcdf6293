"""The link: no telegram leaves that could write, and nothing that a control answers can hang it or fill the memory."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pyLSV2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production
from edge.config import EdgeConfig
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.control import Control, library
from edge.controls.heidenhain.link import PAYLOAD_BYTES_MAX, READS, ReadOnlyLink, WriteRefusedError
from edge.errors import ConnectionLostError

LOGINS = ("INSPECT", "DNC", "FILE", "PLCDEBUG", "DIAGNOSTICS")
WRITES = {
    "make_directory": ("TNC:\\new",),
    "delete_empty_directory": ("TNC:\\new",),
    "delete_file": ("TNC:\\nc_prog\\O1701.H",),
    "copy_remote_file": ("TNC:\\a.h", "TNC:\\b.h"),
    "move_file": ("TNC:\\a.h", "TNC:\\b.h"),
    "change_directory": ("TNC:\\nc_prog",),
    "send_file": (Path(__file__), "TNC:\\nc_prog\\new.h", True),
    "set_keyboard_access": (False,),
    "set_machine_parameter": ("MP7230.0", "1"),
    "send_key_code": (pyLSV2.KeyCode.MODE_AUTOMATIC,),
    "grab_screen_dump": (Path("screen.bmp"),),
}


@contextmanager
def opened(model: Model = Model.ITNC530) -> Iterator[tuple[Control, Lsv2Server]]:
    """The whole client, with every log-in that a configuration can ask for, on a control that counts what would write."""
    with Lsv2Server(SimulatedControl(production(30)), model=model) as server:
        source = HeidenhainConfig(url=server.url, plc={"tool_number": "W1000"})
        control = Control(EdgeConfig(source=source), clock=time.monotonic, patience_s=2.0)
        try:
            control.open()
            yield control, server
        finally:
            control.close()


@pytest.mark.parametrize("method", WRITES)
@pytest.mark.parametrize("is_let_in", [False, True], ids=["as this edge logs in", "logged in as anybody"])
def test_no_method_of_pylsv2_that_writes_gets_a_telegram_out(method: str, is_let_in: bool) -> None:
    with opened() as (control, server):
        client = control._lsv2
        if is_let_in:  # pyLSV2 believes that it may; the link alone has to hold
            client._known_logins = tuple(pyLSV2.Login)
            client._known_sys_cmd = tuple(pyLSV2.ParCCC)
            client._active_logins = list(pyLSV2.Login)
        before = server.answers.counters.telegrams
        with suppress(pyLSV2.LSV2StateException):
            try:
                assert getattr(client, method)(*WRITES[method]) is False
            except WriteRefusedError as error:
                assert "not sent" in str(error)
        assert server.answers.counters.writes_refused == 0
        assert server.answers.counters.telegrams <= before + 3, "at most it asked whether a file is there"


def test_every_method_of_pylsv2_is_known_to_read_or_to_write() -> None:
    reads = {"connect", "disconnect", "login", "logout", "switch_safe_mode", "program_status", "program_stack", "execution_state"}
    reads |= {"directory_info", "file_info", "directory_content", "drive_info", "recive_file", "read_plc_memory", "get_file_list"}
    reads |= {"read_plc_address", "get_machine_parameter", "spindle_tool_status", "override_state", "get_error_messages"}
    reads |= {"read_data_path", "axes_location", "get_remote_datetime", "read_scope_signals", "real_time_readings"}
    methods = {name for name in vars(pyLSV2.LSV2) if not name.startswith("_") and callable(getattr(pyLSV2.LSV2, name))}
    assert methods - reads - set(WRITES) == set(), "a new version of pyLSV2 has methods that nobody has looked at"


class Silent:
    """A link that would notice if a byte were sent."""

    def __init__(self, logins: tuple[str, ...] = LOGINS) -> None:
        self.near, self.far = socket.socketpair()
        self.link = ReadOnlyLink("", 0, logins=logins, patience_s=0.05, clock=time.monotonic, pylsv2=library())
        self.link._socket = self.near
        self.link.buffer_size = 4096

    def __enter__(self) -> "Silent":
        return self

    def __exit__(self, *_: object) -> None:
        self.near.close()
        self.far.close()

    def sent(self) -> bytes:
        self.far.setblocking(False)
        try:
            return self.far.recv(65536)
        except BlockingIOError:
            return b""


KNOWN = [*pyLSV2.CMD, *pyLSV2.RSP]


@pytest.mark.parametrize("command", [word for word in KNOWN if word.value not in READS], ids=lambda word: word.value)
def test_each_other_telegram_that_is_known_is_refused(command: Any) -> None:
    with Silent() as silent:
        with pytest.raises(WriteRefusedError):
            silent.link.telegram(command, b"TNC:\\x.h\x00")
        assert silent.sent() == b""


@given(command=st.text(max_size=6), payload=st.binary(max_size=40))
def test_any_other_word_is_refused(command: str, payload: bytes) -> None:
    if command not in READS:
        with Silent() as silent:
            with pytest.raises(WriteRefusedError):
                silent.link.telegram(command, payload)
            assert silent.sent() == b""


def test_of_the_settings_only_the_length_of_telegrams_passes() -> None:
    with Silent() as silent:
        for number in set(range(65536)) - {3, 4, 5, 6, 7}:
            with pytest.raises(WriteRefusedError):
                silent.link.telegram("C_CC", struct.pack("!H", number))
        for payload in (b"", b"\x07", b"\x00\x07x", b"\x00\x07\x00\x01"):
            with pytest.raises(WriteRefusedError):
                silent.link.telegram("C_CC", payload)
        assert silent.sent() == b""


@pytest.mark.parametrize("login", ["MONITOR", "FILEPLC", "FILESYS", "OSZI", "DATA", "", "dnc", "DNC2"])
def test_a_log_in_that_this_edge_does_not_need_is_refused(login: str) -> None:
    with Silent() as silent, pytest.raises(WriteRefusedError):
        silent.link.telegram("A_LG", login.encode() + b"\x00")
    with Silent(("INSPECT", "DNC")) as silent, pytest.raises(WriteRefusedError):
        silent.link.telegram("A_LG", b"PLCDEBUG\x00807667\x00")


def test_t_ok_goes_out_only_as_the_call_for_the_next_part_of_a_file() -> None:
    with Silent() as silent, pytest.raises(WriteRefusedError):
        silent.link.telegram("T_OK")


def answered(answer: bytes, *, then_close: bool = False, pause_s: float = 0.0, patience_s: float = 60.0) -> bytearray:
    """Return what the link makes of these bytes in answer to R_RI."""
    near, far = socket.socketpair()
    link = ReadOnlyLink("", 0, logins=LOGINS, patience_s=patience_s, clock=time.monotonic, pylsv2=library())
    link._socket = near
    link.begin(patience_s)

    def reply() -> None:
        with suppress(OSError):
            far.recv(4096)
            for at in range(0, len(answer), 1 if pause_s else len(answer) or 1):
                far.sendall(answer[at : at + 1] if pause_s else answer)
                time.sleep(pause_s)
            if then_close:
                far.close()

    thread = threading.Thread(target=reply, daemon=True)
    thread.start()
    try:
        return link.telegram("R_RI", b"\x00\x1a")
    finally:
        link.disconnect()
        far.close()
        thread.join(5)


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (b"\x7f\xff\xff\xffS_RI" + b"x" * 100, f"the limit is {PAYLOAD_BYTES_MAX}"),
        (b"\x00\x00\x10\x00S_RI" + b"x" * 10, "no answer to R_RI"),
        (b"\x00\x00", "no answer to R_RI"),
        (b"", "no answer to R_RI"),
        (b"\x00\x00\x00\x00S_PR", "answers 'S_PR' to R_RI"),
        (b"HTTP/1.1 400 Bad Request\r\n", "answers '/1.1' to R_RI"),
    ],
)
def test_an_answer_that_is_none_ends_the_connection_in_time(answer: bytes, why: str) -> None:
    with pytest.raises(ConnectionLostError, match=why):
        answered(answer, patience_s=0.3 if "no answer" in why else 60.0)


def test_a_control_that_closes_in_the_middle_or_drips_byte_by_byte_for_ever_ends_it_too() -> None:
    with pytest.raises(ConnectionLostError, match="closed the connection"):
        answered(b"\x00\x00\x00\x02S_RI\x00", then_close=True)
    began_s = time.monotonic()
    with pytest.raises(ConnectionLostError, match="no answer"):
        answered(b"\x00\x00\x04\x00S_RI" + b"x" * 1000, pause_s=0.05, patience_s=0.3)
    assert time.monotonic() - began_s < 20.0, "it drips for 50 s"
    assert bytes(answered(b"\x00\x00\x00\x02S_RI\x00\x07", pause_s=0.005)) == b"\x00\x07"


@settings(max_examples=60)
@given(answer=st.binary(max_size=40))
def test_any_bytes_are_an_answer_or_the_end_of_the_connection(answer: bytes) -> None:
    near, far = socket.socketpair()
    link = ReadOnlyLink("", 0, logins=LOGINS, patience_s=0.002, clock=time.monotonic, pylsv2=library())
    link._socket = near
    far.sendall(answer)
    try:
        content = link.telegram("R_RI", b"\x00\x1a")
        assert answer[:8] + bytes(content) == answer[: 8 + len(content)]
        assert len(content) == int.from_bytes(answer[:4], "big")
    except ConnectionLostError:
        assert link._socket is None
    finally:
        link.disconnect()
        near.close()
        far.close()
