"""An oscilloscope of an iTNC 530 to be read in tests: a counter on each channel, on a clock that passes when the server waits."""

from collections.abc import Iterator
from contextlib import contextmanager

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.oscilloscope import CHANNELS, LABELS, ServoTrace
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.heidenhain.oscilloscope import Oscilloscope


class Clock:
    """The machine's seconds, which pass when the server waits: the same course on a machine that is busy."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def counters(samples: int) -> ServoTrace:
    """A trace in which each channel counts its samples."""
    return ServoTrace({(axis, number): list(range(samples)) for axis in range(len(LABELS)) for number in range(len(CHANNELS))})


@contextmanager
def scope_server(trace: ServoTrace) -> Iterator[Lsv2Server]:
    """A server of the trace."""
    clock = Clock()
    control = SimulatedControl([ControlState()], machine_s=clock)
    with Lsv2Server(control, model=Model.ITNC530, trace=trace, pause=clock.wait) as running:
        yield running


@contextmanager
def opened(server: Lsv2Server, timeout_s: float) -> Iterator[Oscilloscope]:
    """Its oscilloscope, connected."""
    scope = Oscilloscope(server.url, timeout_s=timeout_s)
    scope.open()
    yield scope
    scope.close()
