"""Frames over a real connection to a real server."""

import gc
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("asyncua")

from cnctwin.standins.simulated_control.state import ControlState
from edge.config import EdgeConfig, SignalSection
from edge.controls.opcua.config import Config
from edge.controls.opcua.connection import OpcUaConnection
from edge.controls.opcua.cursor import parse, start
from edge.sample import EdgeSample, SampleSet
from tests.edge.controls.opcua.conftest import NOW_S, Bench
from tests.edge.host_watch import wait


class Reader:
    """Reads frames, in the test's own thread."""

    def __init__(self, config: Config, **more: Any) -> None:
        self._config, self._cursor = config, start(config)
        self.connection = OpcUaConnection(config, watch_s=0.1, **more)
        self._frames = self.connection.frames()
        self.seen: list[SampleSet] = []

    def until(self, told: Callable[[SampleSet], bool], wait_s: float = 60.0) -> SampleSet:
        watchdog = threading.Timer(wait_s, self.connection.close)
        watchdog.start()
        try:
            for raw in self._frames:
                self._cursor, one = parse(self._config, self._cursor, raw)
                self.connection.follow(self._cursor)
                assert one.accounted()
                self.seen.append(one)
                if told(one):
                    return one
        finally:
            watchdog.cancel()
        pytest.fail(f"it did not come: {self.connection.last_error}")

    def until_value(self, name: str, value: object) -> EdgeSample:
        one = self.until(lambda one: any(s.signal == name and s.value == value for s in one.samples))
        return next(s for s in one.samples if s.signal == name and s.value == value)


@contextmanager
def reading(config: Config, **more: Any) -> Iterator[Reader]:
    reader = Reader(config, **more)
    try:
        yield reader
    finally:
        reader._frames.close()  # type: ignore[attr-defined]
        wait(lambda: not any(thread.name == "opcua" for thread in threading.enumerate()), "the connection's thread to end")


def test_first_the_state_as_found_then_each_change_with_the_controls_own_time(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        first = reader.until(lambda one: bool(one.samples))
        assert {s.signal: s.value for s in first.samples}["tool_number"] == 3
        assert all(s.is_baseline for s in first.samples)
        assert len(first.offers or ()) == 26
        bench.show(ControlState(tool_number=3, exec_state="ACTIVE", program="O1", line=6, block="T4 M6"))
        bench.show(ControlState(tool_number=0, exec_state="ACTIVE", program="O1", line=6, block="T4 M6"))
        bench.show(ControlState(tool_number=4, exec_state="ACTIVE", program="O1", line=7))
        sample = reader.until_value("tool_number", 4)
        assert sample.timestamp_ms == round((NOW_S + bench.machine_s) * 1000)
        assert not sample.is_baseline
        numbers = [s.value for one in reader.seen[1:] for s in one.samples if s.signal == "tool_number"]
        assert numbers == [0, 4]


def test_five_values_within_one_publish_all_arrive(bench: Bench) -> None:
    with reading(bench.config(publishing_ms=400)) as reader:
        reader.until(lambda one: bool(one.samples))
        for line in range(10, 15):
            bench.show(ControlState(line=line))
        reader.until_value("nc_line", 14)
        assert [s.value for one in reader.seen[1:] for s in one.samples if s.signal == "nc_line"] == [10, 11, 12, 13, 14]


def test_time_goes_on_and_the_clock_is_read_while_nothing_happens(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        reader.until(lambda one: bool(one.samples))
        quiet = reader.until(lambda one: one.clock is not None and not one.samples)
        assert quiet.clock is not None
        assert quiet.clock.control_ms == round((NOW_S + bench.machine_s) * 1000)
        assert quiet.clock.stamps_samples
        assert quiet.available is True
        assert reader.connection.silent_s() < 5.0


def test_bad_and_wrong_values_are_nulls_with_a_reason_and_the_others_go_on(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        reader.until(lambda one: bool(one.samples))
        bench.server.set_status("/Channel/Spindle/actSpeed[u1,1]", "BadSensorFailure")
        bench.server.set_value("/Channel/Spindle/driveLoad[u1,1]", "a lot")
        bench.server.set_value("/Channel/State/actFeedRateIpo[u1,1]", [1.0, 2.0])
        reader.until(lambda one: any(s.signal == "feed_mm_min" for s in one.samples))
        reasons = {s.signal: s.reason for one in reader.seen[1:] for s in one.samples}
        assert reasons == {
            "spindle_rpm": "BadSensorFailure",
            "spindle_load_pct": "not a number: 'a lot'",
            "feed_mm_min": "an array of 2 values, of which none is named",
        }
        bench.show(ControlState(line=77))
        reader.until_value("nc_line", 77)


def test_a_queue_that_ran_over_at_the_server_is_a_stated_hole(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        reader.until(lambda one: bool(one.samples))
        bench.server.set_value("/Channel/ProgramInfo/actLineNumber[u1,1]", 99, overflow=True)
        one = reader.until(lambda one: bool(one.gaps))
        assert one.gaps[0].reason == "queue of the server ran over: nc_line"
        assert one.gaps[0].lost > 0
        assert [(s.value, s.is_baseline) for s in one.samples] == [(99, True)]


def test_a_node_that_the_server_does_not_have_is_a_null_that_says_so(bench: Bench) -> None:
    nodes = {"vibration_rms_g": "nsu=SinumerikVarProvider;s=/no/such", "ambient_temp_c": "nsu=urn:other;i=5"}
    signals = {name: SignalSection(data_item=node) for name, node in nodes.items()}
    config = EdgeConfig(source=bench.config().source, signals=signals)
    with reading(config) as reader:
        first = reader.until(lambda one: bool(one.samples))
        reasons = {s.signal: s.reason for s in first.samples if s.value is None}
        assert reasons == {"vibration_rms_g": "BadNodeIdUnknown", "ambient_temp_c": "the server has no namespace urn:other"}


def test_a_server_that_has_lost_its_control_says_so(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        reader.until(lambda one: one.available is True)
        bench.server.set_state("CommunicationFault")
        assert reader.until(lambda one: one.available is False).error == "the server's state is CommunicationFault"
        bench.server.set_state("Running")
        reader.until(lambda one: one.available is True and one.error is None)


def test_an_edge_that_reads_too_slowly_states_what_it_missed(bench: Bench) -> None:
    with reading(bench.config(), frames_max=2) as reader:
        reader.until(lambda one: one.clock is not None)
        for line in range(100, 110):
            bench.show(ControlState(line=line))
            time.sleep(0.06)
        bench.show(ControlState(line=500))
        time.sleep(0.06)

        def missed() -> int:
            samples = [s for one in reader.seen for s in one.samples if s.signal == "nc_line"]
            return 11 - len([s for s in samples if isinstance(s.value, int) and s.value >= 100])

        def stated() -> int:
            return sum(gap.lost for one in reader.seen for gap in one.gaps if gap.reason == "this edge was too slow")

        reader.until(lambda _: stated() > 0 and stated() >= missed())
        assert missed() > 0


def test_an_open_connection_is_said_to_be_open_for_as_long_as_it_lasts(bench: Bench) -> None:
    with reading(bench.config(security="none")) as reader:
        reader.until(lambda one: bool(one.samples))
        assert reader.connection.last_error.endswith('not encrypted, not authenticated: opcua.security = "none"')


def test_a_server_that_is_not_there_is_tried_again_with_pauses_and_close_ends_it_at_once(bench: Bench) -> None:
    connection = OpcUaConnection(bench.config(url="opc.tcp://127.0.0.1:1"))
    closed_s: list[float] = []

    def close() -> None:
        wait(lambda: connection.reconnects > 0, "the first failure")
        time.sleep(0.7)
        closed_s.append(time.monotonic())
        connection.close()

    threading.Thread(target=close).start()
    assert list(connection.frames()) == []
    assert time.monotonic() - closed_s[0] < 5.0
    assert 1 <= connection.reconnects <= 5
    assert "is the server running, and the address right?" in connection.last_error


def test_while_the_server_hangs_it_can_be_closed_and_leaves_no_socket_behind(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        reader.until(lambda one: bool(one.samples))
        bench.server.slow_s = 12.0
        time.sleep(0.5)
        begun_s = time.monotonic()
        reader.connection.close()
        time.sleep(0.1)
        assert list(reader._frames) == []  # which closes it once more
        assert time.monotonic() - begun_s < 10.0
        bench.server.slow_s = 0.0
    gc.collect()  # a socket that was left open would be told of now, which is an error here
