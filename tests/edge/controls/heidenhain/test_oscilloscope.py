"""Reading the oscilloscope: signals, packets, and each way in which it cannot be had."""

import itertools
from collections.abc import Iterator

import pytest

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Fault, Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.heidenhain.control import library
from edge.controls.heidenhain.link import SCOPE_READS, ReadOnlyLink, WriteRefusedError
from edge.controls.heidenhain.oscilloscope import Oscilloscope, ScopeError
from tests.edge.controls.heidenhain.scope_on_trial import counters, opened, scope_server

TRACE = counters(5000)


@pytest.fixture
def server() -> Iterator[Lsv2Server]:
    with scope_server(TRACE) as running:
        yield running


@pytest.fixture
def scope(server: Lsv2Server) -> Iterator[Oscilloscope]:
    with opened(server, 2.0) as ready:
        yield ready


def test_every_packet_comes_with_its_values_in_the_control_s_unit(scope: Oscilloscope) -> None:
    signals = [one for one in scope.signals() if one.name in {"x_s_actual", "y_i_nominal"}]
    assert scope.select(signals, 600) == ("mm", "A")
    packets = list(itertools.islice(scope.packets(signals, 600), 4))
    assert [packet.number for packet in packets] == [0, 1, 2, 3]
    values = [value for packet in packets for value in packet.values[0]]
    steps = [round((later - earlier) / 1e-4) for earlier, later in itertools.pairwise(values)]
    assert set(steps) == {1}
    assert scope.control.startswith("iTNC530")


def test_what_cannot_be_selected_is_said(scope: Oscilloscope) -> None:
    signals = scope.signals()
    with pytest.raises(ScopeError, match="--interval 1000 is none of 600, 3000, 21000"):
        scope.select(signals[:1], 1000)
    with pytest.raises(ScopeError, match="more than the 30"):
        scope.select(signals * 3, 600)
    with pytest.raises(ScopeError, match="every 3000 µs at best"):
        scope.select([signals[0]._replace(interval_us=3000)], 600)


@pytest.mark.parametrize("fault", [Fault.HANG, Fault.DROP, Fault.GARBAGE, Fault.LENGTH, Fault.SHORT, Fault.OTHER, Fault.ERROR])
def test_a_fault_on_the_way_is_one_line(server: Lsv2Server, fault: Fault) -> None:
    server.fault_s = 3.0
    opened = Oscilloscope(server.url, timeout_s=2.0)
    opened.open()
    signals = opened.signals()[:2]
    opened.select(signals, 3000)
    packets = opened.packets(signals, 3000)
    next(packets)
    server.fault = fault
    with pytest.raises(ScopeError) as error:
        next(packets)
    assert "\n" not in str(error.value)
    opened.close()


def test_a_control_without_it_and_a_log_in_that_is_refused_are_named(server: Lsv2Server) -> None:
    with (
        Lsv2Server(SimulatedControl([ControlState()]), model=Model.TNC640) as other,
        pytest.raises(ScopeError, match="is a TNC640, whose oscilloscope LSV2 does not show"),
    ):
        Oscilloscope(other.url).open()
    server.answers.scope_password = "807667"
    with pytest.raises(ScopeError, match=r"refuses the log-in OSZI .*--password-env"):
        Oscilloscope(server.url).open()
    opened = Oscilloscope(server.url, password="807667")
    opened.open()
    opened.close()
    port = server.port
    server.stop()
    with pytest.raises(ScopeError, match="is the control on"):
        Oscilloscope(f"lsv2://127.0.0.1:{port}").open()


def test_the_telegrams_of_the_oscilloscope_pass_only_a_link_that_is_made_for_it() -> None:
    def link(**more: object) -> ReadOnlyLink:
        return ReadOnlyLink("", 0, logins=(), patience_s=0.1, clock=lambda: 0.0, pylsv2=library(), **more)  # type: ignore[arg-type]

    for word in ("R_OC", "R_OP", "R_OD"):
        with pytest.raises(WriteRefusedError):
            link().telegram(word)
        with pytest.raises(Exception, match="not open"):
            link(more_reads=SCOPE_READS).telegram(word)
    with pytest.raises(WriteRefusedError):
        link(more_reads=SCOPE_READS).telegram("C_FD", b"x")
