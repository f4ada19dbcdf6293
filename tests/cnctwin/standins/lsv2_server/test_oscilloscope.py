"""The oscilloscope of the simulated iTNC 530, as pyLSV2 itself reads it."""

import logging
import struct
from collections.abc import Iterator
from typing import Any

import pyLSV2
import pytest

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.oscilloscope import BUFFER_S, CHANNELS, LABELS, ServoTrace
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from tests.edge.controls.heidenhain.scope_on_trial import Clock

TRACE = ServoTrace(
    {
        (axis, number): [1000 * axis + 100 * number + tick for tick in range(5000)]
        for axis in range(len(LABELS))
        for number in range(len(CHANNELS))
    }
)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def server(clock: Clock) -> Iterator[Lsv2Server]:
    control = SimulatedControl([ControlState()], machine_s=clock)
    with Lsv2Server(control, model=Model.ITNC530, trace=TRACE, pause=clock.wait) as running:
        yield running


@pytest.fixture
def client(server: Lsv2Server) -> Iterator[Any]:
    logging.getLogger("LSV2 Client").setLevel(logging.CRITICAL)
    opened = pyLSV2.LSV2("127.0.0.1", port=server.port, timeout=10.0, safe_mode=False)
    opened.connect()
    yield opened
    opened.disconnect()


def test_the_library_lists_a_signal_for_each_axis_and_channel(client: Any) -> None:
    names = [signal.normalized_name() for signal in client.read_scope_signals()]
    assert names[:4] == ["x_s_actual", "y_s_actual", "z_s_actual", "x_s_nominal"]
    assert len(names) == len(set(names)) == len(LABELS) * len(CHANNELS)


def test_the_library_reads_values_at_the_pace_of_the_machine(client: Any, clock: Clock) -> None:
    offered = {signal.normalized_name(): signal for signal in client.read_scope_signals()}
    chosen = [offered["x_s_actual"], offered["z_i_nominal"]]
    packets = client.real_time_readings(chosen, 5, 3000)
    first = next(packets)
    assert (chosen[0].unit.strip("\x00"), chosen[0].factor, chosen[1].unit.strip("\x00")) == ("mm", 1e-4, "A")
    x, current = first.get_data()
    assert x.data == [5 * tick for tick in range(32)]
    assert current.data == [2300 + 5 * tick for tick in range(32)]
    # The library asks for a second packet before it hands out the first, and that one is never seen.
    assert clock.now_s == pytest.approx(2 * 32 * 0.003)
    assert next(packets).get_data()[0].data[0] == 5 * 64


def test_signals_that_there_are_not_are_refused(client: Any) -> None:
    assert client.login(pyLSV2.Login.SCOPE)
    for payload in (struct.pack("!LHHL", 600, 99, 0, 0), struct.pack("!LHHL", 601, 0, 0, 0), struct.pack("!L", 600)):
        client._llcom.telegram(pyLSV2.CMD.R_OP, bytearray(payload))
        assert (client._llcom.last_response, client._llcom.last_error.e_code) == (pyLSV2.RSP.T_ER, 83)
    client._llcom.telegram(pyLSV2.CMD.R_OD, bytearray(16))
    assert client._llcom.last_response == pyLSV2.RSP.T_ER


def test_a_client_that_comes_too_late_is_told_of_the_overrun(client: Any, clock: Clock) -> None:
    offered = client.read_scope_signals()
    packets = client.real_time_readings(offered[:1], 5, 600)
    next(packets)
    clock.wait(BUFFER_S + 1.0)
    assert list(packets) == []
    assert (client._llcom.last_response, client._llcom.last_error.e_code) == (pyLSV2.RSP.T_BD, 112)


def test_without_the_log_in_and_on_another_control_there_is_none(server: Lsv2Server, client: Any) -> None:
    client._llcom.telegram(pyLSV2.CMD.R_OC)
    assert client._llcom.last_error.e_code == 23
    server.answers.scope_password = "other"
    assert not client.login(pyLSV2.Login.SCOPE, "wrong")
    assert client.login(pyLSV2.Login.SCOPE, "other")
    with (
        Lsv2Server(SimulatedControl([ControlState()]), model=Model.TNC640, trace=TRACE) as other,
        pyLSV2.LSV2("127.0.0.1", port=other.port, timeout=10.0, safe_mode=False) as tnc,
    ):
        assert not tnc.login(pyLSV2.Login.SCOPE)
