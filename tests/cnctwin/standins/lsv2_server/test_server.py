"""The LSV2 server, with the real pyLSV2 as a client that knows nothing of us."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pyLSV2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.standins.lsv2_server import plc_memory
from cnctwin.standins.lsv2_server.answers import Answers, Model, Session
from cnctwin.standins.lsv2_server.server import CLIENTS_MAX, Fault, Lsv2Server
from cnctwin.standins.lsv2_server.telegram import PAYLOAD_BYTES_MAX, Telegram, TelegramError, TelegramReader, encode
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.heidenhain.plc import PlcAddress

SWITCHED_ON_S = 1_772_438_400.0
STATE = ControlState(
    exec_state="ACTIVE",
    program="O1701",
    line=118,
    tool_number=3,
    spindle_rpm=4700.0,
    feed_override_pct=87.5,
    rapid_override_pct=50.0,
    axis_pos_mm=(-380.0, -270.5, 1.25),
    alarm=(1020, "SPINDLE OVERLOAD"),
)


def control() -> SimulatedControl:
    return SimulatedControl([STATE], machine_s=lambda: 10.0, switched_on_s=SWITCHED_ON_S, clock_offset_s=2.0)


@contextmanager
def connected(model: Model = Model.ITNC530, **options: Any) -> Iterator[tuple[pyLSV2.LSV2, Lsv2Server]]:
    """A client as anybody would write it."""
    with Lsv2Server(control(), model=model, **options) as server:
        client = pyLSV2.LSV2("127.0.0.1", port=server.port, timeout=30.0, safe_mode=False)
        client.connect()
        try:
            yield client, server
        finally:
            client._llcom.disconnect()


@pytest.mark.parametrize("model", Model)
def test_pylsv2_reads_what_the_control_shows(model: Model) -> None:
    with connected(model) as (client, server):
        assert (client.versions.is_itnc(), client.versions.is_tnc()) == (model is Model.ITNC530, model is Model.TNC640)
        assert client.program_status() is pyLSV2.PgmState.STARTED
        assert client.execution_state() is pyLSV2.ExecState.AUTOMATIC
        stack = client.program_stack()
        assert (stack.main, stack.current, stack.line_no) == ("TNC:\\nc_prog\\O1701.H", "TNC:\\nc_prog\\O1701.H", 118)
        overrides = client.override_state()
        assert (overrides.feed, overrides.spindle, overrides.rapid) == (87.5, 100.0, 50.0)
        assert client.axes_location() == {"X": -380.0, "Y": -270.5, "Z": 1.25}
        assert client.get_remote_datetime() == datetime.fromtimestamp(SWITCHED_ON_S + 12.0)  # noqa: DTZ006  as pyLSV2 does
        assert client.parameters.max_block_length == 4096
        assert server.answers.counters.writes_refused == 0


def test_only_the_itnc_tells_its_tool_and_its_messages() -> None:
    with connected(Model.ITNC530) as (client, _):
        assert (client.spindle_tool_status().number, client.spindle_tool_status().axis) == (3, "Z")
        assert [(message.e_number, message.e_text) for message in client.get_error_messages()] == [(1020, "SPINDLE OVERLOAD")]
    with connected(Model.TNC640) as (client, _):
        assert client.spindle_tool_status() is None
        assert client.get_error_messages() == []


def test_it_gives_its_program_in_parts(tmp_path: Path) -> None:
    with connected() as (client, server):
        entry = client.file_info("TNC:/nc_prog/O1701.H")
        assert (entry.size, entry.name) == (len(server.answers.program_text), "TNC:\\nc_prog\\O1701.H")
        assert client.recive_file("TNC:/nc_prog/O1701.H", tmp_path / "text.h")
        assert (tmp_path / "text.h").read_bytes() == server.answers.program_text.replace("\n", "\r\n").encode()
        assert client.recive_file("TNC:/nc_prog/O1701.H", tmp_path / "binary.h", binary_mode=True)
        assert (tmp_path / "binary.h").read_text() == server.answers.program_text
        assert client.file_info("TNC:/nc_prog/other.h") is None


def test_where_telegrams_of_real_controls_are_public_it_sends_the_same_bytes() -> None:
    answers, session = Answers(control(), Model.ITNC530), Session(logins={"INSPECT", "DNC"})
    version = b"\x00\x00\x004S_VRiTNC530\x00340490 06 SP3\x00800A_AA.PLC\x00%0000111100000000\x00"  # pyLSV2, issue 79
    assert answers.answer(session, Telegram("R_VR")) == version
    assert answers.answer(session, Telegram("R_VR", b"\x01")) == b"\x00\x00\x00\x08S_VRiTNC530\x00"
    axes = b"\x00\x030.0000\x000.0000\x00500.0000\x00X\x00Y\x00Z\x00"  # issue 24, there with B and C as well
    at_rest = Answers(SimulatedControl([ControlState(axis_pos_mm=(0.0, 0.0, 500.0))]), Model.ITNC530)
    assert at_rest.answer(session, Telegram("R_RI", b"\x00\x16"))[8:] == axes


def test_each_block_of_the_program_has_the_number_under_which_it_is_shown() -> None:
    numbers = [line.split()[0] for line in Answers(control()).program_text.splitlines() if not line.startswith(" ")]
    assert numbers == [str(number) for number in range(162)]


def test_every_write_is_refused_and_counted(tmp_path: Path) -> None:
    (tmp_path / "new.h").write_text("0 BEGIN PGM NEW MM\n")
    with connected() as (client, server):
        writes = [
            lambda: client.make_directory("TNC:/new"),
            lambda: client.delete_file("TNC:/nc_prog/O1701.H"),
            lambda: client.delete_empty_directory("TNC:/new"),
            lambda: client.change_directory("TNC:/nc_prog"),
            lambda: client.set_keyboard_access(False),
            lambda: client.send_key_code(pyLSV2.KeyCode.END),
            lambda: client.set_machine_parameter("MP7230.0", "1"),
            lambda: client.grab_screen_dump(tmp_path / "screen.bmp"),
        ]
        for number, write in enumerate(writes, 1):
            assert write() is False
            assert server.answers.counters.writes_refused == number


@pytest.mark.parametrize("password", [b"", b"807667\x00", b"secret\x00"])
def test_a_control_without_a_plc_password_takes_any(password: bytes) -> None:
    session = Session()
    assert Answers(control()).answer(session, Telegram("A_LG", b"PLCDEBUG\x00" + password)) == encode("T_OK")
    assert session.logins == {"PLCDEBUG"}


def test_the_addresses_that_are_told_at_the_start_are_those_that_tell_something() -> None:
    shown = replace(STATE, is_changing_tool=True, coolant_on=True, spindle_load_pct=20.0, feed_mm_min=900.0, spindle_temp_c=31.0)
    with connected() as (client, server):
        server.control = server.answers.control = SimulatedControl([shown], machine_s=lambda: 10.0)
        for address in map(PlcAddress.parse, plc_memory.SHOWN):
            at = address.lies_at(client.parameters)
            assert at is not None
            read = plc_memory.read(shown, *at)
            assert read is not None
            assert address.value(read), str(address)


def test_without_its_log_in_nothing_is_told_and_some_log_ins_are_refused() -> None:
    answers, session = Answers(control(), has_dnc=False, plc_password="807667"), Session()
    for question in (
        Telegram("R_RI", b"\x00\x1a"),
        Telegram("R_MB", b"\0\0\0\0\1"),
        Telegram("R_FL", b"TNC:\\x.h\0"),
        Telegram("R_DT"),
    ):
        assert answers.answer(session, question) == encode("T_ER", b"\x01\x17")
    assert answers.answer(session, Telegram("A_LG", b"DNC\x00")) == encode("T_ER", b"\x01\x31")
    assert answers.answer(session, Telegram("A_LG", b"PLCDEBUG\x00")) == encode("T_ER", b"\x01\x31")
    assert answers.answer(session, Telegram("A_LG", b"PLCDEBUG\x00807667\x00")) == encode("T_OK")
    assert answers.answer(session, Telegram("A_LG", b"ROOT\x00")) == encode("T_ER", b"\x01\x31")


def test_it_is_restarted_on_the_same_port_and_the_control_goes_on() -> None:
    server = Lsv2Server(control())
    server.start()
    port = server.port
    server.stop()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=30.0)
    with server:
        assert server.port == port
        socket.create_connection(("127.0.0.1", port), timeout=30.0).close()
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("lsv2")]


def test_a_port_that_is_taken_is_said() -> None:
    with Lsv2Server(control()) as server, pytest.raises(OSError, match="in use"):
        Lsv2Server(control(), port=server.port).start()


def test_there_are_no_more_clients_than_it_can_bear() -> None:
    with Lsv2Server(control()) as server:
        clients = [socket.create_connection(("127.0.0.1", server.port), timeout=30.0) for _ in range(CLIENTS_MAX + 1)]
        try:
            assert clients[-1].recv(1) == b""
        finally:
            for client in clients:
                client.close()


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (Fault.NONE, b"\x00\x00\x00\x00T_OK"),
        (Fault.PARTIAL, b"\x00\x00\x00\x00T_OK"),
        (Fault.SLOW, b"\x00\x00\x00\x00T_OK"),
        (Fault.DROP, b"\x00\x00\x00\x00"),
        (Fault.LENGTH, b"\x80\x00\x00\x00T_OK"),
        (Fault.ERROR, b"\x00\x00\x00\x02T_ER\x01\x63"),
        (Fault.SHORT, b"\x00\x00\x00\x00T_OK"),
    ],
)
def test_faults_can_be_switched_on(fault: Fault, expected: bytes) -> None:
    waited: list[float] = []
    with Lsv2Server(control(), pause=waited.append) as server:
        server.fault = fault
        with socket.create_connection(("127.0.0.1", server.port), timeout=30.0) as client:
            client.sendall(encode("A_LG", b"INSPECT\x00"))
            found = b""
            while len(found) < len(expected) and (part := client.recv(100)):
                found += part
            if fault is Fault.DROP:
                assert client.recv(1) == b""
        assert found == expected
        assert bool(waited) == (fault is Fault.SLOW)


def test_a_control_that_refuses_closes_each_connection_at_once() -> None:
    with Lsv2Server(control()) as server:
        server.fault = Fault.REFUSE
        with socket.create_connection(("127.0.0.1", server.port), timeout=30.0) as client:
            assert client.recv(1) == b""


def test_a_control_that_hangs_says_nothing() -> None:
    with Lsv2Server(control(), pause=lambda _: None) as server:
        server.fault = Fault.HANG
        with socket.create_connection(("127.0.0.1", server.port), timeout=0.1) as client:
            client.sendall(encode("R_VR"))
            with pytest.raises(TimeoutError):
                client.recv(1)


@given(st.binary(max_size=60), st.integers(1, 9))
def test_any_bytes_are_telegrams_or_the_end(data: bytes, size: int) -> None:
    reader, found, length = TelegramReader(), list[Telegram](), 0
    try:
        for at in range(0, len(data), size):
            found += reader.feed(data[at : at + size])
    except TelegramError:
        pass
    for telegram in found:
        assert len(telegram.payload) <= PAYLOAD_BYTES_MAX
        length += 8 + len(telegram.payload)
    assert b"".join(encode(*telegram) for telegram in found) == data[:length]


@given(st.lists(st.builds(Telegram, st.from_regex(r"[A-Z]_[A-Z]{2}", fullmatch=True), st.binary(max_size=30)), max_size=4))
def test_telegrams_read_back_however_they_were_cut(telegrams: list[Telegram]) -> None:
    data, reader = b"".join(encode(*telegram) for telegram in telegrams), TelegramReader()
    assert [one for byte in data for one in reader.feed(bytes([byte]))] == telegrams


COMMANDS = ["A_LG", "A_LO", "C_CC", "R_VR", "R_PR", "R_CI", "R_RI", "R_MB", "R_FI", "R_FL", "R_DT", "T_OK", "C_FD", "S_FL"]


@settings(max_examples=200)
@given(st.lists(st.tuples(st.sampled_from(COMMANDS), st.binary(max_size=20)), max_size=6))
def test_whatever_is_asked_it_answers_one_telegram(questions: list[tuple[str, bytes]]) -> None:
    answers, session = _ANSWERS, Session(logins={"INSPECT", "DNC", "FILE", "PLCDEBUG", "DIAGNOSTICS"})
    for command, payload in questions:
        (answer,) = TelegramReader().feed(answers.answer(session, Telegram(command, payload)))
        assert answer.command[:2] in ("S_", "T_")


_ANSWERS = Answers(control(), Model.ITNC530)


def test_a_client_that_sends_rubbish_is_dropped_and_others_are_served() -> None:
    with Lsv2Server(control()) as server:
        with socket.create_connection(("127.0.0.1", server.port), timeout=30.0) as client:
            client.sendall(struct.pack("!L", 2**31) + b"R_VR")
            assert client.recv(1) == b""
        with socket.create_connection(("127.0.0.1", server.port), timeout=30.0) as client:
            client.sendall(encode("A_LG", b"INSPECT\x00"))
            assert client.recv(100) == encode("T_OK")
