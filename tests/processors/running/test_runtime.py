"""Processors on a real broker: killed in the middle, started again, stopped by SIGTERM."""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from processors.config import Configuration
from processors.errors import ConfigurationError, UnknownProcessorError
from processors.running.runtime import configured, run, runner_of
from processors.thermal import PROCESSOR as THERMAL
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId, Reading
from sparkplug.quality import Quality
from tests.processors.alerts.courier.office import until
from tests.processors.streams import T0_MS, UNITS, engine_of, fed
from tests.processors.streams import birth as birth_event
from tests.processors.streams import data as data_event
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto

CONFIGURATION = "[thermal]\nambient_temp_c = 20.0\n"


class Reader:
    """A client that reads everything: the last readings of the twins, and all plain topics."""

    def __init__(self, broker: BrokerAddress) -> None:
        self.plain: dict[str, bytes] = {}
        self.readings: dict[tuple[str, str | None, str], Reading] = {}
        self.events: list[HostEvent] = []
        self._host = HostApplication(broker, "reader", publish_state=False)
        for topic_filter in ("cnctwin/#", "cnc/#"):
            self._host.subscribe_plain(topic_filter)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read)
        self._host.start()
        self._thread.start()

    def _read(self) -> None:
        while not self._stop.is_set():
            for event in self._host.poll(0.05):
                if event.kind is EventKind.PLAIN:
                    self.plain[event.topic] = event.payload
                    continue
                self.events.append(event)
                self.readings |= {(event.node.node, event.device, r.name): r for r in event.readings}

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._host.stop()

    @property
    def online(self) -> bool:
        return self._host.online

    def twin(self, name: str, processor: str = "thermal") -> Reading | None:
        return self.readings.get((f"twin-{processor}", "okuma", name))

    def ledger(self, processor: str = "thermal") -> dict[str, Any]:
        told = self.readings.copy()  # the thread goes on reading
        return {name: one.value for (node, device, name), one in told.items() if (node, device) == (f"twin-{processor}", None)}

    def state(self) -> dict[str, Any]:
        """The live lane of the retained snapshot of the thermal processor, and the state."""
        payload = self.plain.get("cnctwin/snapshot/thermal/okuma")
        live = {} if payload is None else json.loads(payload)["live"]
        return live["machines"]["okuma"] | {"state": live["state"]} if live else {}


@pytest.fixture
def broker(mosquitto: Mosquitto) -> BrokerAddress:
    return BrokerAddress(*mosquitto.address)


@pytest.fixture
def reader(broker: BrokerAddress) -> Iterator[Reader]:
    reader = Reader(broker)
    yield reader
    reader.close()


@pytest.fixture
def edge(broker: BrokerAddress) -> Iterator[EdgeNode]:
    """A machine's edge, with speed and load; it beats once a second, as a real one does."""
    heartbeat = MetricSpec("health/beat", DataType.INT64)
    node = EdgeNode(broker, NodeId("cnc", "edge-okuma"), [heartbeat])
    specs = [MetricSpec(n, DataType.DOUBLE, unit=UNITS[n]) for n in ("spindle_rpm", "spindle_load_pct")]
    node.declare_device("okuma", specs)
    node.start()
    until(lambda: node.online, "the edge")
    stop = threading.Event()

    def beat() -> None:
        while not stop.wait(0.2):
            node.publish(None, [Change("health/beat", 1, time.time_ns() // 1_000_000)])

    thread = threading.Thread(target=beat)
    thread.start()
    yield node
    stop.set()
    thread.join()
    node.stop()


def say(edge: EdgeNode, at_s: float, **values: float) -> None:
    """The machine changes, in the event time of a recording."""
    edge.publish("okuma", [Change(name, value, T0_MS + round(at_s * 1000)) for name, value in values.items()])


def process(broker: BrokerAddress, tmp_path: Path, *names: str) -> subprocess.Popen[bytes]:
    """Processors in a process of their own."""
    config = tmp_path / "processors.toml"
    config.write_text(CONFIGURATION)
    code = (
        "import sys; from pathlib import Path; from processors.running.runtime import configured, run\n"
        "from cnctwin.processes.stopping import stopped_by_signals; from sparkplug.broker import BrokerAddress\n"
        f"pairs, broker = configured({names!r}, Path(sys.argv[1])), BrokerAddress(port={broker.port})\n"
        "with stopped_by_signals() as stop: run(pairs, broker, stop, session_dir=Path(sys.argv[2]))"
    )
    command = [sys.executable, "-c", code, str(config), str(tmp_path / "sessions")]
    return subprocess.Popen(command, cwd=Path(__file__).parents[3])


@pytest.mark.broker
def test_killed_in_the_middle_and_started_again_the_end_state_is_the_same(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, tmp_path: Path
) -> None:
    say(edge, 0.0, spindle_rpm=6000.0, spindle_load_pct=50.0)
    first = process(broker, tmp_path, "thermal")
    try:
        until(lambda: reader.state().get("clock_ms"), "the first snapshot")
        say(edge, 200.0, spindle_rpm=8000.0)
        until(lambda: reader.state().get("last_ms") == T0_MS + 200_000, "a snapshot of the second message")
    finally:
        first.kill()
        first.wait()
    until(lambda: any(e.kind is EventKind.DEATH and e.node.node == "twin-thermal" for e in list(reader.events)), "the will")
    say(edge, 300.0, spindle_load_pct=80.0)  # nobody listens: this is the hole
    second = process(broker, tmp_path, "thermal")
    try:
        until(lambda: reader.state().get("last_ms") == T0_MS + 300_000, "the restart")
        say(edge, 400.0, spindle_rpm=2000.0)
        end = until(lambda: reader.state().get("last_ms") == T0_MS + 400_000 and reader.state(), "the end")
        until(lambda: reader.ledger().get("health/holes") == 1, "the counted hole")
        ledger = reader.ledger()
        assert ledger["ledger/received"] == ledger["ledger/emitted"] + ledger["ledger/dropped"]
    finally:
        second.terminate()
        assert second.wait(60) == 0

    undisturbed = engine_of(THERMAL, ambient_temp_c=20.0)
    fed(
        undisturbed,
        birth_event(0.0, spindle_rpm=6000.0, spindle_load_pct=50.0),
        data_event(200.0, spindle_rpm=8000.0),
        data_event(300.0, spindle_load_pct=80.0),
        data_event(400.0, spindle_rpm=2000.0),
    )
    state = undisturbed._machines["okuma"].live.state
    heat = THERMAL.given(Configuration(THERMAL.config), "okuma").heat
    expected = heat.step(state.heat, state.told, end["state"]["at_s"] - state.at_s)
    assert end["state"]["told"] == list(state.told)
    assert end["state"]["heat"][0] == pytest.approx(expected.temperature_c, abs=1e-9)


@pytest.mark.broker
def test_three_processors_in_one_process_and_a_clean_stop(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, tmp_path: Path
) -> None:
    running = process(broker, tmp_path, "thermal", "cutting_force", "mirror")
    try:
        say(edge, 0.0, spindle_rpm=3000.0, spindle_load_pct=50.0)
        until(lambda: reader.twin("twin/cutting_force_n", "cutting_force"), "the force")
        say(edge, 3.0, spindle_rpm=3000.0, spindle_load_pct=60.0)
        until(lambda: (r := reader.twin("twin/spindle_temp_c")) and r.value, "the temperature")
        temperature = reader.twin("twin/spindle_temp_c")
        assert temperature is not None
        assert (temperature.unit, temperature.quality) == ("°C", Quality.GOOD)
        until(lambda: "cnc/okuma/twin/cutting_force_n" in reader.plain, "the mirror of a twin")
        shown = json.loads(until(lambda: reader.plain.get("cnc/okuma/spindle_rpm"), "the mirror of a control"))
        assert shown == {"value": 3000.0, "t": shown["t"], "unit": "rev/min", "quality": "good"}
        for name in ("thermal", "cutting_force", "mirror"):
            until(lambda name=name: reader.ledger(name).get("ledger/received"), f"the ledger of {name}")
    finally:
        running.send_signal(signal.SIGTERM)
        assert running.wait(60) == 0
    until(lambda: json.loads(reader.plain["cnc/okuma/spindle_rpm"])["quality"] == "stale", "the mirror's goodbye")
    until(lambda: reader.twin("twin/spindle_temp_c").quality is Quality.STALE, "the twin's death")  # type: ignore[union-attr]


@pytest.mark.broker
def test_what_an_edge_sends_late_comes_out_as_history_and_leaves_the_present_alone(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode
) -> None:
    with until_stopped(run, configured(["cutting_force", "mirror"]), broker):
        say(edge, 500.0, spindle_rpm=3000.0, spindle_load_pct=50.0)

        def force() -> Reading | None:
            # The birth may come first, with a null.
            reading = reader.twin("twin/cutting_force_n", "cutting_force")
            return None if reading is None or reading.value is None else reading

        present = until(force, "the force")
        for at_ms in (1000, 2500):  # a speed is steady once it has been seen for a second
            told = (("spindle_rpm", 1500.0), ("spindle_load_pct", 50.0))
            edge.publish("okuma", [Change(n, v, T0_MS + at_ms, is_historical=True) for n, v in told])

        def history() -> list[Reading]:
            readings = [r for e in list(reader.events) for r in e.readings if r.name == "twin/cutting_force_n"]
            return [r for r in readings if r.is_historical and r.value is not None]

        (past,) = until(history, "the history")
        assert past.timestamp_ms == T0_MS + 2000
        assert past.value == pytest.approx(2 * present.value, abs=0.2)

        def shown(name: str) -> float | None:
            value = json.loads(reader.plain.get(f"cnc/okuma/{name}", b"{}")).get("value")
            return None if value is None else float(value)

        assert until(lambda: shown("twin/cutting_force_n"), "the mirror") == present.value
        assert until(lambda: shown("spindle_rpm"), "the mirror") == 3000.0


@pytest.mark.broker
def test_when_the_edge_dies_twin_and_mirror_are_stale_and_come_back(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode
) -> None:
    with until_stopped(run, configured(["thermal", "mirror"]), broker):
        say(edge, 0.0, spindle_rpm=3000.0, spindle_load_pct=50.0)
        say(edge, 2.0, spindle_rpm=3000.0)
        until(lambda: (r := reader.twin("twin/spindle_temp_rise_k")) and r.quality is Quality.GOOD, "the rise")
        edge.remove_device("okuma")
        until(lambda: reader.twin("twin/spindle_temp_rise_k").quality is Quality.STALE, "the twin's death")  # type: ignore[union-attr]
        until(lambda: json.loads(reader.plain.get("cnc/okuma/spindle_rpm", b"{}")).get("quality") == "stale", "a stale mirror")
        edge.declare_device("okuma", [MetricSpec(n, DataType.DOUBLE) for n in ("spindle_rpm", "spindle_load_pct")])
        say(edge, 4.0, spindle_rpm=3000.0, spindle_load_pct=50.0)
        until(lambda: reader.twin("twin/spindle_temp_rise_k").quality is Quality.GOOD, "the twin's rebirth")  # type: ignore[union-attr]
        until(lambda: json.loads(reader.plain["cnc/okuma/spindle_rpm"])["quality"] == "good", "a good mirror")


@pytest.mark.broker
def test_a_broker_that_is_killed_and_comes_back_empty_is_given_everything_again(
    mosquitto: Mosquitto, broker: BrokerAddress, reader: Reader, edge: EdgeNode
) -> None:
    with until_stopped(run, configured(["thermal", "mirror"]), broker):
        say(edge, 0.0, spindle_rpm=3000.0, spindle_load_pct=50.0)
        until(lambda: reader.state() and "cnc/okuma/spindle_rpm" in reader.plain, "the start")
        mosquitto.kill()
        until(lambda: not reader.online, "the reader to notice")
        reader.plain.clear()
        mosquitto.start()
        until(reader.state, "the snapshot")
        until(lambda: json.loads(reader.plain.get("cnc/okuma/spindle_rpm", b"{}")).get("quality") == "good", "the mirror")
        for name in ("thermal", "mirror"):
            ledger = until(lambda name=name: reader.ledger(name), "the ledger")
            dropped = ledger["ledger/dropped"] + ledger["ledger/buffered"]
            assert ledger["ledger/received"] == ledger["ledger/emitted"] + dropped


@pytest.mark.broker
def test_a_processor_that_fails_dies_as_a_node_and_is_born_again_while_the_other_goes_on(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, tmp_path: Path
) -> None:
    runner = runner_of(configured(["thermal", "mirror"]), broker, session_dir=tmp_path)
    (thermal,) = [worker for worker in runner.workers if worker.name == "thermal"]
    with until_stopped(runner.run):
        say(edge, 0.0, spindle_rpm=6000.0, spindle_load_pct=50.0)
        until(lambda: reader.state().get("last_ms") == T0_MS, "the first snapshot")
        beat, broken = thermal.engine.beat, [True]

        def failing(at_ms: int) -> Any:
            if broken.pop() if broken else False:
                raise ZeroDivisionError("our own bug")
            return beat(at_ms)

        thermal.engine.beat = failing  # type: ignore[method-assign]

        def deaths() -> list[str]:
            return [e.node.node for e in list(reader.events) if e.kind is EventKind.DEATH and e.device is None]

        until(lambda: "twin-thermal" in deaths(), "the death of the node")
        until(lambda: reader.ledger().get("health/restarts") == 1, "its restart")
        assert "our own bug" in reader.ledger()["health/fault"]
        say(edge, 100.0, spindle_rpm=8000.0)
        until(lambda: reader.state().get("last_ms") == T0_MS + 100_000, "the message after the restart")
        until(lambda: (r := reader.twin("twin/spindle_temp_rise_k")) and r.quality is Quality.GOOD, "the twin")
        assert set(deaths()) == {"twin-thermal"}
        until(lambda: balanced(reader, "thermal") and balanced(reader, "mirror"), "ledgers that balance")


def balanced(reader: Reader, name: str) -> bool:
    ledger = reader.ledger(name)
    dropped = ledger["ledger/dropped"] + ledger["ledger/buffered"]
    return bool(ledger["ledger/received"] == ledger["ledger/emitted"] + dropped)


def test_everything_is_checked_before_anything_connects(tmp_path: Path) -> None:
    config = tmp_path / "processors.toml"
    with pytest.raises(UnknownProcessorError, match=r"no processor 'termal'; did you mean thermal\? there are: "):
        configured(["termal"])
    with pytest.raises(UnknownProcessorError, match="no processor 'engine'"):
        configured(["engine"])
    config.write_text("[thermal]\nresistance_k_per_w = -1.0\n")
    with pytest.raises(ConfigurationError, match=r"\[thermal\] resistance_k_per_w = -1.0"):
        configured(["thermal"], config)
    config.write_text("[termal]\n")
    with pytest.raises(ConfigurationError, match=r"\[termal\] is not known; did you mean thermal\?"):
        configured(["thermal"], config)
    config.write_text("tick_s = 1\n")
    with pytest.raises(ConfigurationError, match="tick_s is in no table; put it below its processor"):
        configured(["thermal"], config)
    with pytest.raises(ConfigurationError, match="No such file"):
        configured(["thermal"], tmp_path / "missing.toml")
    config.write_text("[gapp]\n[thermal]\ntick = 2\n[thermal.machines.vmc]\ngap_s_max = 0\n[cutting_force]\nefficency = 1\n")
    with pytest.raises(ConfigurationError) as wrong:
        configured(["thermal", "cutting_force"], config)
    assert str(wrong.value).split("\n  ") == [
        f"{config}: 4 faults; see docs/reference/processors.md",
        "[gapp] is not known; did you mean gap?",
        "[thermal] tick is not known; did you mean tick_s?",
        "[thermal.machines.vmc] gap_s_max = 0: must be above 0",
        "[cutting_force] efficency is not known; did you mean efficiency?",
    ]
    config.write_text("[cutting_force]\nefficiency = 0.7\n")
    assert [processor.name for processor, _ in configured(["thermal", "thermal"], config)] == ["thermal"]
