"""The simulated machine as a client of its agent sees it."""

import time
import urllib.request
from collections.abc import Iterator
from datetime import datetime
from itertools import pairwise

import pytest

from cnctwin.errors import UsageError
from cnctwin.standins.simulated_machine import description
from cnctwin.standins.simulated_machine.agent import COMPILING, SimulatedMachine
from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import Part, spare_part
from tests.cnctwin.program import until
from tests.cnctwin.standins.mtconnect_agent.small_machine import header, observations, values

SPEED = 200.0


class Ready:
    """A part that is there at once."""

    ready = True

    def __init__(self, _number: int) -> None:
        self.part = spare_part()

    def result(self) -> Part:
        return self.part


class Never(Ready):
    """A part that is never there."""

    ready = False


class Broken(Ready):
    """A part that cannot be computed."""

    def result(self) -> Part:
        raise RuntimeError("the kernel is broken")


@pytest.fixture
def machine() -> Iterator[SimulatedMachine]:
    with SimulatedMachine(speed=SPEED, begin=Ready) as running:
        yield running


def fetch(machine: SimulatedMachine, path: str) -> str:
    with urllib.request.urlopen(machine.url + path, timeout=60) as answer:
        body: bytes = answer.read()
        return body.decode()


def test_the_stream_holds_what_the_machine_told_and_leaves_out_nothing(machine: SimulatedMachine) -> None:
    until(lambda: machine.parts >= 2, "two parts")
    text = fetch(machine, "/sample?count=100000")
    numbers = sorted(int(o.attrib["sequence"]) for o in observations(text))
    assert numbers == list(range(1, int(header(text)["nextSequence"])))
    tools = [number for number in values(text, "vmc_Tool_number") if number != "UNAVAILABLE"]
    assert tools[:12] == ["5", None, "1", None, "2", None, "3", None, "4", None, "5", None], (
        "five changes a part, empty meanwhile"
    )
    counts = [count for count in values(text, "vmc_part_count") if count != "UNAVAILABLE"]
    assert counts[:3] == ["0", "1", "2"]
    told = [moment.values["Xabs"] for moment in spare_part().moments if "Xabs" in moment.values]
    shown = values(text, "vmc_Xabs")
    assert [float(x) for x in shown[2 : 2 + len(told)] if x] == [float(x) for x in told]
    assert machine.ledger.balances
    assert not machine.ledger.dropped


def test_the_clock_of_the_machine_goes_with_its_speed(machine: SimulatedMachine) -> None:
    def span_s() -> float:
        stamps = [datetime.fromisoformat(o.attrib["timestamp"]) for o in observations(fetch(machine, "/sample?count=100000"))]
        return (max(stamps) - min(stamps)).total_seconds()

    until(lambda: span_s() > 100.0, "a hundred seconds of the machine")
    begun_s, before_s = time.monotonic(), span_s()
    until(lambda: span_s() > before_s + 200.0, "two hundred more")
    assert 0.5 < time.monotonic() - begun_s < 100.0  # 2 s on an idle computer; 200 s at the speed of a real machine


def test_stamps_never_go_back(machine: SimulatedMachine) -> None:
    until(lambda: machine.parts >= 1, "a part")
    ordered = sorted(observations(fetch(machine, "/sample?count=100000")), key=lambda o: int(o.attrib["sequence"]))
    stamps = [o.attrib["timestamp"] for o in ordered if o.text != "UNAVAILABLE"]
    assert all(datetime.fromisoformat(a) <= datetime.fromisoformat(b) for a, b in pairwise(stamps))


def test_the_probe_describes_what_is_told(machine: SimulatedMachine) -> None:
    probe = fetch(machine, "/probe")
    told = {key for moment in spare_part().moments for key in moment.values}
    assert all(f'name="{key}"' in probe for key in told)


def test_a_stop_in_the_middle_of_a_part_ends_every_thread() -> None:
    machine = SimulatedMachine(speed=20.0, begin=Ready)
    machine.start()
    until(lambda: machine.ledger.lines > 50, "the part to be under way")
    begun_s = time.monotonic()
    assert machine.stop() is True
    assert time.monotonic() - begun_s < 10.0
    lines = machine.ledger.lines
    time.sleep(0.2)
    assert machine.ledger.lines == lines
    assert machine.parts == 0


def test_a_stop_says_where_a_part_is_still_being_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.standins.simulated_machine.agent.COMPUTING_S_MAX", 0.1)
    machine = SimulatedMachine(speed=20.0, begin=Never)
    machine.start()
    until(lambda: machine.ledger.lines > 1, "the machine to be switched on")
    assert machine.stop() is False


def test_while_the_kernels_are_compiled_a_part_is_shown_and_said_to_be_a_spare_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.standins.simulated_machine.agent.PATIENCE_S", 0.1)
    monkeypatch.setattr("cnctwin.standins.simulated_machine.agent.WAITING_SAID_S", 0.1)
    with SimulatedMachine(speed=SPEED, begin=Never) as machine:
        until(lambda: machine.notice == COMPILING, "the notice")
        until(lambda: machine.parts == 1, "the spare part to be made")
        until(lambda: "waits" in machine.notice, "the machine to say that it waits for the next one")


def test_what_keeps_a_part_from_being_computed_is_known_to_whoever_runs_the_machine() -> None:
    with SimulatedMachine(speed=SPEED, begin=Broken) as machine:
        until(lambda: machine.error is not None, "the error")
        assert "the kernel is broken" in str(machine.error)


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_a_speed_that_makes_no_sense_is_refused(speed: float) -> None:
    with pytest.raises(UsageError, match="--speed"):
        SimulatedMachine(speed=speed)


def test_without_the_extra_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(description, "find_spec", lambda name: None if name == "numba" else object())
    with pytest.raises(UsageError, match=r"needs numba; pip install 'cnctwin\[twin\]' brings them"):
        SimulatedMachine()


def test_moments_without_news_only_let_time_pass() -> None:
    machine = SimulatedMachine(begin=lambda *_: pytest.fail("nothing is computed"))
    machine._tell(iter([Moment(0.0, {"Srpm": "1"}), Moment(0.01, {}), Moment(0.02, {"Srpm": "1"})]))
    machine.stop()
    assert machine.ledger.lines == 1
