"""The connection in real time: it reconnects, it ends when it is closed, and it reads again what was saved meanwhile."""

import random
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Fault, Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState, production
from edge.config import EdgeConfig
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.connection import HeidenhainConnection
from edge.controls.heidenhain.cursor import Cursor
from edge.sweep import Sweep
from tests.edge.controls.heidenhain.machine_time import SWITCHED_ON_S, MachineTime


def control_of(*states: ControlState, **options: Any) -> SimulatedControl:
    return SimulatedControl(states or production(30), **options)


class Reader:
    """Reads a connection in a thread."""

    def __init__(self, url: str, **source: Any) -> None:
        options: dict[str, Any] = {"url": url, "interval_ms": 50, "timeout_s": 0.5} | source
        self.connection = HeidenhainConnection(EdgeConfig(source=HeidenhainConfig(**options)), chance=random.Random(1))
        self.sweeps: list[Sweep] = []
        self._thread = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        for raw in self.connection.frames():
            self.connection.follow(Cursor())
            self.sweeps.append(Sweep.decode(raw))

    def __enter__(self) -> "Reader":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        began_s = time.monotonic()
        self.connection.close()
        self._thread.join(60)
        assert not self._thread.is_alive()
        assert time.monotonic() - began_s < 5.0, "close must end it at once"

    def wait(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, f"waited {timeout_s} s; {self.connection.last_error or 'no error'}"
            time.sleep(0.01)


@pytest.mark.parametrize("fault", [Fault.HANG, Fault.LENGTH, Fault.GARBAGE, Fault.REFUSE], ids=str)
def test_it_ends_at_once_when_it_is_closed_and_goes_on_when_the_control_is_right_again(fault: Fault) -> None:
    with Lsv2Server(control_of(), pause=lambda _: None) as server, Reader(server.url) as reader:
        reader.wait(lambda: len(reader.sweeps) > 2)
        server.fault = fault
        server.drop_clients()
        reader.wait(lambda: reader.connection.reconnects > 1)
        assert reader.connection.last_error.startswith(server.url)
        server.fault = Fault.NONE
        seen = len(reader.sweeps)
        reader.wait(lambda: len(reader.sweeps) > seen + 2)
        assert any(sweep.holes for sweep in reader.sweeps[seen:])
        assert [sweep.number for sweep in reader.sweeps] == list(range(len(reader.sweeps)))
        assert reader.connection.silent_s() < 5.0
        server.fault = fault


def test_a_control_that_is_not_there_is_asked_again_with_longer_and_longer_waits() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        waits: list[float] = []
        source = HeidenhainConfig(url=f"lsv2://127.0.0.1:{taken.getsockname()[1]}", timeout_s=0.5)
        connection = HeidenhainConnection(EdgeConfig(source=source), wait=waits.append, chance=random.Random(1))
        frames = connection.frames()

        def stop(seconds: float) -> None:
            waits.append(seconds)
            if len(waits) > 12:
                connection.close()

        connection._wait = stop
        assert list(frames) == []
    assert all(0.12 <= wait <= 30.0 for wait in waits)
    assert waits[0] < 0.26 < waits[3] < waits[6] < waits[-1]
    assert connection.reconnects == len(waits)


def test_it_ends_at_once_while_it_waits_for_an_address_where_nobody_answers() -> None:
    with socket.socket() as full, socket.socket() as first, socket.socket() as second:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        for waiting in (first, second):  # the queue of connections is full, and the kernel lets all others wait
            waiting.setblocking(False)
            waiting.connect_ex(full.getsockname())
        with Reader(f"lsv2://127.0.0.1:{full.getsockname()[1]}", timeout_s=30.0):
            time.sleep(0.3)


def test_a_log_in_that_is_taken_back_is_asked_for_again() -> None:
    time_ = MachineTime()
    with Lsv2Server(SimulatedControl([ControlState(program="A")], machine_s=time_.now_s)) as server:

        def take_back() -> None:
            server.fault, server.error_code = Fault.ERROR, 23

        def give() -> None:
            server.fault = Fault.NONE

        time_.plan = [(2.0, take_back), (4.0, give)]
        sweeps = looks(server, time_, 20, program_text=False)
    assert {hole.reason.split(";")[0] for sweep in sweeps for hole in sweep.holes} <= {
        "the control has taken back the log-in DNC",
        "the control does not introduce itself: LSV2DataException: Could not read basic version information from control",
    }
    assert sum(bool(sweep.holes) for sweep in sweeps) == 1
    assert {fact.key: fact.fault for fact in sweeps[-1].facts}["line"] == ""


def test_without_the_dnc_option_it_says_what_to_switch_on() -> None:
    with Lsv2Server(control_of(), has_dnc=False) as server, Reader(server.url) as reader:
        reader.wait(lambda: reader.connection.reconnects > 0)
        assert "refuses the log-in DNC (T_ER_NO_LOGIN 49)" in reader.connection.last_error
        assert "option 18" in reader.connection.last_error
        assert not reader.sweeps


def test_a_refused_plc_log_in_costs_the_plc_values_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLC_PASSWORD", "wrong")
    plc = {"plc": {"spindle_rpm": "D1004"}, "plc_password_env": "PLC_PASSWORD"}
    with Lsv2Server(control_of(), plc_password="807667") as server:
        with Reader(server.url, **plc) as reader:
            reader.wait(lambda: len(reader.sweeps) > 1)
        facts = {fact.key: fact for fact in reader.sweeps[-1].facts}
        assert facts["plc:spindle_rpm"].fault == "the control refuses the log-in PLCDEBUG (T_ER_NO_LOGIN 49)"
        assert facts["line"].value is not None
        monkeypatch.setenv("PLC_PASSWORD", "807667")
        with Reader(server.url, **plc) as reader:
            reader.wait(lambda: len(reader.sweeps) > 1)
        assert {fact.key: fact.value for fact in reader.sweeps[-1].facts}["plc:spindle_rpm"] == 0


def looks(server: Lsv2Server, time_: MachineTime, count: int, **source: Any) -> list[Sweep]:
    """So many looks in machine time."""
    config = EdgeConfig(source=HeidenhainConfig(url=server.url, **source))
    connection = HeidenhainConnection(config, clock=time_.now_s, wall_s=time_.wall_s, wait=time_.wait, patience_s=2.0)
    frames = connection.frames()
    try:
        return [Sweep.decode(next(frames)) for _ in range(count)]
    finally:
        frames.close()


def texts(sweep: Sweep) -> list[str]:
    return [str(fact.value) for fact in sweep.facts if fact.key.startswith("text:")]


def test_the_program_is_read_once_and_again_when_it_was_saved_and_is_started() -> None:
    time_ = MachineTime()
    states = [ControlState(0.0, program="A"), ControlState(5.0, "ACTIVE", program="A"), ControlState(8.0, program="B")]
    with Lsv2Server(SimulatedControl(states, machine_s=time_.now_s)) as server:

        def save() -> None:
            server.answers.program_text, server.answers.saved_s = "0 BEGIN PGM A MM\n1 END PGM A MM\n", 1_767_225_999

        time_.plan = [(3.0, save)]
        sweeps = looks(server, time_, 50, program_kib_max=64)
    read = [(round(sweep.t_ms / 1000 - SWITCHED_ON_S, 1), len(text)) for sweep in sweeps for text in texts(sweep)]
    assert [at_s for at_s, _ in read] == [0.0, 5.0, 8.0]
    assert (read[0][1] > 3000, read[1][1]) == (True, 32)


def test_a_program_that_is_too_long_is_not_read() -> None:
    time_ = MachineTime()
    with Lsv2Server(SimulatedControl([ControlState(program="A")], machine_s=time_.now_s)) as server:
        server.answers.program_text = "; long\n" * 1000
        (sweep, *_) = looks(server, time_, 2, program_kib_max=1)
    (fault,) = [fact.fault for fact in sweep.facts if fact.key.startswith("text:")]
    assert "has 7000 bytes, which is above heidenhain.program_kib_max" in fault


def test_the_clock_of_the_control_is_read_now_and_then_and_stamps_nothing() -> None:
    time_ = MachineTime()
    control = SimulatedControl(
        [ControlState(program="A")], machine_s=time_.now_s, switched_on_s=SWITCHED_ON_S, clock_offset_s=3600.0 + 2.5
    )
    with Lsv2Server(control) as server:
        sweeps = looks(server, time_, 200, clock_utc_offset_h=1.0, program_text=False)
        assert not any(sweep.clock for sweep in looks(server, time_, 5, clock_interval_s=0.0))
    readings = [sweep.clock for sweep in sweeps if sweep.clock]
    assert 4 <= len(readings) <= 6
    for reading in readings:
        assert (reading.resolution_ms, reading.stamps_samples) == (1000, False)
        assert 1.5 <= (reading.control_ms - reading.edge_ms) / 1000 <= 2.5  # whole seconds, rounded down


def test_what_this_control_cannot_tell_is_not_even_asked() -> None:
    time_ = MachineTime()
    with Lsv2Server(SimulatedControl([ControlState(program="A")], machine_s=time_.now_s), model=Model.TNC640) as server:
        few = looks(server, time_, 3, program_text=False, plc={"spindle_rpm": "D999996"})
        facts = {fact.key: fact for fact in few[-1].facts}
        assert facts["plc:spindle_rpm"].fault == "answers what cannot be read: ValueError: this control has no D999996"
        assert facts["errors"].fault == "only the iTNC 530 tells it over LSV2"


@pytest.mark.parametrize("code", [24, 90])
def test_a_code_that_says_never_stops_the_asking_for_a_minute_and_any_other_does_not(code: int) -> None:
    time_ = MachineTime()
    with Lsv2Server(SimulatedControl([ControlState(program="A")], machine_s=time_.now_s)) as server:
        config = EdgeConfig(source=HeidenhainConfig(url=server.url, program_text=False, clock_interval_s=0.0))
        connection = HeidenhainConnection(config, clock=time_.now_s, wall_s=time_.wall_s, wait=time_.wait, patience_s=2.0)
        connection.look()
        server.fault, server.error_code = Fault.ERROR, code
        faults = {fact.fault for fact in Sweep.decode(connection.look()).facts}
        assert all(str(code) in fault or "iTNC" in fault for fault in faults)
        server.fault, before = Fault.NONE, server.answers.counters.telegrams
        again = {fact.key: fact for fact in Sweep.decode(connection.look()).facts}
        asked = server.answers.counters.telegrams - before
        assert (asked, again["line"].value is None) == ((0, True) if code == 24 else (5, False))
        time_.pass_by(61.0)
        assert {fact.key: fact.value for fact in Sweep.decode(connection.look()).facts}["line"] == 0
        connection.hang_up()
